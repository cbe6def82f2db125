#include <algorithm>
#include <cmath>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "database/stage_names.h"
#include "report_page/page_parts.h"

namespace cairn {
namespace {

constexpr size_t kChunk = 4096;  // pairs whose matches are in memory at once

void ReadImages(PageScene& scene) {
  const std::map<image_t, int> num_keypoints = scene.database.ReadNumKeypoints();
  for (const Image& image : scene.database.ReadImages()) {
    scene.index[image.image_id] = static_cast<int>(scene.images.size());
    PageImage& added = scene.images.emplace_back();
    added.image = image;
    const auto found = num_keypoints.find(image.image_id);
    if (found != num_keypoints.end()) added.num_keypoints = found->second;
    scene.has_features |= added.num_keypoints > 0;
    ++scene.cameras[image.camera_id].num_images;
  }
  for (auto& [id, known] : ReadKnownIntrinsics(scene.database)) {
    scene.cameras[id].known = std::move(known);
  }
}

// A model of another database would be compared with matches that are not its own.
PageImage& ImageOf(PageScene& scene, const RegisteredImage& image) {
  const auto found = scene.index.find(image.image.image_id);
  if (found == scene.index.end() || scene.images[found->second].image.name != image.image.name) {
    throw ConfigError("model_path", "image " + std::to_string(image.image.image_id) + ", " +
                                        image.image.name + ", has no such id in the database " +
                                        scene.database.path());
  }
  PageImage& page_image = scene.images[found->second];
  if (std::ssize(image.points2D) != page_image.num_keypoints && !image.points2D.empty()) {
    throw ConfigError(
        "model_path",
        image.image.name + " has other keypoints than in the database " + scene.database.path());
  }
  return page_image;
}

struct Residual {
  Eigen::Vector2d pixel, error;
};

std::vector<Residual> ResidualsOf(const RegisteredImage& image, const Reconstruction& model) {
  std::vector<Residual> residuals;
  const Camera& camera = model.CameraOf(image);
  for (size_t i = 0; i < image.points2D.size(); ++i) {
    if (image.point3D_ids[i] == kInvalidPoint3DId) continue;
    const Eigen::Vector3d& xyz = model.points3D.at(image.point3D_ids[i]).xyz;
    const auto predicted = camera.ImgFromRay(image.cam_from_world * xyz);
    if (!predicted) continue;
    residuals.push_back({image.points2D[i], PixelDifference({camera.model, camera.params.data()},
                                                            image.points2D[i], *predicted)});
  }
  return residuals;
}

// Errors of an image's observations, in itself and on its camera's map.
void AddResiduals(const std::vector<Residual>& residuals, const Camera& intrinsics,
                  PageCamera& camera, PageImage& image) {
  double sum_px = 0;
  for (const Residual& residual : residuals) {
    sum_px += residual.error.norm();
    camera.map->Add(intrinsics, residual.pixel, residual.error);
  }
  image.num_points = static_cast<int>(residuals.size());
  camera.num_observations += image.num_points;
  if (image.num_points > 0) image.error_px = sum_px / image.num_points;
}

void MeasureImages(const Reconstruction& model, std::span<const RegisteredImage* const> images,
                   PageScene& scene) {
  std::vector<std::vector<Residual>> residuals(images.size());
  ParallelFor(scene.run.num_threads, std::ssize(images),
              [&](int64_t i) { residuals[i] = ResidualsOf(*images[i], model); });
  for (size_t i = 0; i < images.size(); ++i) {
    PageImage& image = ImageOf(scene, *images[i]);
    PageCamera& camera = scene.cameras[image.image.camera_id];  // models may number them anew
    const Camera& intrinsics = model.CameraOf(*images[i]);
    if (!camera.refined) {
      camera.refined = intrinsics;
      camera.map.emplace(intrinsics.width, intrinsics.height);
    }
    AddResiduals(residuals[i], intrinsics, camera, image);
  }
}

void MeasureModels(PageScene& scene) {
  constexpr size_t kImagesAtATime = 256;  // whose residuals are in memory
  for (size_t k = 0; k < scene.input.models.size(); ++k) {
    const Reconstruction& model = scene.input.models[k];
    const std::map<image_t, PoseConfidence> confidences =
        scene.input.confidences.empty() ? EstimatePoseConfidence(model, scene.run)
                                        : scene.input.confidences[k];
    std::vector<const RegisteredImage*> images;
    for (const auto& [id, image] : model.images) {
      PageImage& result = ImageOf(scene, image);
      if (result.model >= 0) continue;  // a smaller model of the same image
      result.model = static_cast<int>(k);
      result.confidence = confidences.at(id);
      images.push_back(&image);
    }
    for (size_t begin = 0; begin < images.size(); begin += kImagesAtATime) {
      const size_t num = std::min(kImagesAtATime, images.size() - begin);
      MeasureImages(model, std::span(images).subspan(begin, num), scene);
    }
  }
  for (auto& [id, camera] : scene.cameras) {
    if (camera.map) camera.map->Finish();
  }
}

// Pairs with matches, results or edges, with what is known of each.
void ReadPairs(PageScene& scene) {
  std::map<image_pair_t, PagePair> pairs;
  for (const auto& [pair_id, n] : scene.database.ReadNumMatches()) {
    if (n > 0) pairs[pair_id].num_matches = n;
  }
  for (const auto& [pair_id, n] : scene.database.ReadNumInliers()) {
    if (n > 0) pairs[pair_id].num_inliers = n;
  }
  for (const PairMetrics& metrics : scene.database.ReadPairMetrics()) {
    PagePair& pair = pairs[metrics.pair_id];
    pair.milliseconds +=
        1e3 * scene.database.ReadTiming(kStageVerification, metrics.pair_id, metrics.verifier)
                  .value_or(0.0);
    if (!metrics.is_winner && !pair.state.empty()) continue;
    pair.state = "rejected_" + metrics.status;
    pair.verifier = metrics.verifier;
    if (!metrics.step.empty() && metrics.step != metrics.verifier) {
      pair.verifier += ", " + metrics.step;
    }
    pair.num_matches = std::max(pair.num_matches, metrics.num_matches);
    pair.num_inliers = std::max(pair.num_inliers, metrics.num_inliers);
    pair.residual_px = metrics.residual_px;
    pair.angle_deg = metrics.triangulation_angle_deg;
  }
  for (const ViewEdge& edge : scene.input.graph.edges) {
    PagePair& pair = pairs[edge.PairId()];
    pair.removal = edge.removal;
    pair.state = EdgeRemovalName(edge.removal);
    pair.num_inliers = edge.num_inliers;
    pair.residual_px = edge.residual_px;
    pair.angle_deg = edge.triangulation_angle_deg;
    if (pair.verifier.empty()) pair.verifier = edge.verifier;
  }
  for (auto& [pair_id, pair] : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    const auto found1 = scene.index.find(id1), found2 = scene.index.find(id2);
    if (found1 == scene.index.end() || found2 == scene.index.end()) continue;
    pair.pair_id = pair_id;
    pair.image1 = found1->second;
    pair.image2 = found2->second;
    pair.num_matches = std::max(pair.num_matches, pair.num_inliers);
    if (pair.state.empty()) pair.state = "rejected_";
    scene.pairs.push_back(std::move(pair));
  }
}

bool AreInside(const FeatureMatches& matches, size_t num1, size_t num2) {
  return std::all_of(matches.begin(), matches.end(), [&](const FeatureMatch& match) {
    return match.point1 < num1 && match.point2 < num2;
  });
}

// The verified matches of a chunk of pairs, read from the database.
struct Chunk {
  std::vector<FeatureMatches> matches;
  std::vector<VerifiedPair> pairs;

  void Read(std::span<PagePair* const> of, const Reconstruction& model, const Database& database) {
    matches.assign(of.size(), {});
    pairs.clear();
    for (size_t i = 0; i < of.size(); ++i) {
      const auto [id1, id2] = PairIdToImagePair(of[i]->pair_id);
      TwoViewGeometry geometry =
          ReadOrEmpty([&] { return database.ReadTwoViewGeometry(of[i]->pair_id); });
      if (AreInside(geometry.inlier_matches, model.images.at(id1).points2D.size(),
                    model.images.at(id2).points2D.size())) {
        matches[i] = std::move(geometry.inlier_matches);
      }
      pairs.push_back({id1, id2, &matches[i]});
    }
  }
};

// How much of their verified matches the model explains, of pairs between its images.
void JudgePairs(std::span<PagePair* const> pairs, const Reconstruction& model, PageScene& scene) {
  Chunk chunk;
  size_t num_read = 0;
  const auto read = [&]() -> std::span<const VerifiedPair> {
    const size_t num = std::min(kChunk, pairs.size() - num_read);
    chunk.Read(pairs.subspan(num_read, num), model, scene.database);
    num_read += num;
    return chunk.pairs;
  };
  const std::vector<Support> supports = EvaluateSupports(model, read, scene.run);
  for (size_t i = 0; i < pairs.size(); ++i) {
    pairs[i]->support = supports[i];
    for (const int image : {pairs[i]->image1, pairs[i]->image2}) {
      Support& support = scene.images[image].support;
      support = support + pairs[i]->support;
    }
  }
}

void JudgeAllPairs(PageScene& scene) {
  for (size_t k = 0; k < scene.input.models.size(); ++k) {
    std::vector<PagePair*> inside;
    for (PagePair& pair : scene.pairs) {
      const bool is_inside = scene.images[pair.image1].model == static_cast<int>(k) &&
                             scene.images[pair.image2].model == static_cast<int>(k);
      if (is_inside && pair.num_inliers > 0) inside.push_back(&pair);
    }
    JudgePairs(inside, scene.input.models[k], scene);
  }
}

void CountPair(const PagePair& pair, const PageImage& other, PageImage& image) {
  image.num_matched += pair.num_matches > 0;
  if (!pair.removal) return;
  ++image.num_verified;
  image.num_pairs += pair.InUse();
  image.num_to_models += pair.InUse() && other.model >= 0;
  if (!pair.InUse()) ++image.removals[pair.state];
}

Json ParseReport(const std::string& text) {
  // What lies deeper would be copied by recursion.
  const auto keeps = [](int depth, Json::parse_event_t, const Json&) { return depth < 32; };
  Json json = text.empty() ? Json() : Json::parse(text, keeps, /*allow_exceptions=*/false);
  return json.is_object() ? json : Json();
}

}  // namespace

ResidualMap::ResidualMap(int width, int height) {
  constexpr int kLongSide = 24;  // cells; a million observations give each a few thousand
  const double cell = std::max(1, std::max(width, height)) / static_cast<double>(kLongSide);
  columns = std::max(1, static_cast<int>(width / cell + 0.5));
  rows = std::max(1, static_cast<int>(height / cell + 0.5));
  for (std::vector<float>* sums : {&count, &dx, &dy, &rms}) sums->resize(columns * rows);
}

void ResidualMap::Add(const Camera& camera, const Eigen::Vector2d& pixel,
                      const Eigen::Vector2d& residual) {
  const int column = static_cast<int>(std::floor(pixel.x() / camera.width * columns));
  const int row = static_cast<int>(std::floor(pixel.y() / camera.height * rows));
  if (column < 0 || column >= columns || row < 0 || row >= rows) return;
  const int cell = row * columns + column;
  ++count[cell];
  dx[cell] += static_cast<float>(residual.x());
  dy[cell] += static_cast<float>(residual.y());
  rms[cell] += static_cast<float>(residual.squaredNorm());
}

void ResidualMap::Finish() {
  for (size_t cell = 0; cell < count.size(); ++cell) {
    if (count[cell] == 0) continue;
    dx[cell] /= count[cell];
    dy[cell] /= count[cell];
    rms[cell] = std::sqrt(rms[cell] / count[cell]);
  }
}

PageScene MakePageScene(const Database& database, const ReportPageInput& input,
                        const RunContext& run) {
  PageScene scene{database, input, run, {}, {}, {}, {}, {}, {}, {}};
  scene.run_report = ParseReport(input.run_json);
  scene.build_report = ParseReport(input.build_json);
  ReadImages(scene);
  MeasureModels(scene);
  ReadPairs(scene);
  JudgeAllPairs(scene);
  for (const PagePair& pair : scene.pairs) {
    CountPair(pair, scene.images[pair.image2], scene.images[pair.image1]);
    CountPair(pair, scene.images[pair.image1], scene.images[pair.image2]);
  }
  return scene;
}

}  // namespace cairn
