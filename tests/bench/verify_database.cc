// Verifies every pair of a database in one thread and prints accuracy and time side by side.
//   verify_database --database_path .../colmap_loose_matches.db --truth_path .../gt
//     --depth_path .../depth_good --verifier five_point,one_ac_depth [--csv out.csv]
#include <time.h>

#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>

#include "bench/pair_truth.h"
#include "cairn/base/error.h"
#include "cairn/database/database.h"
#include "cairn/depth/depth_network.h"
#include "cairn/depth/sample_depth.h"
#include "cairn/image/bitmap.h"
#include "cairn/two_view/pair_verifier.h"
#include "common/program.h"

namespace cairn::bench {
namespace {

struct BenchOptions {
  std::string database_path;
  std::string truth_path;
  std::string depth_path;
  std::string depth_model;
  std::string image_path;
  std::string verifier = "five_point";
  std::string csv;
  std::string only;
  int repeat = 1;
  int min_inliers = 15;
  int seed = 0;

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "keypoints and matches");
    v.String("truth_path", truth_path, "folder of Strecha's .camera files");
    v.String("depth_path", depth_path, "depth maps, or nothing");
    v.String("depth_model", depth_model, "network that computes depth");
    v.String("image_path", image_path, "its images: <scene>/images/<file> for <scene>_<file>");
    v.String("verifier", verifier, "names, separated by commas");
    v.String("csv", csv, "result of the last verifier");
    v.String("only", only, "pairs of which both names contain this");
    v.Int("repeat", repeat, {1, 1000}, "times are the smallest of so many runs");
    v.Int("min_inliers", min_inliers, {0, 1e9}, "fewer count as rejected");
    v.Int("seed", seed, {0, 1e9}, "of all random numbers");
  }
};

// Processor time of this thread, seconds: the wall clock also counts the machine's other work.
double ThreadSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct ImageData {
  std::string name;
  const Camera* camera = nullptr;
  std::vector<Keypoint> keypoints;
  std::vector<DepthSample> depth;
};

std::vector<DepthSample> SampleOf(const ImageData& image, const BenchOptions& options,
                                  const DepthOptions& depth_options, DepthNetwork* network) {
  DepthMap map;
  if (network != nullptr) {
    const size_t cut = image.name.rfind('_');
    map = network->Compute(ReadBitmap(options.image_path + "/" + image.name.substr(0, cut) +
                                          "/images/" + image.name.substr(cut + 1),
                                      BitmapColor::kRgb));
  } else {
    const auto path = FindDepthMap(options.depth_path, image.name);
    if (!path) return {};
    map = ReadDepthMap(*path, depth_options);
  }
  return SampleDepth(map, image.camera->width, image.camera->height, image.keypoints,
                     depth_options);
}

int Run(const BenchOptions& options, const DepthOptions& depth_options,
        const TwoViewOptions& verification) {
  const Database database(options.database_path, Database::Mode::kReadOnly);
  std::map<camera_t, Camera> cameras;
  for (const Camera& camera : database.ReadCameras()) cameras[camera.camera_id] = camera;
  std::unique_ptr<DepthNetwork> network;
  if (!options.depth_model.empty()) {
    network = std::make_unique<DepthNetwork>(options.depth_model, depth_options);
  }
  std::map<image_t, ImageData> images;
  for (const Image& image : database.ReadImages()) {
    ImageData& data = images[image.image_id];
    data.name = image.name;
    data.camera = &cameras.at(image.camera_id);
    data.keypoints = database.ReadKeypoints(image.image_id).value();
    if (network || !options.depth_path.empty()) {
      data.depth = SampleOf(data, options, depth_options, network.get());
    }
  }
  const auto truth = ReadStrechaPoses(options.truth_path);
  std::vector<std::pair<image_pair_t, FeatureMatches>> pairs;
  for (const image_pair_t id : database.ReadMatchedPairIds()) {
    pairs.emplace_back(id, database.ReadMatches(id).value());
  }
  std::puts(ScoresHeader().c_str());
  std::stringstream names(options.verifier);
  for (std::string name; std::getline(names, name, ',');) {
    const auto verifier = MakePairVerifier(VerifierKindFromName(name), verification);
    std::vector<PairResult> results;
    for (int round = 0; round < options.repeat; ++round) {
      size_t index = 0;
      for (const auto& [pair_id, matches] : pairs) {
        const auto [id1, id2] = PairIdToImagePair(pair_id);
        const ImageData& image1 = images.at(id1);
        const ImageData& image2 = images.at(id2);
        if (image1.name.find(options.only) == std::string::npos ||
            image2.name.find(options.only) == std::string::npos) {
          continue;
        }
        PairInput input;
        input.pair_id = pair_id;
        input.seed = static_cast<uint64_t>(options.seed);
        input.camera1 = image1.camera;
        input.camera2 = image2.camera;
        input.keypoints1 = image1.keypoints;
        input.keypoints2 = image2.keypoints;
        input.depth1 = image1.depth;
        input.depth2 = image2.depth;
        input.matches = matches;
        const double start = ThreadSeconds();
        const PairReport report = verifier->Verify(input);
        const double seconds = ThreadSeconds() - start;
        if (round > 0) {
          results[index].seconds = std::min(results[index].seconds, seconds);
          ++index;
          continue;
        }
        PairResult result;
        result.name1 = image1.name;
        result.name2 = image2.name;
        result.kind = KindOfPair(image1.name, image2.name);
        result.num_matches = static_cast<int>(matches.size());
        result.num_iterations = report.num_iterations;
        result.seconds = seconds;
        result.num_inliers = report.num_inliers;
        result.note = std::string(PairStatusName(report.status)) + " " +
                      std::string(TwoViewConfigName(report.geometry.config)) + " " +
                      std::string(report.verifier);
        if (report.status == PairStatus::kVerified) {
          result.cam2_from_cam1 = report.geometry.cam2_from_cam1;
        }
        results.push_back(std::move(result));
        ++index;
      }
    }
    const Scores scores = ScoreResults(truth, options.min_inliers, &results);
    std::puts(FormatScores(name, scores).c_str());
    if (!options.csv.empty()) WriteCsv(options.csv, results);
  }
  return 0;
}

}  // namespace
}  // namespace cairn::bench

int main(int argc, char** argv) {
  using namespace cairn;
  Program program("verify_database", "Measures two-view verification over a database");
  bench::BenchOptions options;
  DepthOptions depth;
  TwoViewOptions verification;
  Command& command = program.MainCommand();
  command.AddOptions("", options);
  command.AddOptions("depth", depth);
  command.AddOptions("verification", verification);
  command.SetRun([&] { return bench::Run(options, depth, verification); });
  return program.Run(argc, argv);
}
