#include <filesystem>
#include <fstream>
#include <sstream>

#include "cairn/rotation_averaging/rotation_averaging.h"
#include "support/shared_data.h"
#include "support/test.h"
#include "unit/rotation_averaging/rotation_test_util.h"

namespace cairn {
namespace {

// Lines `num_ids` ids and 9 numbers.
template <class Fn>
void ForEachLine(const std::string& path, int num_ids, const Fn& fn) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream in(line);
    std::vector<image_t> ids(num_ids);
    for (image_t& id : ids) in >> id;
    Eigen::Matrix3d R;
    for (int k = 0; k < 9; ++k) in >> R(k / 3, k % 3);
    fn(ids, Eigen::Quaterniond(R).normalized());
  }
}

// Real edges of 1DSfM; COLMAP 4.2: median 0.560, mean 2.79 degrees, 93.4 % within 5
// (tests/bench/README.md).
TEST(RotationAveragingData, EllisIslandIsBetterThanThePeers) {
  const std::string folder = SharedDataPath("1dsfm/Ellis_Island_rotations/");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  std::vector<RotationEdge> edges;
  ForEachLine(folder + "edges.txt", 2, [&](const auto& ids, const Eigen::Quaterniond& q) {
    edges.push_back({ids[0], ids[1], q});
  });
  Rotations reference;
  ForEachLine(folder + "reference_rotations.txt", 1,
              [&](const auto& ids, const Eigen::Quaterniond& q) { reference[ids[0]] = q; });
  ASSERT_EQ(edges.size(), 20297u);

  const RotationAveragingReport report = AverageRotations(edges);
  EXPECT_EQ(report.status, RotationAveragingStatus::kSuccess);
  EXPECT_EQ(report.cam_from_world.size(), 247u);
  const auto errors = AlignedRotationErrorsDeg(report.cam_from_world, reference);
  EXPECT_EQ(errors.size(), 227u);
  const ErrorSummary summary = Summarize(errors);
  EXPECT_LT(summary.median, 0.43);
  EXPECT_LT(summary.mean, 2.2);
  EXPECT_GE(summary.FractionBelow(5.0), 0.938);
}

}  // namespace
}  // namespace cairn
