#include "pipeline/stages/foreign_features.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "cairn/base/error.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

bool IsSimilarity(const Keypoint& keypoint) {
  constexpr float kRounding = 1e-3F;
  const float size = std::abs(keypoint.a11) + std::abs(keypoint.a21);
  return std::abs(keypoint.a11 - keypoint.a22) <= kRounding * size &&
         std::abs(keypoint.a12 + keypoint.a21) <= kRounding * size;
}

}  // namespace

bool HasForeignSift(const Database& database) {
  std::set<uint64_t> ours;
  for (const JobRecord& job : database.ReadJobs(kStageFeatures)) ours.insert(job.item);
  for (const auto& [id, num] : database.ReadNumDescriptors()) {
    if (num == 0 || ours.contains(id)) continue;
    try {
      const auto keypoints = database.ReadKeypoints(id);
      if (keypoints && !keypoints->empty()) return std::ranges::all_of(*keypoints, IsSimilarity);
    } catch (const IoError&) {  // whoever needs the row reports it
    }
  }
  return false;
}

}  // namespace cairn
