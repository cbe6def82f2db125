#include "cairn/database/database.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {
namespace {

template <class Id>
std::map<Id, DepthVotes> ReadVotes(Database::Impl& impl, const char* sql) {
  std::map<Id, DepthVotes> votes;
  if (!impl.has_cairn_tables) return votes;
  Query query(impl, sql);
  while (query.Step()) votes[static_cast<Id>(query.Int(0))] = {query.Int(1), query.Int(2)};
  return votes;
}

template <class Id>
void WriteVotes(Database::Impl& impl, const char* sql, Id id, const DepthVotes& votes) {
  Query(impl, sql).Bind(1, id).Bind(2, votes.num_hypotheses).Bind(3, votes.num_right).Run();
}

}  // namespace

std::map<image_pair_t, DepthVotes> Database::ReadPairDepthVotes() const {
  return ReadVotes<image_pair_t>(*impl_, sql::kReadPairDepthVotes);
}

void Database::WritePairDepthVotes(image_pair_t pair_id, const DepthVotes& votes) {
  WriteVotes(*impl_, sql::kWritePairDepthVotes, pair_id, votes);
}

std::map<image_t, DepthVotes> Database::ReadImageDepthVotes() const {
  return ReadVotes<image_t>(*impl_, sql::kReadImageDepthVotes);
}

void Database::WriteImageDepthVotes(image_t image_id, const DepthVotes& votes) {
  WriteVotes(*impl_, sql::kWriteImageDepthVotes, image_id, votes);
}

}  // namespace cairn
