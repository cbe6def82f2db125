#include <set>

#include "database/query.h"
#include "database/sql.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

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
  for (const sql::TableOfItems& table : sql::kTablesOfItems) {
    std::vector<int64_t> items;
    {
      Query query(*impl_, table.read);
      while (query.Step()) {
        if (IsOf(query.Int(0), images)) items.push_back(query.Int(0));
      }
    }
    for (const int64_t item : items) Run(*impl_, table.erase, item);
  }
  for (const image_t id : images) {
    for (const char* sql :
         {sql::kDeleteKeypoints, sql::kDeleteDescriptors, sql::kDeleteDepthSamples}) {
      Run(*impl_, sql, id);
    }
  }
}

void Database::DeleteImagesAndPairs(const std::set<image_t>& images) {
  DeleteFeaturesAndPairs(images);
  for (const image_t id : images) {
    std::string name;
    {
      Query query(*impl_, sql::kReadImageName, id);
      if (!query.Step()) continue;
      name = query.Text(0);
    }
    Run(*impl_, sql::kDeletePhoto, name);
    DeleteJob(kStageCameras, id);
    DeleteImage(id);
  }
}

}  // namespace cairn
