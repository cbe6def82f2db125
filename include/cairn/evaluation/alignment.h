#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "cairn/geometry/rigid3d.h"

namespace cairn {

// The similarity that minimizes sum w_k |dst_k - s R src_k - t|^2 (Umeyama 1991). `weights` may be
// empty (all 1). nullopt with fewer than two points, or if all source points coincide. Collinear
// points leave the rotation about the line open: one solution is returned.
std::optional<Sim3d> AlignSimilarity(const std::vector<Eigen::Vector3d>& src,
                                     const std::vector<Eigen::Vector3d>& dst,
                                     const std::vector<double>& weights = {});

// All triples of n points, at least three, or 3000 drawn from `seed` where there are more.
std::vector<std::array<uint32_t, 3>> SampleTriples(uint32_t n, uint64_t seed);

// AlignSimilarity with up to half of the points far off: least median of residuals over triples of
// points (all of them, or 3000 drawn from `seed` where there are more), then 20 rounds of L1
// (reweighted) over the residuals under three medians; of three points, least squares. nullopt with
// fewer than three points or where no triple fixes a similarity.
std::optional<Sim3d> AlignSimilarityRobust(const std::vector<Eigen::Vector3d>& src,
                                           const std::vector<Eigen::Vector3d>& dst,
                                           uint64_t seed = 0);

// The rotation dst_world_from_src_world Q with src_k Q^T ~ dst_k, for cam_from_world rotations
// src_k and dst_k, that minimizes the sum of angles (Hartley, Aftab and Trumpf, L1 rotation
// averaging using the Weiszfeld algorithm, 2011), started at the best of the single estimates.
// nullopt if there are none.
std::optional<Eigen::Quaterniond> AlignRotationsL1(const std::vector<Eigen::Quaterniond>& src,
                                                   const std::vector<Eigen::Quaterniond>& dst);

}  // namespace cairn
