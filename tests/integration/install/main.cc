// Makes a pair with known truth, verifies it by 1AC+D, and compares.
#include <cstdio>

#include "cairn/synthetic/two_view_problem.h"
#include "cairn/two_view/pair_verifier.h"

int main() {
  const cairn::TwoViewProblem problem = cairn::MakeTwoViewProblem({.outlier_ratio = 0.5}, 1);
  cairn::PairInput input;
  input.pair_id = cairn::ImagePairToPairId(1, 2);
  input.camera1 = &problem.camera1;
  input.camera2 = &problem.camera2;
  input.keypoints1 = problem.keypoints1;
  input.keypoints2 = problem.keypoints2;
  input.depth1 = problem.depth1;
  input.depth2 = problem.depth2;
  input.matches = problem.matches;
  const auto verifier = cairn::MakePairVerifier(cairn::VerifierKind::kOneAcDepth, {});
  const cairn::PairReport report = verifier->Verify(input);
  if (report.status != cairn::PairStatus::kVerified) return 1;
  const double error = cairn::AngleBetween(report.geometry.cam2_from_cam1->rotation,
                                           problem.cam2_from_cam1.rotation);
  std::printf("%d inliers, rotation error %g rad\n", report.num_inliers, error);
  return error < 1e-3 ? 0 : 1;
}
