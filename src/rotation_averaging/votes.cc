#include "rotation_averaging/votes.h"

#include <algorithm>

namespace cairn {
namespace {

constexpr size_t kMaxTried = 32;

}  // namespace

double Support(const Eigen::Quaterniond& rotation, std::span<const Vote> votes, double sigma) {
  double support = 0;
  for (const Vote& vote : votes) {
    const double c = vote.rotation.dot(rotation);                   // cos of half of the angle
    const double squared_angle = 4.0 * std::max(0.0, 1.0 - c * c);  // 4 sin^2(angle / 2)
    support += vote.trust / (1.0 + squared_angle / (sigma * sigma));
  }
  return support;
}

Mode FindMode(std::span<const Vote> votes, double sigma) {
  Mode mode;
  const size_t num = std::min(votes.size(), kMaxTried);
  for (size_t k = 0; k < num; ++k) {
    const Eigen::Quaterniond& rotation = votes[k * votes.size() / num].rotation;
    const double support = Support(rotation, votes, sigma);
    if (support > mode.support) mode = {rotation, support};
  }
  mode.rotation.normalize();
  return mode;
}

}  // namespace cairn
