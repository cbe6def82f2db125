#include "translation_averaging/thrown_away.h"

#include <algorithm>
#include <limits>

#include "cairn/math/median.h"

namespace cairn {

std::vector<int> ThrownAway(const DirectionProblem& problem, const Eigen::Matrix3Xd& centers) {
  constexpr double kMaxRatio = 1e3;
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::vector<double> lengths;
  std::vector<double> nearest(problem.NumCameras(), kNone);
  for (const DirectionProblem::Edge& edge : problem.edges) {
    const double length = (centers.col(edge.camera2) - centers.col(edge.camera1)).norm();
    lengths.push_back(length);
    for (const int camera : {edge.camera1, edge.camera2}) {
      nearest[camera] = std::min(nearest[camera], length);
    }
  }
  std::vector<int> thrown_away;
  if (lengths.empty()) return thrown_away;
  const double most = kMaxRatio * UpperMedian(lengths);
  for (int camera = 0; camera < problem.NumCameras(); ++camera) {
    if (nearest[camera] > most && nearest[camera] < kNone) thrown_away.push_back(camera);
  }
  return thrown_away;
}

}  // namespace cairn
