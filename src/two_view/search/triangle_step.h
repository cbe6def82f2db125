#pragma once

#include <array>
#include <vector>

#include "cairn/solvers/one_affine_depth_batch.h"
#include "two_view/search/pose_search.h"

namespace cairn::internal {

// A step of the cascade: three matches with depth a hypothesis. The triangle that they span is an
// affine frame as well, one of the scene's size, which needs neither the frames of features nor the
// gradients of depth, and goes through the solver of 1AC+D. Right matches span triangles of one
// shape in both images: of many random triples only those that do best are scored, so a sample
// costs nanoseconds.
class TriangleDepthStep {
 public:
  // Returns the number of triples drawn.
  int Run(const PairInput& input, const PreparedPair& pair, int max_num_samples,
          int max_num_refined, PoseSearch* search);

 private:
  struct Triple {
    std::array<uint32_t, 3> index;  // into points_
    float distortion;  // largest over smallest of the squared ratios of its edges, at least 1
  };
  void Lift(const PairInput& input, const PreparedPair& pair);
  void DrawTriples(const PairInput& input, int count);
  Triple Measure(const std::array<uint32_t, 3>& index) const;

  std::vector<std::array<Eigen::Vector3f, 2>> points_;  // in both cameras
  std::vector<Triple> triples_;
  OneAffineDepthBatch batch_;
};

}  // namespace cairn::internal
