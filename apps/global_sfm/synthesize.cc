#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "cairn/base/file.h"
#include "cairn/io/bundler.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/one_dsfm_writer.h"
#include "cairn/synthetic/photos.h"
#include "cairn/synthetic/scene.h"
#include "cairn/synthetic/view_graph_problem.h"
#include "common/console_monitor.h"
#include "common/run_flags.h"
#include "global_sfm/commands.h"
#include "global_sfm/rotation_files.h"

namespace cairn {
namespace {

const std::vector<std::string> kContents = {"features", "depth", "matches", "two_view_geometries"};

struct SynthesizeOptions : RunFlags {
  std::string output_path;
  std::string type = "photos";
  std::string content = "matches";
  RigOptions rig;
  void VisitFields(OptionVisitor& v) {
    v.String("output_path", output_path, "folder for what is made; created if absent");
    v.Choice(
        "type", type, {"photos", "database", "graph"},
        "photos: rendered images with depth maps; database: exact keypoints, depth and matches "
        "without images; graph: relative poses only, as a 1DSfM data set");
    v.Choice("content", content, kContents, "of a database: filled up to this stage");
    RunFlags::VisitFields(v);
    rig.VisitFields(v);
  }
};

struct AllOptions {
  SynthesizeOptions main;
  PhotoOptions photos;
  SceneOptions scene;
  ViewGraphOptions graph;
};

int MakePhotos(AllOptions& options, ConsoleMonitor& monitor) {
  static_cast<RigOptions&>(options.photos) = options.main.rig;
  const std::string& folder = options.main.output_path;
  WritePhotoScene(MakePhotoScene(options.photos, options.main.seed), folder,
                  options.main.num_threads, monitor);
  if (monitor.StopRequested()) {
    monitor.Warning("stopped before all photographs were made");
    return kExitNoUsableResult;
  }
  monitor.Info(fmt::format(
      "{} photographs in {}/images, their depth maps in {}/depth, the true cameras in {}/truth",
      options.main.rig.num_images + options.main.rig.num_distractor_images, folder, folder,
      folder));
  return kExitSuccess;
}

void MakeDatabase(AllOptions& options, ConsoleMonitor& monitor) {
  static_cast<RigOptions&>(options.scene) = options.main.rig;
  const SyntheticScene scene =
      MakeScene(options.scene, options.main.seed, options.main.num_threads);
  const auto content = std::find(kContents.begin(), kContents.end(), options.main.content);
  const std::string& folder = options.main.output_path;
  WriteSceneFolder(scene, static_cast<SceneContent>(content - kContents.begin()), folder);
  monitor.Info(fmt::format("{} images and {} points: {}/scene.db, the true model in {}/truth",
                           scene.images.size(), scene.truth.points3D.size(), folder, folder));
}

void MakeGraph(AllOptions& options, ConsoleMonitor& monitor) {
  options.graph.layout = options.main.rig.layout;
  options.graph.num_images = options.main.rig.num_images;
  options.graph.distance = options.main.rig.distance;
  const std::string& folder = options.main.output_path;
  const ViewGraphProblem problem = MakeViewGraphProblem(options.graph, options.main.seed);

  // Image ids are list indices + 1, as the data set's reader gives them.
  RigOptions rig = options.main.rig;
  rig.num_distractor_images = 0;
  Reconstruction truth;
  truth.cameras = MakeCameras(rig);
  OneDsfmFiles files;
  std::vector<Image> images = MakeImages(rig);
  for (size_t i = 0; i < images.size(); ++i) {
    const image_t id = images[i].image_id;
    files.images.push_back(
        {"images/" + images[i].name, truth.cameras.at(images[i].camera_id).MeanFocal()});
    files.component.push_back(static_cast<int>(i));
    truth.images.emplace(id, RegisteredImage{images[i], problem.cam_from_world.at(id), {}, {}});
    images[i].name = "images/" + images[i].name;
  }
  std::string edges = "# i j R_ij(9, row-major), R_ij = R_j R_i^T\n";
  for (const ViewEdge& edge : problem.graph.edges) {
    const int i = static_cast<int>(edge.image_id1) - 1;
    const int j = static_cast<int>(edge.image_id2) - 1;
    files.edges.push_back({i, j, edge.cam2_from_cam1});
    edges += fmt::format("{} {}", i, j);
    const Eigen::Matrix3d R = edge.cam2_from_cam1.RotationMatrix();
    for (int k = 0; k < 9; ++k) edges += fmt::format(" {:.9g}", R(k / 3, k % 3));
    edges += '\n';
  }
  std::map<image_t, Eigen::Quaterniond> rotations;
  for (const auto& [id, pose] : problem.cam_from_world) rotations[id - 1] = pose.rotation;

  WriteBundler(truth, folder + "/gt_bundle.out", folder + "/list.txt", images);
  WriteOneDsfmFiles(folder, files);  // also list.txt: the same images, with focal lengths
  WriteFileAtomically(folder + "/edges.txt", edges);
  WriteRotations(rotations, folder + "/reference_rotations.txt");
  WriteColmapModel(truth, folder + "/truth", ColmapModelFormat::kText);
  monitor.Info(fmt::format(
      "{} cameras and {} relative poses as a 1DSfM data set in {}; relative rotations in "
      "edges.txt, true rotations in reference_rotations.txt, true cameras in truth",
      problem.graph.image_ids.size(), problem.graph.edges.size(), folder));
}

int Run(const Command& command, AllOptions& options) {
  ConsoleMonitor monitor;
  CreateFolders(options.main.output_path);
  WriteFileAtomically(options.main.output_path + "/effective.toml", command.EffectiveToml());
  if (options.main.type == "photos") return MakePhotos(options, monitor);
  if (options.main.type == "database") {
    MakeDatabase(options, monitor);
  } else {
    MakeGraph(options, monitor);
  }
  return kExitSuccess;
}

}  // namespace

void AddSynthesizeCommand(Program& program) {
  Command& command = program.AddCommand(
      "synthesize", "Makes scenes with known truth: photographs, databases, or view graphs.");
  const auto options = std::make_shared<AllOptions>();
  command.AddOptions("", options->main);
  command.AddOptions("photos", options->photos);
  command.AddOptions("scene", options->scene);
  command.AddOptions("graph", options->graph);
  command.SetRun([&command, options] {
    command.Require("output_path");
    return Run(command, *options);
  });
}

}  // namespace cairn
