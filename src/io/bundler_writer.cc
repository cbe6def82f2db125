#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "base/text.h"
#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/io/bundler.h"
#include "io/bundler_frame.h"
#include "io/writers.h"

namespace cairn {
namespace {

// The two coefficients that are nearest to the distortion within the image, by least squares.
Eigen::Vector2d NearestRadial(const Camera& camera) {
  constexpr int kNumRadii = 50;
  const Eigen::Vector2d focals(camera.FocalX(), camera.FocalY());
  const double max_radius = 0.5 * camera.DiagonalPx() / camera.MeanFocal();
  Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  for (int k = 1; k <= kNumRadii; ++k) {
    const double r = max_radius * k / kNumRadii;
    double distorted = 0;  // mean of four directions
    for (const int axis : {0, 1}) {
      for (const double sign : {-1.0, 1.0}) {
        const Eigen::Vector2d pixel = camera.ImgFromCam(sign * r * Eigen::Vector2d::Unit(axis));
        distorted += 0.25 * sign * (pixel - camera.PrincipalPoint())[axis] / focals[axis];
      }
    }
    const Eigen::Vector2d by(std::pow(r, 3), std::pow(r, 5));
    A += by * by.transpose();
    b += by * (distorted - r);
  }
  return A.ldlt().solve(b);
}

// The focal length (px), k1 and k2.
Eigen::Vector3d IntrinsicsOf(const Camera& camera) {
  Eigen::Vector3d intrinsics(camera.MeanFocal(), 0, 0);
  if (!camera.IsPlanar()) return intrinsics;
  if (camera.model == CameraModel::kFullOpenCV) {
    intrinsics.tail<2>() = NearestRadial(camera);
    return intrinsics;
  }
  const std::vector<int> distortion = camera.DistortionIndices();
  if (!distortion.empty()) intrinsics[1] = camera.params[distortion[0]];
  if (distortion.size() >= 2) intrinsics[2] = camera.params[distortion[1]];
  return intrinsics;
}

// Bundler's origin: the image center, or (for cameras of unknown size, read from Bundler) zero.
Eigen::Vector2d CenterOf(const Camera& camera) {
  return 0.5 * Eigen::Vector2d(camera.width, camera.height);
}

double TangentialOf(const Camera& camera) {
  if (!camera.IsPlanar() || camera.model == CameraModel::kFullOpenCV) return 0;
  const std::vector<int> distortion = camera.DistortionIndices();
  double largest = 0;
  for (size_t i = 2; i < distortion.size(); ++i) {
    largest = std::max(largest, std::abs(camera.params[distortion[i]]));
  }
  return largest;
}

// What the format has no place for.
struct Omission {
  std::function<double(const Camera&)> measure;
  double negligible;
  std::string what, unit, consequence;
};

// "<n> of <m> cameras have <what> of up to <largest><unit>: <consequence>", if any has.
void Warn(const Reconstruction& reconstruction, const Omission& omission,
          std::vector<std::string>& warnings) {
  int count = 0;
  double largest = 0;
  for (const auto& [id, camera] : reconstruction.cameras) {
    const double value = omission.measure(camera);
    count += value > omission.negligible;
    largest = std::max(largest, value);
  }
  if (count == 0) return;
  warnings.push_back("Bundler: " + std::to_string(count) + " of " +
                     std::to_string(reconstruction.cameras.size()) + " cameras have " +
                     omission.what + " of up to " + Formatted("%.3g", largest) + omission.unit +
                     ": " + omission.consequence);
}

// Names the camera models that the format cannot hold.
void WarnOfModels(const Reconstruction& reconstruction, std::vector<std::string>& warnings) {
  std::map<CameraModel, int> counts;
  for (const auto& [id, camera] : reconstruction.cameras) ++counts[camera.model];
  for (const auto& [model, count] : counts) {
    if (CameraModelIsPlanar(model) && model != CameraModel::kFullOpenCV) continue;
    warnings.push_back("Bundler: " + std::to_string(count) + " of " +
                       std::to_string(reconstruction.cameras.size()) +
                       " cameras are of the model " + std::string(CameraModelName(model)) +
                       (CameraModelIsPlanar(model)
                            ? ": the nearest two radial coefficients are written"
                            : ", which the format does not have: their focal length is written as "
                              "that of a pinhole, which does not reproject"));
  }
}

std::vector<std::string> Approximations(const Reconstruction& reconstruction,
                                        const std::vector<Image>& images) {
  std::vector<std::string> warnings;
  const auto aspect = [](const Camera& c) {
    return 100 * std::abs(c.FocalX() - c.FocalY()) / c.MeanFocal();
  };
  Warn(reconstruction,
       {aspect, 1e-9, "a difference between fx and fy", " %", "their mean is written"}, warnings);
  const auto offset = [](const Camera& c) { return (c.PrincipalPoint() - CenterOf(c)).norm(); };
  Warn(reconstruction,
       {offset, 1e-6, "a distance between principal point and image center", " px",
        "the format has none, keys stay relative to the image center"},
       warnings);
  WarnOfModels(reconstruction, warnings);
  Warn(reconstruction, {TangentialOf, 0, "a tangential distortion", "", "it is left out"},
       warnings);
  const auto has_blank = [](const Image& i) {
    return i.name.find_first_of(" \t") != std::string::npos;
  };
  const auto num_blank = std::count_if(images.begin(), images.end(), has_blank);
  if (num_blank > 0) {
    warnings.push_back("Bundler: " + std::to_string(num_blank) +
                       " image names contain blanks, which other programs cannot read");
  }
  return warnings;
}

void WriteCamera(const Reconstruction& reconstruction, image_t image_id, TextWriter& out) {
  const auto it = reconstruction.images.find(image_id);
  if (it == reconstruction.images.end()) {
    for (int line = 0; line < 5; ++line) out << "0 0 0\n";
    return;
  }
  out << IntrinsicsOf(reconstruction.CameraOf(it->second)) << "\n";
  const Eigen::Matrix3d R = FlipYZ() * it->second.cam_from_world.RotationMatrix();
  const Eigen::Vector3d t = FlipYZ() * it->second.cam_from_world.translation;
  out << R.row(0) << "\n" << R.row(1) << "\n" << R.row(2) << "\n" << t << "\n";
}

void WritePoint(const Reconstruction& reconstruction, const Point3D& point,
                const std::map<image_t, size_t>& camera_index, TextWriter& out) {
  out << point.xyz << "\n" << point.color << "\n" << point.track.size();
  for (const TrackElement& element : point.track) {
    const RegisteredImage& image = reconstruction.images.at(element.image_id);
    const Eigen::Vector2d offset =
        image.points2D.at(element.point2D) - CenterOf(reconstruction.CameraOf(image));
    out << " " << camera_index.at(element.image_id) << " " << element.point2D << " " << offset.x()
        << " " << -offset.y();
  }
  out << "\n";
}

std::vector<Image> RegisteredImages(const Reconstruction& reconstruction) {
  std::vector<Image> images;
  for (const auto& [id, image] : reconstruction.images) images.push_back(image.image);
  return images;
}

}  // namespace

std::vector<std::string> WriteBundler(const Reconstruction& reconstruction,
                                      const std::string& bundle_path, const std::string& list_path,
                                      const std::vector<Image>& all_images) {
  const std::vector<Image> images =
      all_images.empty() ? RegisteredImages(reconstruction) : all_images;
  std::map<image_t, size_t> camera_index;
  for (size_t i = 0; i < images.size(); ++i) camera_index.emplace(images[i].image_id, i);
  for (const auto& [id, image] : reconstruction.images) {
    CAIRN_CHECK(camera_index.contains(id));
  }

  TextWriter list(list_path);
  for (const Image& image : images) {
    if (image.name.find('\n') != std::string::npos) {
      throw IoError(list_path, "'" + image.name + "' cannot be a name in a list");
    }
    list << image.name << "\n";
  }
  TextWriter out(bundle_path);
  out << "# Bundle file v0.3\n" << images.size() << " " << reconstruction.points3D.size() << "\n";
  for (const Image& image : images) WriteCamera(reconstruction, image.image_id, out);
  for (const auto& [id, point] : reconstruction.points3D) {
    WritePoint(reconstruction, point, camera_index, out);
  }
  BlockWriter::CommitAll({&list, &out});
  return Approximations(reconstruction, images);
}

}  // namespace cairn
