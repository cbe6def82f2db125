#include <algorithm>

#include "cairn/evaluation/alignment.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "pipeline/reconstruct_stages.h"

namespace cairn {
namespace {

// Images that are turned by more than this are turned by other edges, not by their noise.
constexpr double kTurnedDeg = 5.0;
// Fewer turned images do not make another model: resection puts single images right.
constexpr double kMinTurnedShare = 0.05;
// Where pairs with this share of all inliers agree with the rotations, weighed or not, there is
// nothing that other edges could tell.
constexpr double kClearSupport = 0.75;

std::vector<RotationEdge> EdgesOf(const ViewGraph& graph, const std::vector<double>& weights) {
  std::vector<RotationEdge> edges;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const ViewEdge& edge = graph.edges[e];
    if (!edge.IsActive()) continue;
    edges.push_back({edge.image_id1, edge.image_id2, edge.cam2_from_cam1.rotation, weights[e]});
  }
  return edges;
}

// Inliers of all pairs that have a pose, those that were taken out among them, by how well they
// agree with the rotations.
void SetSupport(const ViewGraph& graph, double scale_deg, RotationHypothesis& hypothesis) {
  for (const ViewEdge& edge : graph.edges) {
    const auto rotation1 = hypothesis.cam_from_world.find(edge.image_id1);
    const auto rotation2 = hypothesis.cam_from_world.find(edge.image_id2);
    if (edge.removal == EdgeRemoval::kNoPose || rotation1 == hypothesis.cam_from_world.end() ||
        rotation2 == hypothesis.cam_from_world.end()) {
      continue;
    }
    const double error = RadToDeg(AngleBetween(rotation2->second * rotation1->second.conjugate(),
                                               edge.cam2_from_cam1.rotation));
    hypothesis.possible_support += std::max(1, edge.num_inliers);
    hypothesis.support += std::max(1, edge.num_inliers) / (1.0 + std::pow(error / scale_deg, 2));
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

// The largest component of the edges with so many inliers and more: of pairs that are all surer,
// loops tell others apart than they do among all pairs.
ViewGraph CoreOf(ViewGraph graph, int min_num_inliers, const ViewGraphBuilderOptions& options) {
  for (ViewEdge& edge : graph.edges) {
    if (edge.removal == EdgeRemoval::kTripletInconsistent ||
        edge.removal == EdgeRemoval::kWeakBridge) {
      edge.removal = EdgeRemoval::kNone;
    }
  }
  RemoveWeakEdges(min_num_inliers, graph);
  ViewGraphReport report;
  if (options.filter_triplets) RemoveInconsistentTriplets(options, graph, report);
  const auto components = ActiveComponents(graph);
  if (!components.empty()) KeepImages(components.front(), graph);
  return graph;
}

// Tries ways to average a component's rotations.
class Averager {
 public:
  Averager(StageContext& context, Stage& stage, const ViewGraph& component, size_t num_images)
      : context_(context), stage_(stage), component_(component), num_images_(num_images) {}

  // From a connected graph. False: it has no more than this share of the component's images.
  bool Add(const ViewGraph& graph, const std::vector<double>& weights, double weight_power,
           int min_num_inliers, double min_core_share) {
    RotationAveragingOptions options = context_.settings.rotation_averaging;
    options.weight_power = weight_power;
    const std::vector<RotationEdge> edges = EdgesOf(graph, weights);
    RotationAveragingReport report = AverageRotations(edges, options, context_.monitor);
    if (report.status != RotationAveragingStatus::kSuccess &&
        report.status != RotationAveragingStatus::kNotConverged) {
      if (all_.empty()) {
        stage_.Fail(std::string(RotationAveragingStatusName(report.status)) + " on " +
                        std::to_string(edges.size()) + " edges",
                    "look at the view graph with global_sfm inspect");
      }
      return false;
    }
    RotationHypothesis hypothesis{min_num_inliers, weight_power, std::move(report.cam_from_world),
                                  report.median_residual_deg};
    if (static_cast<double>(hypothesis.cam_from_world.size()) <=
        min_core_share * static_cast<double>(num_images_)) {
      return false;
    }
    SetSupport(component_, options.sigma_start_deg, hypothesis);
    all_.push_back(std::move(hypothesis));
    return true;
  }

  bool IsClear() const {
    return !all_.empty() && !IsAnother(all_.front(), all_.back()) &&
           all_.front().support > kClearSupport * all_.front().possible_support;
  }

  size_t NumTried() const { return all_.size(); }

  // Those that differ, the best supported first.
  std::vector<RotationHypothesis> Distinct() {
    std::stable_sort(all_.begin(), all_.end(),
                     [](const auto& a, const auto& b) { return a.support > b.support; });
    std::vector<RotationHypothesis> distinct;
    for (RotationHypothesis& hypothesis : all_) {
      const auto differs = [&](const RotationHypothesis& other) {
        return IsAnother(hypothesis, other);
      };
      if (std::all_of(distinct.begin(), distinct.end(), differs)) {
        distinct.push_back(std::move(hypothesis));
      }
    }
    return distinct;
  }

 private:
  StageContext& context_;
  Stage& stage_;
  const ViewGraph& component_;
  size_t num_images_;
  std::vector<RotationHypothesis> all_;
};

std::vector<double> InliersOf(const ViewGraph& graph) {
  std::vector<double> weights;
  for (const ViewEdge& edge : graph.edges) weights.push_back(std::max(1, edge.num_inliers));
  return weights;
}

// Inverse variances, degrees^-2. Below the scale that averaging ends with, an error does not
// matter.
std::vector<double> PrecisionsOf(const StageContext& context, const ViewGraph& graph) {
  std::vector<double> precisions;
  for (const double sigma : RotationSigmas(context, graph)) {
    precisions.push_back(1.0 / (std::pow(RadToDeg(sigma), 2) +
                                std::pow(context.settings.rotation_averaging.sigma_end_deg, 2)));
  }
  return precisions;
}

}  // namespace

std::vector<RotationHypothesis> HypothesizeRotations(StageContext& context,
                                                     std::span<const image_t> component,
                                                     const ViewGraph& graph,
                                                     double min_core_share) {
  Stage stage(context, "rotation_averaging");
  ViewGraph own = graph;
  KeepImages(component, own);
  stage.Add("edges_in", own.NumActiveEdges());
  // The variance of a rotation falls with the number of inliers; but a few pairs of very many, all
  // neighbors, must not have all the say.
  std::vector<double> powers = {1, 0};
  if (const double power = context.settings.rotation_averaging.weight_power; power != 0) {
    powers.push_back(power);
  }
  const ViewGraphBuilderOptions& filters = context.settings.view_graph;
  const std::vector<double> inliers = InliersOf(own);
  Averager averager(context, stage, own, component.size());
  const auto add = [&](const ViewGraph& core, int min_num_inliers) {
    bool is_core = false;
    for (const double power : powers) {
      is_core = averager.Add(core, inliers, power, min_num_inliers, min_core_share);
      if (!is_core) break;
    }
    return is_core;
  };
  const bool has_any = add(own, 0);
  // Of a data set's pairs, inliers were not counted.
  if (has_any && !context.scene.poses_imported && (!averager.IsClear() || min_core_share == 0)) {
    const std::vector<double> precisions = PrecisionsOf(context, own);
    averager.Add(CoreOf(own, 0, filters), precisions, 1, 0, min_core_share);
    const int least = std::max(1, filters.min_num_inliers);
    for (int n = 2 * least; n < (1 << 20) && add(CoreOf(own, n, filters), n); n *= 2) {
      averager.Add(CoreOf(own, n, filters), precisions, 1, n, min_core_share);
    }
  }
  const std::vector<RotationHypothesis> distinct = averager.Distinct();
  stage.Add("averaged", static_cast<double>(averager.NumTried()));
  stage.Add("hypotheses_out", static_cast<double>(distinct.size()));
  if (!distinct.empty()) {
    stage.Add("images_out", static_cast<double>(distinct.front().cam_from_world.size()));
    stage.Add("median_residual_deg", distinct.front().median_residual_deg);
    stage.Add("support", distinct.front().support / distinct.front().possible_support);
  }
  return distinct;
}

}  // namespace cairn
