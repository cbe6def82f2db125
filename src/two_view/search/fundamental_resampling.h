#pragma once

#include <Eigen/Core>
#include <vector>

#include "cairn/base/rng.h"
#include "cairn/robust/fundamental_refinement.h"
#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// Where most of what F explains lies near one plane, many fundamental matrices explain nearly as
// much, and each is a local optimum. Rounds of samples look for a better one: seven points of those
// that F explains, and two points off the plane that dominates these, which with its homography
// give F = [e] H (plane and parallax: Chum, Werner and Matas, "Two-view geometry estimation
// unaffected by a dominant plane", CVPR 2005). The best are refined and compared at the scale of
// the pair's noise, until rounds bring nothing. One that no plausible focal lengths make an
// essential matrix counts half.
class FundamentalResampling {
 public:
  FundamentalResampling(const PairInput& input, const PreparedPair& pair)
      : pair_(pair), camera1_(*input.camera1), camera2_(*input.camera2) {}
  // F of normalized points, and so the result, refined at the scale of the noise.
  Eigen::Matrix3d Run(const Eigen::Matrix3d& start, Rng* rng);

 private:
  struct Hypothesis {
    Eigen::Matrix3d F;
    double support;
  };

  void FindExplained(const Eigen::Matrix3d& F);
  void SampleSeven(Rng* rng);
  void SamplePlaneAndParallax(Rng* rng);
  void FindPlane(Rng* rng);
  void Add(const Eigen::Matrix3d& F);
  // On so many points near `start`, spread over all matches.
  Eigen::Matrix3d Refine(const Eigen::Matrix3d& start, const FundamentalRefinementOptions& options,
                         int max_num_points);
  double SupportAt(const Eigen::Matrix3d& F, double sigma_px) const;
  // Moves the most supported hypotheses to the front, plausible ones before others; their number.
  int ChooseHypotheses(int max_count);

  const PreparedPair& pair_;
  const Camera &camera1_, &camera2_;
  PointPairs supported_, near_;
  std::vector<float> errors_, scratch_;
  std::vector<int32_t> explained_, near_indices_, off_plane_;
  std::vector<Hypothesis> hypotheses_;
  Eigen::Matrix3d H_;
};

}  // namespace cairn::internal
