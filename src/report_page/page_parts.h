#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "cairn/base/error.h"
#include "cairn/bundle_adjustment/pose_confidence.h"
#include "cairn/report_page/report_page.h"
#include "evaluation/model_evidence.h"
#include "intrinsics/known_intrinsics.h"
#include "report_page/page_blocks.h"

namespace cairn {

using Json = nlohmann::ordered_json;

// The row that `read` returns; an empty one where there is none, or where it cannot be read.
template <class Read>
auto ReadOrEmpty(const Read& read) {
  using Row = typename std::invoke_result_t<Read>::value_type;
  try {
    return read().value_or(Row());
  } catch (const IoError&) {
    return Row();
  }
}

// A pair that was tried, by the positions of its images in PageScene::images.
struct PagePair {
  int image1 = 0;
  int image2 = 0;
  image_pair_t pair_id = 0;
  std::optional<EdgeRemoval> removal;  // absent where it is not in the graph
  std::string state;                   // EdgeRemovalName, or rejected_<status>
  std::string verifier;                // "" unknown; with the step that decided
  int num_matches = 0;
  int num_inliers = 0;
  double residual_px = 0;  // 0: unknown, likewise below
  double angle_deg = 0;
  double milliseconds = 0;
  Support support;  // by the model that has both images; no matches: none has

  bool InUse() const { return removal == EdgeRemoval::kNone; }
};

// What is known of an image.
struct PageImage {
  Image image;
  int model = -1;  // -1: in none
  int num_keypoints = 0;
  int num_points = 0;
  double error_px = 0;  // mean reprojection error
  // Its pairs: with matches, verified, in use, of these with images of models; and of those that
  // were taken out of the graph, why.
  int num_matched = 0;
  int num_verified = 0;
  int num_pairs = 0;
  int num_to_models = 0;
  std::map<std::string, int> removals;
  PoseConfidence confidence;
  Support support;  // of its verified matches with images of its model
};

// Observations of a camera on a grid over its sensor.
struct ResidualMap {
  int columns = 0;
  int rows = 0;
  std::vector<float> count, dx, dy, rms;  // means of (measured - predicted), pixels

  ResidualMap(int width, int height);
  void Add(const Camera& camera, const Eigen::Vector2d& pixel, const Eigen::Vector2d& residual);
  void Finish();  // sums become means
};

struct PageCamera {
  KnownIntrinsics known;
  std::optional<Camera> refined;  // of the largest model that has it
  int num_images = 0;
  int64_t num_observations = 0;
  std::optional<ResidualMap> map;
};

// What all parts of the page are made from.
struct PageScene {
  const Database& database;
  const ReportPageInput& input;
  const RunContext& run;
  std::vector<PageImage> images;  // by id
  std::map<image_t, int> index;   // position of an image id
  bool has_features = false;      // of any image
  std::map<camera_t, PageCamera> cameras;
  std::vector<PagePair> pairs;  // by pair id
  Json run_report;              // null: unknown
  Json build_report;
};

// page_scene.cc: reads and measures everything.
PageScene MakePageScene(const Database& database, const ReportPageInput& input,
                        const RunContext& run);

// findings.cc
// What a person should know first, most serious first: {level, what, advice, images}.
Json Findings(const PageScene& scene);
// Why an image is in no model, and what to do about it.
struct LeftOutReason {
  std::string what;
  std::string advice;
  auto operator<=>(const LeftOutReason&) const = default;
};
// has_features: images of the scene have any.
LeftOutReason WhyLeftOut(const PageImage& image, bool has_features);
// "" or why a camera's intrinsics are doubtful.
std::string DoubtAboutCamera(const PageCamera& camera);

// image_order.cc
// An order of nodes that brings those with heavy edges near each other: components, the largest
// first, each by its Fiedler vector (the eigenvector of the second smallest eigenvalue of the
// normalized Laplacian; Fiedler, "Algebraic connectivity of graphs", 1973; Atkins, Boman and
// Hendrickson, "A spectral algorithm for seriation", 1998).
struct WeightedEdge {
  int node1 = 0;
  int node2 = 0;
  double weight = 0;
};
std::vector<int> SpectralOrder(int num_nodes, const std::vector<WeightedEdge>& edges);

// page_json.cc: parts of the page's data.
Json ModelsJson(const PageScene& scene, PageBlocks& blocks);
Json ImagesJson(const PageScene& scene, PageBlocks& blocks);
Json CamerasJson(const PageScene& scene, PageBlocks& blocks);
// page_pairs.cc
Json PairsJson(const PageScene& scene, PageBlocks& blocks);
// page_thumbnails.cc; block of JPEGs and their ends, and how many photographs had none.
Json ThumbnailsJson(const PageScene& scene, PageBlocks& blocks);
// histograms.cc
Json HistogramsJson(const PageScene& scene);

}  // namespace cairn
