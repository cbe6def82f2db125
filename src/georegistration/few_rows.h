#pragma once

#include <Eigen/Core>
#include <vector>

namespace cairn {

// So few places that are known that every choice of wrong ones among them can be tried.
inline constexpr size_t kFewRows = 12;

// Which of a few places are wrong: the least set without which the similarity from `src` to `dst`
// agrees better than chance among all sets of its size explains (1 %), by the F test of the drop
// of the weighted squares (Baarda, A testing procedure for use in geodetic networks, 1968, for sets
// of points), if each of the set is off by more than 30 standard deviations of the others: of
// models that bend, one in twenty has ends that are. Then the least larger set in the same way.
// `sigmas` are relative: how good all are, they show themselves, but none is better than min_sigma.
std::vector<bool> FindWrongRows(const std::vector<Eigen::Vector3d>& src,
                                const std::vector<Eigen::Vector3d>& dst,
                                const std::vector<double>& sigmas, double min_sigma);

}  // namespace cairn
