#include <set>

#include "database/query.h"
#include "database/sql.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

// Tables with rows of pairs, or (jobs but those of cameras, and times) of images and pairs.
struct TableOfImages {
  const char* read;
  const char* erase;
};
constexpr TableOfImages kTables[] = {{sql::kReadMatchItems, sql::kDeleteMatches},
                                     {sql::kReadTwoViewItems, sql::kDeleteTwoViewGeometry},
                                     {sql::kReadPairMetricItems, sql::kDeletePairMetrics},
                                     {sql::kReadPairChoiceItems, sql::kDeletePairChoice},
                                     {sql::kReadFocalEvidenceItems, sql::kDeleteFocalEvidence},
                                     {sql::kReadJobItems, sql::kDeleteJobsOfItem},
                                     {sql::kReadTimingItems, sql::kDeleteTimingsOfItem}};

// Is the item one of the images, or a pair with one of them? (Ids of pairs are larger than those of
// images.)
bool IsOf(int64_t item, const std::set<image_t>& images) {
  const auto has = [&](int64_t id) { return images.count(static_cast<image_t>(id)) > 0; };
  constexpr int64_t kBase = kMaxNumImages;
  if (item < 0) return false;
  return item < kBase ? has(item) : has(item / kBase) || has(item % kBase);
}

}  // namespace

void Database::DeleteFeaturesAndPairs(const std::set<image_t>& images) {
  for (const TableOfImages& table : kTables) {
    std::vector<int64_t> items;
    {
      Query query(*impl_, table.read);
      while (query.Step()) {
        if (IsOf(query.Int(0), images)) items.push_back(query.Int(0));
      }
    }
    for (const int64_t item : items) Query(*impl_, table.erase).Bind(1, item).Run();
  }
  for (const image_t id : images) {
    for (const char* sql :
         {sql::kDeleteKeypoints, sql::kDeleteDescriptors, sql::kDeleteDepthSamples}) {
      Query(*impl_, sql).Bind(1, id).Run();
    }
  }
}

void Database::DeleteImagesAndPairs(const std::set<image_t>& images) {
  DeleteFeaturesAndPairs(images);
  for (const image_t id : images) {
    std::string name;
    {
      Query query(*impl_, sql::kReadImageName);
      if (!query.Bind(1, id).Step()) continue;
      name = query.Text(0);
    }
    Query(*impl_, sql::kDeletePhoto).Bind(1, std::string_view(name)).Run();
    DeleteJob(kStageCameras, id);
    DeleteImage(id);
  }
}

}  // namespace cairn
