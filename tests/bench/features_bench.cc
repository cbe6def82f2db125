// Features of photographs and of the same photographs under known affine maps: how many are found
// again and matched right, how exact their frames are, and the time.
// usage: features_bench PHOTOGRAPH ...
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "cairn/evaluation/error_statistics.h"
#include "cairn/features/features.h"

namespace cairn {
namespace {

constexpr int kNumFeatures = 2000;
constexpr double kMaxRatio = 0.85;  // of the angles to the nearest two descriptors
constexpr double kRightWithin = 3;  // px
constexpr double kAngles[] = {0.3, 1.7};

struct Warp {
  Bitmap image;
  Eigen::Matrix2d A;  // there = A here + t
  Eigen::Vector2d t;
};

// Turned by an angle, then x compressed by the tilt, as a slanted plane is.
Warp MakeWarp(const Bitmap& gray, double angle, double tilt) {
  const cv::Mat source(gray.height, gray.width, CV_8UC1, const_cast<uint8_t*>(gray.data.data()));
  const Eigen::Matrix2d R = Eigen::Rotation2Dd(angle).toRotationMatrix();
  const Eigen::Vector2d size(gray.width, gray.height);
  const Eigen::Vector2d turned_size = R.cwiseAbs() * size;
  const Eigen::Vector2d t = 0.5 * (turned_size - R * size);
  const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5);
  const Eigen::Vector2d shift =
      R * half + t - half;  // OpenCV's pixels have their centers at integers
  const cv::Mat map =
      (cv::Mat_<double>(2, 3) << R(0, 0), R(0, 1), shift[0], R(1, 0), R(1, 1), shift[1]);
  cv::Mat turned, tilted;
  cv::warpAffine(source, turned, map,
                 cv::Size(static_cast<int>(turned_size[0]), static_cast<int>(turned_size[1])),
                 cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  const double sigma = 0.8 * std::sqrt(tilt * tilt - 1);  // so that nothing aliases
  cv::GaussianBlur(turned, turned, cv::Size(2 * static_cast<int>(4 * sigma) + 1, 1), sigma, 1e-3);
  cv::resize(turned, tilted, cv::Size(static_cast<int>(turned.cols / tilt), turned.rows));
  Warp warp;
  warp.image = {tilted.cols, tilted.rows, 1, {tilted.data, tilted.data + tilted.total()}};
  const Eigen::Vector2d scale(static_cast<double>(tilted.cols) / turned.cols, 1.0);
  warp.A = scale.asDiagonal() * R;
  warp.t = scale.cwiseProduct(t);
  return warp;
}

struct Counts {
  int num_matches = 0;
  std::vector<double> errors_px, scale_errors, shape_errors;  // of right matches
};

// Angles between descriptors, in radians.
Eigen::MatrixXf Angles(const Descriptors& a, const Descriptors& b) {
  const Eigen::MatrixXf cosines = a.cast<float>() * b.cast<float>().transpose() / (512.0f * 512.0f);
  return cosines.array().min(1.0f).acos();
}

// The nearest feature of another place than the nearest one's.
float SecondAngle(const Eigen::MatrixXf& angles, int i, int nearest, const Features& features) {
  float second = 10;
  for (int j = 0; j < angles.cols(); ++j) {
    const auto& keypoints = features.keypoints;
    if ((keypoints[j].Position() - keypoints[nearest].Position()).norm() > 1) {
      second = std::min(second, angles(i, j));
    }
  }
  return second;
}

void CountMatches(const Features& here, const Features& there, const Warp& warp, Counts& counts) {
  const Eigen::MatrixXf angles = Angles(here.descriptors, there.descriptors);
  for (int i = 0; i < angles.rows(); ++i) {
    int nearest = 0;
    const float first = angles.row(i).minCoeff(&nearest);
    if (first > kMaxRatio * SecondAngle(angles, i, nearest, there)) continue;
    ++counts.num_matches;
    const Keypoint &a = here.keypoints[i], &b = there.keypoints[nearest];
    const double error = (warp.A * a.Position() + warp.t - b.Position()).norm();
    if (error > kRightWithin) continue;
    const Eigen::Matrix2d difference = b.Shape() * a.Shape().inverse() * warp.A.inverse();
    const double scale = std::sqrt(std::abs(difference.determinant()));
    counts.errors_px.push_back(error);
    counts.scale_errors.push_back(std::abs(std::log(scale)));
    counts.shape_errors.push_back((difference / scale - Eigen::Matrix2d::Identity()).norm());
  }
}

double MedianOrNan(const std::vector<double>& values) {
  return values.empty() ? NAN : Median(values);
}

void Run(const std::vector<Bitmap>& photographs) {
  FeatureOptions options;
  options.max_num_features = kNumFeatures;
  std::printf(
      "| tilt | matches | right | error px | of scale | of shape | ms an image "
      "|\n|---|---|---|---|---|---|---|\n");
  for (const double tilt : {1.3, 2.0, 3.0}) {
    Counts counts;
    std::clock_t clocks = 0;
    for (const Bitmap& gray : photographs) {
      for (const double angle : kAngles) {
        const Warp warp = MakeWarp(gray, angle, tilt);
        const std::clock_t begin = std::clock();
        const Features here = ExtractFeatures(gray, options),
                       there = ExtractFeatures(warp.image, options);
        clocks += std::clock() - begin;
        CountMatches(here, there, warp, counts);
      }
    }
    std::printf("| %.1f | %d | %zu | %.2f | %.3f | %.3f | %.0f |\n", tilt, counts.num_matches,
                counts.errors_px.size(), MedianOrNan(counts.errors_px),
                MedianOrNan(counts.scale_errors), MedianOrNan(counts.shape_errors),
                1e3 * static_cast<double>(clocks) / CLOCKS_PER_SEC /
                    static_cast<double>(2 * std::size(kAngles) * photographs.size()));
  }
}

}  // namespace
}  // namespace cairn

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: features_bench PHOTOGRAPH ...\n");
    return 2;
  }
  std::vector<cairn::Bitmap> photographs;
  for (int i = 1; i < argc; ++i) {
    photographs.push_back(cairn::ReadBitmap(argv[i], cairn::BitmapColor::kGray));
  }
  cairn::Run(photographs);
}
