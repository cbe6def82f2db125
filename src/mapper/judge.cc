#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/median.h"
#include "mapper/stages.h"
#include "view_graph/symmetry.h"

namespace cairn {
namespace {

const FeatureMatches kNoMatches;

// Images whose matches contradict their poses, the worst first.
std::vector<image_t> DoubtfulImages(const ModelEvidence& evidence) {
  std::vector<image_t> doubtful;
  for (const auto& [id, support] : evidence.images) {
    if (support.IsContradicted()) doubtful.push_back(id);
  }
  std::ranges::stable_sort(doubtful, {},
                           [&](image_t id) { return evidence.images.at(id).Share(); });
  return doubtful;
}

// Images that a single pair holds: where it is wrong, no other tells. Two or three in a row are all
// that there is.
std::vector<image_t> ImagesOfOnePair(const BuiltModel& built) {
  std::vector<image_t> images;
  if (built.model->images.size() <= 3) return images;
  for (const auto& [id, num_pairs] : NumPairsInUse(built.graph, *built.model)) {
    if (num_pairs == 1) images.push_back(id);
  }
  return images;
}

// Of a grid of kCells x kCells, the cells of the picture that have points of the model.
constexpr int kCells = 10;
std::map<image_t, int> NumCellsWithPoints(const Reconstruction& model) {
  std::map<image_t, int> num_cells;
  for (const auto& [id, image] : model.images) {
    const Camera& camera = model.CameraOf(image);
    std::set<std::pair<int, int>> cells;
    for (size_t k = 0; k < image.points2D.size(); ++k) {
      if (image.point3D_ids[k] == kInvalidPoint3DId) continue;
      cells.insert({static_cast<int>(kCells * image.points2D[k].x() / camera.width),
                    static_cast<int>(kCells * image.points2D[k].y() / camera.height)});
    }
    num_cells[id] = static_cast<int>(cells.size());
  }
  return num_cells;
}

// Images that points in a small part of the picture hold, a twentieth of it and less, where most
// have four times as much: so little hardly tells a pose.
std::vector<image_t> ImagesOfASmallPart(const Reconstruction& model) {
  std::vector<image_t> images;
  if (model.images.size() <= 3) return images;
  const std::map<image_t, int> num_cells = NumCellsWithPoints(model);
  std::vector<double> all;
  for (const auto& [id, num] : num_cells) all.push_back(num);
  const double most = std::min(kCells * kCells / 20.0, UpperMedian(all) / 4);
  for (const auto& [id, num] : num_cells) {
    if (num <= most) images.push_back(id);
  }
  return images;
}

// Images that may lie anywhere along an axis: only one other sees the points that they see, say.
std::vector<image_t> ImagesWithoutPosition(const Reconstruction& model, const RunContext& run) {
  std::vector<image_t> images;
  for (const auto& [id, confidence] : EstimatePoseConfidence(model, run)) {
    if (!std::isfinite(confidence.position_sigma)) images.push_back(id);
  }
  return images;
}

// Images that lie upside down beside the others. Photographs are taken upright, or on their side:
// of upright ones the x axes lie in one plane. Axes that hardly differ tell none.
std::vector<image_t> ImagesUpsideDown(const Reconstruction& model) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const auto& [id, image] : model.images) {
    const Eigen::Vector3d x = image.cam_from_world.RotationMatrix().row(0);
    spread += x * x.transpose() / static_cast<double>(model.images.size());
  }
  const auto axes = SymmetricEigen<3>(spread);
  if (axes.values[1] < 0.05 || axes.values[0] > 0.1 * axes.values[1]) return {};
  std::vector<image_t> one, other;
  for (const auto& [id, image] : model.images) {
    const double y = image.cam_from_world.RotationMatrix().row(1).dot(axes.vectors.col(0));
    if (std::abs(y) > 0.5) (y > 0 ? one : other).push_back(id);
  }
  return one.size() < other.size() ? one : other;
}

double FocalInSides(const Camera& camera) {
  return camera.MeanFocal() / std::max(camera.width, camera.height);
}

// Images of cameras without EXIF for which a longer focal length is found than lenses have: seen
// from afar, or without movement, any will do.
std::vector<image_t> ImagesOfLongFocals(const StageContext& context, const Reconstruction& model) {
  const std::set<camera_t> constant = context.ConstantCameras(model);
  std::vector<image_t> images;
  for (const auto& [id, image] : model.images) {
    const camera_t camera_id = image.image.camera_id;
    const bool is_known =
        constant.contains(camera_id) || context.scene.cameras.at(camera_id).has_prior_focal_length;
    if (!is_known && FocalInSides(model.CameraOf(image)) > kLongestFocal) images.push_back(id);
  }
  return images;
}

ResultWarning FoldWarning(const SceneData& scene, const Symmetry& symmetry) {
  return {std::to_string(symmetry.num_pairs) +
              " pairs that are not in use agree that the scene looks the same when turned by " +
              std::to_string(std::lround(symmetry.angle_deg)) + " degrees (" +
              std::to_string(symmetry.num_active) +
              " pairs agree with the model): equal sides of a building may be shown as one; they "
              "are of " +
              Names(scene, symmetry.images),
          "give the photos of each side to a run of their own, or add photos with more of the "
          "surroundings"};
}

// All pairs of the graph, in its order.
std::vector<VerifiedPair> PairsOf(const StageContext& context, const ViewGraph& graph) {
  std::vector<VerifiedPair> pairs;
  for (const ViewEdge& edge : graph.edges) {
    const bool is_of_others =
        context.taken.contains(edge.image_id1) || context.taken.contains(edge.image_id2);
    pairs.push_back({edge.image_id1, edge.image_id2,
                     is_of_others ? &kNoMatches : &context.scene.matches.at(edge.PairId())});
  }
  return pairs;
}

}  // namespace

ModelEvidence EvidenceFor(const StageContext& context, const Reconstruction& model,
                          const ViewGraph& graph) {
  return EvaluateEvidence(model, PairsOf(context, graph), context.run,
                          context.ConstantCameras(model));
}

Agreement AgreementFor(const StageContext& context, const Reconstruction& model,
                       const ViewGraph& graph) {
  return EvaluateAgreement(model, PairsOf(context, graph), context.run);
}

std::string Names(const SceneData& scene, std::span<const image_t> images) {
  std::vector<std::string> names;
  for (const image_t id : images) names.push_back(scene.images.at(id).name);
  return FirstNames(names);
}

std::map<image_t, int> NumPairsInUse(const ViewGraph& graph, const Reconstruction& model) {
  std::map<image_t, int> num_pairs;
  for (const ViewEdge& edge : graph.edges) {
    if (!edge.IsActive() || !IsWithin(edge, model)) continue;
    ++num_pairs[edge.image_id1];
    ++num_pairs[edge.image_id2];
  }
  return num_pairs;
}

std::vector<ResultWarning> JudgeModel(StageContext& context, const BuiltModel& built) {
  const Reconstruction& model = *built.model;
  const ModelEvidence& evidence = built.evidence;
  std::vector<MisplacedGroup> groups = FindGroupsOfOwnScale(context, built);
  std::erase_if(groups,
                [&](const auto& group) { return AreInPlace(context, built, group.images); });
  ModelStage stage(context, "judgement");
  const Symmetry symmetry = FindSymmetry(model, built.graph);
  stage.Add("explained_share", evidence.inside.Share());
  stage.Add("contradicted_pairs", evidence.num_contradicted);
  stage.Add("evidence_nats", evidence.nats);
  stage.Add("symmetric_pairs", symmetry.num_pairs);
  std::vector<ResultWarning> warnings;
  const auto warn = [&](const ResultWarning& warning) {
    stage.RecordWarning(warning.what + "; " + warning.advice);
    warnings.push_back(warning);
  };
  const std::vector<image_t> doubtful = DoubtfulImages(evidence);
  const std::string percent = std::to_string(std::lround(100 * evidence.inside.Share()));
  if (evidence.inside.IsContradicted()) {
    warn({"it explains only " + percent +
              " % of the verified matches of its images and is probably wrong" +
              (doubtful.empty() ? "" : "; worst: " + Names(context.scene, doubtful)),
          "do not use it; add photos with more overlap, or give the photos of each place to a run "
          "of their own",
          /*is_wrong=*/true});
  } else if (!doubtful.empty()) {
    warn({"probably misplaced, since most of their verified matches contradict their poses (" +
              std::to_string(doubtful.size()) + "): " + Names(context.scene, doubtful),
          kMisplacedAdvice});
  }
  if (const std::vector<image_t> held = ImagesOfOnePair(built); !held.empty()) {
    warn({"held by one pair each, which no other confirms (" + std::to_string(held.size()) +
              "): " + Names(context.scene, held),
          "look at these, or add photos that overlap with them"});
  }
  if (const std::vector<image_t> held = ImagesOfASmallPart(model); !held.empty()) {
    warn({"held by points in a small part of the photo, which hardly tell where it was taken (" +
              std::to_string(held.size()) + "): " + Names(context.scene, held),
          "look at these, or add photos that overlap with them"});
  }
  if (const std::vector<image_t> open = ImagesWithoutPosition(model, context.run); !open.empty()) {
    warn({"where they were taken is open, since their points do not tell (" +
              std::to_string(open.size()) + "): " + Names(context.scene, open),
          "look at these, or add photos that overlap with them"});
  }
  if (const std::vector<image_t> down = ImagesUpsideDown(model); !down.empty()) {
    warn({"upside down beside the others (" + std::to_string(down.size()) +
              "): " + Names(context.scene, down),
          "if neither camera nor object was turned over, something that looks the same when turned "
          "round put them there: build_view_graph --features.estimate_upright 1 matches upright "
          "photos alone"});
  }
  if (const std::vector<image_t> far = ImagesOfLongFocals(context, model); !far.empty()) {
    const Camera& camera = model.CameraOf(model.images.at(far.front()));
    warn(
        {Formatted("longer focal lengths are found than lenses have, as %.1f larger sides (%zu): ",
                   FocalInSides(camera), far.size()) +
             Names(context.scene, far),
         "give their focal length (--camera_params), or photos that move more: distances are off"});
  }
  for (const MisplacedGroup& group : groups) {
    warn(
        {"perhaps too small or too large beside the others, or elsewhere, since few points join "
         "them (" +
             std::to_string(group.images.size()) + "): " +
             Names(context.scene, std::vector<image_t>(group.images.begin(), group.images.end())),
         "add photos between them and the others"});
  }
  if (symmetry.IsFold()) warn(FoldWarning(context.scene, symmetry));
  return warnings;
}

}  // namespace cairn
