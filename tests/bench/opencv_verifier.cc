#include "bench/opencv_verifier.h"

#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

namespace cairn::bench {
namespace {

class OpenCvVerifier : public PairVerifier {
 public:
  OpenCvVerifier(int method, const TwoViewOptions& options) : method_(method), options_(options) {
    cv::setNumThreads(1);
  }

  PairReport Verify(const PairInput& input) override {
    PairReport report;
    report.verifier = "opencv";
    if (static_cast<int>(input.matches.size()) < options_.min_num_matches) {
      report.status = PairStatus::kTooFewMatches;
      return report;
    }
    Normalize(input);
    const double focal = 0.5 * (input.camera1->MeanFocal() + input.camera2->MeanFocal());
    const double max_error_px = options_.max_error_px > 0.0 ? options_.max_error_px : 1.0;
    const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
    cv::Mat E, mask;
    try {
      E = cv::findEssentialMat(points1_, points2_, identity, method_, options_.confidence,
                               max_error_px / focal, options_.max_iterations, mask);
    } catch (const cv::Exception&) {  // It throws where it finds no model.
      return report;
    }
    if (E.rows != 3 || E.cols != 3) return report;
    cv::Mat R, t;
    report.num_inliers = cv::recoverPose(E, points1_, points2_, identity, R, t, mask);
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation;
    cv::cv2eigen(R, rotation);
    cv::cv2eigen(t, translation);
    report.geometry.cam2_from_cam1 = Rigid3d(rotation, translation);
    report.status = PairStatus::kVerified;
    return report;
  }

 private:
  void Normalize(const PairInput& input) {
    points1_.clear();
    points2_.clear();
    for (const FeatureMatch& match : input.matches) {
      const auto x1 = input.camera1->CamFromImg(input.keypoints1[match.point1].Position());
      const auto x2 = input.camera2->CamFromImg(input.keypoints2[match.point2].Position());
      if (!x1 || !x2) continue;
      points1_.emplace_back(x1->x(), x1->y());
      points2_.emplace_back(x2->x(), x2->y());
    }
  }

  int method_;
  TwoViewOptions options_;
  std::vector<cv::Point2d> points1_, points2_;
};

}  // namespace

std::unique_ptr<PairVerifier> MakeOpenCvVerifier(const std::string& name,
                                                 const TwoViewOptions& options) {
  if (name == "opencv_usac_accurate") {
    return std::make_unique<OpenCvVerifier>(cv::USAC_ACCURATE, options);
  }
  if (name == "opencv_usac_magsac") {
    return std::make_unique<OpenCvVerifier>(cv::USAC_MAGSAC, options);
  }
  return nullptr;
}

}  // namespace cairn::bench
