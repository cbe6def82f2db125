#pragma once

#include <Eigen/Core>
#include <vector>

namespace cairn {

// How likely a variable of the F distribution is above f.
double TailOfF(double f, double freedom1, double freedom2);

// So few control points that every choice of wrong ones among them can be tried.
inline constexpr size_t kFewRows = 12;

// Which of a few surveyed points are wrong: the least set without which the similarity from `src`
// to `dst` agrees better than chance among all sets of its size explains (1 %), by the F test of
// the drop of the squares (Baarda, A testing procedure for use in geodetic networks, 1968, for sets
// of points), if each of the set is off by more than 30 standard deviations of the others, as
// errors of models seldom are. Then the least larger set of fewer than half in the same way. How
// exact the points are, they show themselves, but none is more so than min_sigma. Not for GPS of
// photographs, whose errors are alike where a receiver repeats its fix.
std::vector<bool> FindWrongRows(const std::vector<Eigen::Vector3d>& src,
                                const std::vector<Eigen::Vector3d>& dst, double min_sigma);

}  // namespace cairn
