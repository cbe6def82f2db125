// Share of right single correspondences (within 20 degrees of the true rotation and 15 of the true
// translation direction) among the true matches, at every scale of the depth samples in a database
// and as verification learned to read them. README.md has the commands.
#include <cmath>
#include <cstdio>

#include "bench/pair_truth.h"
#include "cairn/database/database.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/two_view/depth_evidence.h"
#include "common/program.h"

namespace cairn::bench {
namespace {

struct Options {
  std::string database_path;
  std::string truth_path;
  double max_error_px = 1.0;

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "after build_view_graph, with depth");
    v.String("truth_path", truth_path, "folder of Strecha's .camera files");
    v.Double("max_error_px", max_error_px, {0.0, 100.0}, "of a true match, to the true pose");
  }
};

struct ImageData {
  std::string name;
  Camera camera;
  std::vector<Keypoint> keypoints;
  std::vector<std::vector<DepthSample>> scales;  // the last one: as learned
};

std::map<image_t, ImageData> ReadImages(const Database& database) {
  std::map<camera_t, Camera> cameras;
  for (const Camera& camera : database.ReadCameras()) cameras[camera.camera_id] = camera;
  const std::map<image_t, ImageDepth> learned = database.ReadImageDepth();
  std::map<image_t, ImageData> images;
  for (const Image& image : database.ReadImages()) {
    ImageData& data = images[image.image_id];
    data.name = image.name;
    data.camera = cameras.at(image.camera_id);
    data.keypoints = database.ReadKeypoints(image.image_id).value();
    for (int k = 0; auto samples = database.ReadDepthSamples(image.image_id, k); ++k) {
      data.scales.push_back(std::move(*samples));
    }
    const auto how = learned.find(image.image_id);
    const ImageDepth depth = how == learned.end() ? ImageDepth() : how->second;
    std::vector<DepthSample> samples = data.scales.at(depth.scale);
    for (DepthSample& sample : samples) sample = ShiftInverseDepth(sample, depth.shift);
    data.scales.push_back(std::move(samples));
  }
  return images;
}

FeatureMatches TrueMatches(const ImageData& image1, const ImageData& image2, const Rigid3d& pose,
                           const FeatureMatches& matches, double max_error_px) {
  const Eigen::Matrix3d E = EssentialFromPose(pose);
  const double focal = std::sqrt(image1.camera.MeanFocal() * image2.camera.MeanFocal());
  FeatureMatches right;
  for (const FeatureMatch& match : matches) {
    const auto x1 = image1.camera.CamFromImg(image1.keypoints[match.point1].Position());
    const auto x2 = image2.camera.CamFromImg(image2.keypoints[match.point2].Position());
    if (!x1 || !x2) continue;
    const Eigen::Vector3d line2 = E * x1->homogeneous();
    const Eigen::Vector3d line1 = E.transpose() * x2->homogeneous();
    const double norm = std::sqrt(line1.head<2>().squaredNorm() + line2.head<2>().squaredNorm());
    const double error = std::abs(x2->homogeneous().dot(line2)) / norm;
    if (error * focal < max_error_px) right.push_back(match);
  }
  return right;
}

int Run(const Options& options) {
  const Database database(options.database_path, Database::Mode::kReadOnly);
  const std::map<image_t, ImageData> images = ReadImages(database);
  const auto truth = ReadTruePoses(options.truth_path);
  int64_t num_samples = 0;
  std::vector<int64_t> num_right;
  for (const image_pair_t pair : database.ReadMatchedPairIds()) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    const ImageData& image1 = images.at(id1);
    const ImageData& image2 = images.at(id2);
    if (KindOfPair(image1.name, image2.name) != PairKind::kTrue) continue;
    Rigid3d pose = truth.at(image2.name) * Inverse(truth.at(image1.name));
    pose.translation.normalize();
    const DepthEvidence evidence = CollectDepthEvidence(
        {&image1.camera, image1.keypoints, image1.scales},
        {&image2.camera, image2.keypoints, image2.scales},
        TrueMatches(image1, image2, pose, database.ReadMatches(pair).value(), options.max_error_px),
        pose);
    num_samples += evidence.num_samples;
    num_right.resize(image1.scales.size());
    for (size_t k = 0; k < num_right.size(); ++k) {
      num_right[k] += evidence.NumRight(static_cast<int>(k), static_cast<int>(k));
    }
  }
  for (size_t k = 0; k < num_right.size(); ++k) {
    const double share =
        100.0 * static_cast<double>(num_right[k]) / static_cast<double>(num_samples);
    const bool is_learned = k + 1 == num_right.size();
    std::printf("%-9s %5.1f %%\n",
                is_learned ? "learned" : ("scale " + std::to_string(k + 1)).c_str(), share);
  }
  return 0;
}

}  // namespace
}  // namespace cairn::bench

int main(int argc, char** argv) {
  using namespace cairn;
  Program program("depth_shares", "Measures how many hypotheses of 1AC+D are right");
  bench::Options options;
  Command& command = program.MainCommand();
  command.AddOptions("", options);
  command.SetRun([&] { return bench::Run(options); });
  return program.Run(argc, argv);
}
