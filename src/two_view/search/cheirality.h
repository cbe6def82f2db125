#pragma once

#include <span>

#include "cairn/geometry/epipolar.h"
#include "robust/match_errors.h"
#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// Are matches in front of both cameras, or so far away that noise decides the sign of their depths?
class Cheirality {
 public:
  explicit Cheirality(const PreparedPair& pair);

  CheiralityTest TestOf(const Rigid3d& pose) const { return CheiralityTest(pose, far_angle_); }

  // Of the four poses of an essential matrix, given by any one of them, the one with the most of
  // these matches in front; of more than a hundred, some are looked at.
  struct Choice {
    Rigid3d pose;
    double share = 0.0;  // of the matches
  };
  Choice Choose(const Rigid3d& pose, std::span<const int32_t> matches) const;

  // What support of a pose is worth: the share of the matches near its epipolar lines that it puts
  // in front of both cameras.
  double WeightOf(const Rigid3d& pose);

 private:
  const PreparedPair& pair_;
  double far_angle_;
  MatchErrors errors_;
};

}  // namespace cairn::internal
