#include "global_sfm/describe.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <map>

#include "cairn/pipeline/build_pipeline.h"

namespace cairn {
namespace {

std::string CameraLines(const std::vector<Camera>& cameras) {
  std::map<std::string, int> kinds;
  for (const Camera& camera : cameras) {
    ++kinds[fmt::format("{}, focal length {}", CameraModelName(camera.model),
                        camera.has_prior_focal_length ? "given or from EXIF" : "guessed")];
  }
  std::string text = fmt::format("cameras   {}\n", cameras.size());
  for (const auto& [kind, n] : kinds) text += fmt::format("  {:<8}{}\n", n, kind);
  return text;
}

std::string SkippedLines(const std::vector<PhotoRecord>& photos) {
  std::string text;
  for (const PhotoRecord& photo : photos) {
    if (!photo.error.empty()) text += fmt::format("skipped   {}: {}\n", photo.name, photo.error);
  }
  return text;
}

std::string CameraText(const Camera& camera) {
  std::string text =
      fmt::format("{} {}x{}", CameraModelName(camera.model), camera.width, camera.height);
  for (const double param : camera.params) text += fmt::format(" {:.6g}", param);
  return text;
}

// Number of points and mean reprojection error of an image.
std::string ImageLine(const Reconstruction& reconstruction, const RegisteredImage& image) {
  const Camera& camera = reconstruction.CameraOf(image);
  double sum_px = 0;
  int num_points = 0;
  for (size_t i = 0; i < image.points2D.size(); ++i) {
    if (image.point3D_ids[i] == kInvalidPoint3DId) continue;
    sum_px += ReprojectionErrorPx(camera, image.cam_from_world,
                                  reconstruction.points3D.at(image.point3D_ids[i]).xyz,
                                  image.points2D[i]);
    ++num_points;
  }
  const Eigen::Vector3d center = image.cam_from_world.Center();
  return fmt::format(
      "  {:<40} camera {:<4} {:>6} points {:>8.3f} px   center {:.5g} {:.5g} {:.5g}\n",
      image.image.name, image.image.camera_id, num_points,
      num_points > 0 ? sum_px / num_points : 0.0, center.x(), center.y(), center.z());
}

// At a glance: a long list is cut.
std::string FirstLines(const std::vector<std::string>& lines, const char* of_what) {
  constexpr size_t kMaxLines = 50;
  std::string text;
  for (size_t i = 0; i < lines.size() && i < kMaxLines; ++i) text += lines[i];
  if (lines.size() > kMaxLines) {
    text += fmt::format("  ... and {} more {}\n", lines.size() - kMaxLines, of_what);
  }
  return text;
}

}  // namespace

std::string DescribeDatabase(const Database& database) {
  std::string text = SummaryText(SummarizeDatabase(database), {});
  text += SkippedLines(database.ReadPhotos());
  text += CameraLines(database.ReadCameras());
  for (const UnknownCamera& camera : database.ReadUnknownCameras()) {
    text += fmt::format("camera {} is of the unknown model {}; its images are left out\n",
                        camera.camera_id, camera.model_id);
  }
  return text;
}

std::string DescribeViewGraph(const ViewGraph& graph, const ViewGraphReport& report) {
  std::string text =
      fmt::format("{:<18} {} images, {} edges, {} in use\n", "view graph", graph.image_ids.size(),
                  graph.edges.size(), report.num_active_edges);
  for (const auto& [reason, n] : report.num_removed) {
    if (n > 0) text += fmt::format("  {:<16} {}\n", n, EdgeRemovalName(reason));
  }
  text += fmt::format("{:<18} {}", "components", report.components.size());
  for (size_t i = 0; i < report.components.size() && i < 10; ++i) {
    text += fmt::format("{}{}", i == 0 ? ", images: " : ", ", report.components[i].size());
  }
  text += "\n";
  if (report.loops.num_loops > 0) {
    text += fmt::format("{:<18} {} of {} close\n", "loops of three", report.loops.num_closed,
                        report.loops.num_loops);
  }
  return text;
}

std::string DescribeModel(const Reconstruction& reconstruction) {
  std::string text;
  text += fmt::format("{:<18} {}\n", "cameras", reconstruction.cameras.size());
  text += fmt::format("{:<18} {}\n", "images", reconstruction.images.size());
  text += fmt::format("{:<18} {}\n", "points", reconstruction.points3D.size());
  text += fmt::format("{:<18} {}\n", "observations", reconstruction.NumObservations());
  text += fmt::format("{:<18} {:.3f}\n", "track length", reconstruction.MeanTrackLength());
  text += fmt::format("{:<18} {:.4f} px\n", "reprojection error",
                      reconstruction.MeanReprojectionErrorPx());
  std::vector<std::string> lines;
  for (const auto& [id, camera] : reconstruction.cameras) {
    lines.push_back(fmt::format("camera {:<11} {}\n", id, CameraText(camera)));
  }
  text += FirstLines(lines, "cameras");
  lines.clear();
  for (const auto& [id, image] : reconstruction.images) {
    lines.push_back(ImageLine(reconstruction, image));
  }
  std::sort(lines.begin(), lines.end());  // by name
  text += FirstLines(lines, "images");
  return text;
}

}  // namespace cairn
