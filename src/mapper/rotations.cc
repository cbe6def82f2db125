#include <algorithm>
#include <bitset>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "cairn/evaluation/alignment.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Images that are turned by more than this are turned by other edges, not by their noise.
constexpr double kTurnedDeg = 5.0;
// Fewer turned images do not make another model: resection puts single images right.
constexpr double kMinTurnedShare = 0.05;
// Of more edges, where each start takes seconds, an average by other powers of the same weights
// goes on from the one before: regions that turn as one leave wrong minima.
constexpr int kMaxFreshEdges = 100000;

// In use, weighed by their numbers of inliers.
std::vector<RotationEdge> EdgesOf(const ViewGraph& graph) {
  std::vector<RotationEdge> edges;
  for (const ViewEdge& edge : graph.edges) {
    if (!edge.IsActive()) continue;
    edges.push_back({edge.image_id1, edge.image_id2, edge.cam2_from_cam1.rotation,
                     static_cast<double>(std::max(1, edge.num_inliers))});
  }
  return edges;
}

// How many cells of a grid over the pictures a pair's inliers lie in, in the picture where they lie
// in fewer. A share of a cell is added, larger for more inliers.
double Coverage(const SceneData& scene, const ViewEdge& edge) {
  constexpr int kCells = 8;  // a side; any number from 4 to 16 does
  std::bitset<kCells * kCells> cells1, cells2;
  const auto cell = [&](image_t id, point2D_t point) {
    const Camera& camera = scene.CameraOf(id);
    const Eigen::Array2d share =
        scene.pixels.at(id)[point].array() / Eigen::Array2d(camera.width, camera.height);
    const Eigen::Array2i at = (kCells * share).floor().cast<int>().max(0).min(kCells - 1);
    return static_cast<size_t>(at.y() * kCells + at.x());
  };
  const auto matches = scene.matches.find(edge.PairId());
  if (matches == scene.matches.end()) return 1;
  for (const FeatureMatch& match : matches->second) {
    cells1.set(cell(edge.image_id1, match.point1));
    cells2.set(cell(edge.image_id2, match.point2));
  }
  const double num_inliers = std::max(1, edge.num_inliers);
  return static_cast<double>(std::min(cells1.count(), cells2.count())) +
         num_inliers / (1.0 + num_inliers);
}

// How far a pair's rotation is from the hypothesis; nullopt: it has no pose, or its images none.
std::optional<double> ErrorDeg(const ViewEdge& edge, const RotationHypothesis& hypothesis) {
  const auto rotation = RelativeRotation(edge, hypothesis.cam_from_world);
  if (!rotation || edge.removal == EdgeRemoval::kNoPose) return std::nullopt;
  return RadToDeg(AngleBetween(*rotation, edge.cam2_from_cam1.rotation));
}

// Inliers of all pairs that have a pose, those that were taken out among them, by how well they
// agree with the rotations.
void SetSupport(const ViewGraph& graph, double scale_deg, RotationHypothesis& hypothesis) {
  for (const ViewEdge& edge : graph.edges) {
    const std::optional<double> error = ErrorDeg(edge, hypothesis);
    if (!error) continue;
    hypothesis.possible_support += std::max(1, edge.num_inliers);
    hypothesis.support += std::max(1, edge.num_inliers) / (1.0 + std::pow(*error / scale_deg, 2));
  }
}

// Are more than a few of the images that both have turned against each other?
bool IsAnother(const RotationHypothesis& a, const RotationHypothesis& b) {
  std::vector<Eigen::Quaterniond> rotations_a, rotations_b;
  for (const auto& [id, rotation] : a.cam_from_world) {
    const auto other = b.cam_from_world.find(id);
    if (other == b.cam_from_world.end()) continue;
    rotations_a.push_back(rotation);
    rotations_b.push_back(other->second);
  }
  const auto turn = AlignRotationsL1(rotations_a, rotations_b);
  if (!turn) return true;
  int num_turned = 0;
  for (size_t i = 0; i < rotations_a.size(); ++i) {
    const double error = AngleBetween(rotations_a[i] * turn->conjugate(), rotations_b[i]);
    num_turned += RadToDeg(error) > kTurnedDeg;
  }
  return num_turned > kMinTurnedShare * static_cast<double>(rotations_a.size());
}

bool HasRotations(const RotationAveragingReport& report) {
  return report.status == RotationAveragingStatus::kSuccess ||
         report.status == RotationAveragingStatus::kNotConverged;
}

// The powers of the numbers of inliers that edges weigh by. The variance of a rotation falls with
// the number of inliers; but a few pairs with very many, all neighbors, must not decide alone.
std::vector<double> PowersOf(const RotationAveragingOptions& options) {
  std::vector<double> powers = {1, 0};
  if (options.weight_power != 0 && options.weight_power != 1)
    powers.push_back(options.weight_power);
  return powers;
}

// Averages by each power, as long as it succeeds.
std::vector<RotationAveragingReport> AverageByPowers(std::span<const RotationEdge> edges,
                                                     RotationAveragingOptions options,
                                                     const RunContext& run) {
  RotationAverager averager(edges, run);
  std::vector<RotationAveragingReport> reports;
  for (const double power : PowersOf(options)) {
    options.weight_power = power;
    const bool goes_on = std::ssize(edges) > kMaxFreshEdges && !reports.empty();
    reports.push_back(goes_on ? averager.AverageFrom(reports.back().cam_from_world, options)
                              : averager.Average(options));
    if (!HasRotations(reports.back())) break;
  }
  return reports;
}

// Tries ways to average a component's rotations.
class Averager {
 public:
  // own: the graph of the component alone.
  Averager(StageContext& context, RunStage& stage, const ViewGraph& own)
      : context_(context), stage_(stage), own_(own) {}

  // From all edges. False: it fails.
  bool AddAll() {
    const RotationAveragingOptions& options = context_.settings.rotation_averaging;
    return Add(AverageByPowers(EdgesOf(own_), options, context_.run));
  }

  // From the tree of the surest pairs, and what agrees with it: pairs of things that look alike may
  // outvote neighbors, but have fewer inliers, or share the things alone.
  void AddTrees() {
    std::vector<RotationEdge> edges = EdgesOf(own_);
    AddTree(edges);
    size_t k = 0;
    for (const ViewEdge& edge : own_.edges) {
      if (edge.IsActive()) edges[k++].weight = Coverage(context_.scene, edge);
    }
    AddTree(edges);
  }

  size_t NumTried() const { return all_.size(); }

  // Those that differ, the best supported first.
  std::vector<RotationHypothesis> Distinct() {
    std::ranges::stable_sort(all_, std::greater<>(), &RotationHypothesis::support);
    std::vector<RotationHypothesis> distinct;
    for (RotationHypothesis& hypothesis : all_) {
      const auto differs = [&](const RotationHypothesis& other) {
        return IsAnother(hypothesis, other);
      };
      if (std::ranges::all_of(distinct, differs)) distinct.push_back(std::move(hypothesis));
    }
    return distinct;
  }

 private:
  void AddTree(std::span<const RotationEdge> edges) {
    RotationAveragingOptions options = context_.settings.rotation_averaging;
    options.max_l1_iterations = options.max_consensus_rounds = options.max_region_rounds = 0;
    options.weight_power = 1;
    Add(AverageRotations(edges, options, context_.run));
  }

  bool Add(std::vector<RotationAveragingReport> reports) {
    return std::ranges::all_of(reports, [this](auto& report) { return Add(std::move(report)); });
  }

  bool Add(RotationAveragingReport report) {
    if (!HasRotations(report)) {
      if (all_.empty()) {
        stage_.Fail(std::string(RotationAveragingStatusName(report.status)) + " on " +
                        std::to_string(own_.NumActiveEdges()) + " edges",
                    "look at the view graph with global_sfm inspect");
      }
      return false;
    }
    all_.push_back(
        {std::move(report.cam_from_world), report.median_residual_deg, report.num_rejected});
    SetSupport(own_, context_.settings.rotation_averaging.sigma_start_deg, all_.back());
    return true;
  }

  StageContext& context_;
  RunStage& stage_;
  const ViewGraph& own_;
  std::vector<RotationHypothesis> all_;
};

}  // namespace

int64_t NumExplainable(const StageContext& context, const ViewGraph& graph,
                       const RotationHypothesis& hypothesis) {
  std::vector<VerifiedPair> agreeing;
  for (const ViewEdge& edge : graph.edges) {
    const std::optional<double> error = ErrorDeg(edge, hypothesis);
    const auto matches = context.scene.matches.find(edge.PairId());
    if (!error || *error > context.settings.view_graph.max_rotation_error_deg ||
        matches == context.scene.matches.end()) {
      continue;
    }
    agreeing.push_back({edge.image_id1, edge.image_id2, &matches->second});
  }
  return CountIndependent(agreeing, context.run.num_threads);
}

std::vector<RotationHypothesis> HypothesizeRotations(StageContext& context,
                                                     std::span<const image_t> component,
                                                     const ViewGraph& graph) {
  ModelStage stage(context, "rotation_averaging");
  ViewGraph own = graph;
  KeepImages(component, own);
  stage.Add("edges_in", own.NumActiveEdges());
  Averager averager(context, stage, own);
  // Of a data set's pairs, inliers were not counted.
  if (averager.AddAll() && !context.scene.poses_imported &&
      own.NumActiveEdges() <= kMaxFreshEdges) {
    averager.AddTrees();
  }
  const std::vector<RotationHypothesis> distinct = averager.Distinct();
  stage.Add("averaged", averager.NumTried());
  stage.Add("hypotheses_out", distinct.size());
  if (!distinct.empty()) {
    stage.Add("images_out", distinct.front().cam_from_world.size());
    stage.Add("median_residual_deg", distinct.front().median_residual_deg);
    stage.Add("edges_rejected", distinct.front().num_rejected);
    stage.Add("support", distinct.front().support / distinct.front().possible_support);
  }
  return distinct;
}

}  // namespace cairn
