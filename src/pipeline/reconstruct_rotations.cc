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

std::vector<RotationEdge> EdgesOf(const ViewGraph& graph) {
  std::vector<RotationEdge> edges;
  for (const ViewEdge& edge : graph.edges) {
    if (!edge.IsActive()) continue;
    edges.push_back({edge.image_id1, edge.image_id2, edge.cam2_from_cam1.rotation,
                     static_cast<double>(std::max(1, edge.num_inliers))});
  }
  return edges;
}

// Inliers of all pairs that have a pose, those that were taken out among them, by how well they
// agree with the rotations.
double SupportOf(const RotationHypothesis& hypothesis, const ViewGraph& graph, double scale_deg) {
  double support = 0;
  for (const ViewEdge& edge : graph.edges) {
    const auto rotation1 = hypothesis.cam_from_world.find(edge.image_id1);
    const auto rotation2 = hypothesis.cam_from_world.find(edge.image_id2);
    if (edge.removal == EdgeRemoval::kNoPose || rotation1 == hypothesis.cam_from_world.end() ||
        rotation2 == hypothesis.cam_from_world.end()) {
      continue;
    }
    const double error = RadToDeg(AngleBetween(rotation2->second * rotation1->second.conjugate(),
                                               edge.cam2_from_cam1.rotation));
    support += std::max(1, edge.num_inliers) / (1.0 + std::pow(error / scale_deg, 2));
  }
  return support;
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

// The largest component's rotations from its edges with so many inliers and more.
std::optional<RotationHypothesis> Average(StageContext& context, ViewGraph graph,
                                          int min_num_inliers, double weight_power, Stage& stage) {
  RemoveWeakEdges(min_num_inliers, graph);
  const auto components = ActiveComponents(graph);
  if (components.empty()) return std::nullopt;
  KeepImages(components.front(), graph);
  RotationAveragingOptions options = context.settings.rotation_averaging;
  options.weight_power = weight_power;
  const std::vector<RotationEdge> edges = EdgesOf(graph);
  const RotationAveragingReport report = AverageRotations(edges, options, context.monitor);
  if (report.status != RotationAveragingStatus::kSuccess &&
      report.status != RotationAveragingStatus::kNotConverged) {
    stage.Fail(std::string(RotationAveragingStatusName(report.status)) + " on " +
                   std::to_string(edges.size()) + " edges",
               "look at the view graph with global_sfm inspect");
    return std::nullopt;
  }
  return RotationHypothesis{min_num_inliers, weight_power, report.cam_from_world,
                            report.median_residual_deg, 0};
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
  const double power = context.settings.rotation_averaging.weight_power;
  std::vector<RotationHypothesis> all;
  const auto add = [&](int min_num_inliers) {
    bool has_core = false;
    for (const double p : power == 0 ? std::vector<double>{0} : std::vector<double>{power, 0}) {
      auto hypothesis = Average(context, own, min_num_inliers, p, stage);
      if (!hypothesis) break;
      has_core = static_cast<double>(hypothesis->cam_from_world.size()) >
                 min_core_share * static_cast<double>(component.size());
      if (!has_core) break;
      hypothesis->support =
          SupportOf(*hypothesis, own, context.settings.rotation_averaging.sigma_start_deg);
      all.push_back(std::move(*hypothesis));
    }
    return has_core;
  };
  // A data set's inliers were not counted.
  const int least = std::max(1, context.settings.view_graph.min_num_inliers);
  if (add(0) && !context.scene.poses_imported) {
    for (int n = 2 * least; n < (1 << 20) && add(n); n *= 2) {
    }
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const auto& a, const auto& b) { return a.support > b.support; });
  std::vector<RotationHypothesis> distinct;
  for (RotationHypothesis& hypothesis : all) {
    const bool is_new =
        std::all_of(distinct.begin(), distinct.end(),
                    [&](const RotationHypothesis& other) { return IsAnother(hypothesis, other); });
    if (is_new) distinct.push_back(std::move(hypothesis));
  }
  stage.Add("averaged", static_cast<double>(all.size()));
  stage.Add("hypotheses_out", static_cast<double>(distinct.size()));
  if (!distinct.empty()) {
    stage.Add("images_out", static_cast<double>(distinct.front().cam_from_world.size()));
    stage.Add("median_residual_deg", distinct.front().median_residual_deg);
  }
  return distinct;
}

}  // namespace cairn
