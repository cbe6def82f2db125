#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/base/parallel.h"
#include "cairn/math/median.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "mapper/stages.h"
#include "view_graph/duplicate_structure.h"
#include "view_graph/loose_group.h"

namespace cairn {
namespace {

// The frame: centroid of the camera centers at the origin, their median distance from it 1, the
// first camera's rotation the identity. So it does not depend on the gauge that the stages left.
void NormalizeFrame(Reconstruction& model) {
  std::vector<Eigen::Vector3d> centers;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& [id, image] : model.images) centers.push_back(image.cam_from_world.Center());
  for (const Eigen::Vector3d& c : centers) mean += c / static_cast<double>(centers.size());
  std::vector<double> distances;
  for (const Eigen::Vector3d& c : centers) distances.push_back((c - mean).norm());
  const double median = UpperMedian(distances);
  Sim3d new_from_old;
  new_from_old.scale = median > 0 ? 1.0 / median : 1.0;
  new_from_old.rotation = model.images.begin()->second.cam_from_world.rotation;
  new_from_old.translation = -new_from_old.scale * (new_from_old.rotation * mean);
  model.Transform(new_from_old);
}

// Ids 1, 2, ... without gaps.
void RenumberPoints(int num_threads, Reconstruction& model) {
  std::vector<Point3D> points;
  for (auto& [id, point] : model.points3D) points.push_back(std::move(point));
  model.points3D.clear();
  for (auto& [id, image] : model.images) {
    std::fill(image.point3D_ids.begin(), image.point3D_ids.end(), kInvalidPoint3DId);
  }
  model.AddPoints3D(std::move(points), num_threads);
}

// Warns of places shown on top of each other, and finds the edges that did it.
std::vector<size_t> FindDuplicates(StageContext& context, const ViewGraph& graph,
                                   const std::string& consequence, const Reconstruction& model,
                                   std::vector<ResultWarning>& warnings) {
  ModelStage stage(context, "duplicate_structure");
  const DuplicateStructure found = FindDuplicateStructure(model, graph, context.run);
  stage.Add("edges_removed", found.edges.size());
  stage.Add("edges_conflicting", found.num_conflicting);
  stage.Add("edges_told", found.num_told);
  if (!found.edges.empty()) {
    stage.Warn("duplicate structure: the model puts similar places on top of each other; " +
               std::to_string(found.edges.size()) + " pairs between them " + consequence);
  } else if (found.IsDoubtful()) {
    warnings.push_back({"it may put similar places on top of each other: in " +
                            std::to_string(found.num_conflicting) + " of " +
                            std::to_string(found.num_told) +
                            " pairs, each photo shows things where the other shows others; they "
                            "are of " +
                            Names(context.scene, found.images),
                        "give the photos of each place to a run of their own"});
  }
  return found.edges;
}

// False: the model is not fit to be written, and the report has the failure.
bool IsFit(StageContext& context, const Reconstruction& model) {
  const std::string reason = ReasonToRefuse(model);
  if (reason.empty()) return true;
  ModelStage stage(context, "checks");
  stage.Fail("the model was refused: " + reason,
             context.has_mostly_parallel_rays
                 ? "most of what the photos share shows no parallax: take some from other places"
                 : "look at the view graph with global_sfm inspect, and add photos that overlap: "
                   "three and more must show the same points");
  return false;
}

// As above.
bool CheckModel(StageContext& context, size_t num_images, const ModelEvidence& evidence,
                Reconstruction& model) {
  if (!IsFit(context, model)) return false;
  ModelStage stage(context, "checks");
  const std::string percent = std::to_string(std::lround(100 * evidence.inside.Share()));
  stage.Note("a model of " + std::to_string(model.images.size()) + " of " +
             std::to_string(std::max(num_images, model.images.size())) + " images explains " +
             percent + " % of their verified matches (" +
             std::to_string(std::llround(evidence.nats)) + " nats of evidence)");
  stage.Add("images", model.images.size());
  stage.Add("images_of_component", num_images);
  stage.Add("points", model.points3D.size());
  stage.Add("observations", model.NumObservations());
  stage.Add("mean_track_length", model.MeanTrackLength());
  stage.Add("mean_reprojection_error_px", model.MeanReprojectionErrorPx(context.run.num_threads));
  stage.Add("explained_share", evidence.inside.Share());
  stage.Add("pairs", evidence.num_pairs);
  stage.Add("contradicted_pairs", evidence.num_contradicted);
  stage.Add("evidence_nats", evidence.nats);
  return true;
}

bool FindsAgain(StageContext& context, const Reconstruction& best, const Reconstruction& rough) {
  ModelStage stage(context, "comparison");
  const bool finds_again = LeadsTo(context, best, rough);
  stage.Add("finds_best_again", finds_again);
  return finds_again;
}

// From global rotations to the finished model. Without one, the report has the failure, or the
// rotations lead to the best one once more (nullptr: there is none).
BuiltModel BuildFrom(StageContext& context, std::span<const image_t> component,
                     const ViewGraph& graph, const RotationHypothesis& rotations,
                     const Reconstruction* best) {
  BuiltModel built{std::nullopt, graph, {}, {}};
  KeepImages(component, built.graph);
  auto initial = AverageComponent(context, rotations.cam_from_world, built.graph);
  if (!initial) return built;
  Reconstruction model = MakeReconstruction(context.scene, initial->cam_from_world);
  for (const camera_t id : context.FoundCamerasOf(model)) {
    model.cameras.at(id) = context.found_cameras.at(id);
  }
  if (context.scene.poses_alone) {
    ReportAgreement(context, model);
    built.model = std::move(model);
    return built;
  }
  if (!FitTracksToMemory(context, model, initial->tracks)) return built;
  FindStart(context, initial->tracks, model);
  if (best != nullptr && FindsAgain(context, *best, model)) return built;
  RefineModel(context, initial->tracks, RefineStart::kChanged, model);
  if (!GrowModel(context, built.graph, model)) return built;
  built.evidence = EvidenceFor(context, model, built.graph);
  if (!CheckModel(context, component.size(), built.evidence, model)) return built;
  built.model = std::move(model);
  built.min_angle_deg = context.min_angle_deg;
  return built;
}

// Pairs that disagree with a hypothesis bring its model matches, too, once they have another pose
// (RefitEdges), but seldom more than the rest of this share.
constexpr double kAgreeingShare = 0.9;

// Independent matches of pairs that a hypothesis must agree with to be worth a model. Where a model
// takes long, more than the best model's hypothesis agreed with.
double NumWorthAModel(const BuiltModel& best, int64_t num_of_best_hypothesis) {
  return IsQuick(*best.model) ? kAgreeingShare * static_cast<double>(best.evidence.num_independent)
                              : static_cast<double>(num_of_best_hypothesis + 1);
}

// The model with the most evidence of those that the hypotheses lead to.
BuiltModel BuildBest(StageContext& context, std::span<const image_t> component,
                     const ViewGraph& graph, std::span<const RotationHypothesis> hypotheses) {
  BuiltModel best{std::nullopt, graph, {}, {}};
  std::string first_failure = std::exchange(context.report.failure, "");
  int64_t num_of_best = 0;
  std::vector<int64_t> num_explainable(hypotheses.size());
  ParallelFor(context.run.num_threads, std::ssize(hypotheses), [&](int64_t i) {
    num_explainable[i] = NumExplainable(context, graph, hypotheses[i]);
  });
  for (size_t i = 0; i < hypotheses.size(); ++i) {
    if (context.run.monitor.StopRequested()) break;
    // Others could explain no more than what camera models leave out.
    if (best.model && best.evidence.all.Share() >= 1 - kModelErrors) break;
    if (best.model && static_cast<double>(num_explainable[i]) < NumWorthAModel(best, num_of_best)) {
      continue;
    }
    BuiltModel built =
        BuildFrom(context, component, graph, hypotheses[i], best.model ? &*best.model : nullptr);
    const std::string failure = std::exchange(context.report.failure, "");
    if (first_failure.empty()) first_failure = failure;
    if (!built.model) continue;
    if (!best.model || built.evidence.nats > best.evidence.nats) {
      best = std::move(built);
      num_of_best = num_explainable[i];
    }
  }
  if (!best.model) context.report.failure = first_failure;
  return best;
}

// Leaves the largest of the parts that hang together. Others become models of their own.
void TakeApart(StageContext& context, const ViewGraph& graph, Reconstruction& model) {
  ModelStage stage(context, "parts_apart");
  const std::vector<std::set<image_t>> parts = FindApart(graph, model);
  for (const std::set<image_t>& part : parts) {
    stage.Record("joined with the model by wrong pairs alone: " +
                 Names(context.scene, std::vector<image_t>(part.begin(), part.end())));
    for (const image_t id : part) RemoveImage(id, model);
  }
  stage.Add("parts", parts.size());
}

// Intrinsics and places of the model that was chosen. False: there is not enough memory, or little
// is left of the model, and the report has the failure.
bool ImproveBest(StageContext& context, BuiltModel& best) {
  context.min_angle_deg = best.min_angle_deg;
  if (ChooseLensModels(context, best)) {
    if (!GrowModel(context, best.graph, *best.model)) return false;
    best.evidence = EvidenceFor(context, *best.model, best.graph);
  }
  ReplaceMisplaced(context, best);
  if (FreePrincipalPoints(context, best.graph, false, *best.model, best.warnings) &&
      !FitAndRefine(context, TracksOfGraph(context, best.graph).tracks, RefineStart::kRefined,
                    *best.model)) {
    return false;
  }
  if (!RefineWithMovedIntrinsics(context, best.graph, *best.model)) return false;
  TakeApart(context, best.graph, *best.model);
  AdjustToPlaces(context, *best.model);
  if (!IsFit(context, *best.model)) return false;
  best.model->UpdatePointErrors(context.run.num_threads);
  best.evidence = EvidenceFor(context, *best.model, best.graph);
  return true;
}

// The best model, improved. Without one, the report has the failure.
BuiltModel BuildImproved(StageContext& context, std::span<const image_t> component,
                         const ViewGraph& graph) {
  BuiltModel best =
      BuildBest(context, component, graph, HypothesizeRotations(context, component, graph));
  if (best.model && !context.scene.poses_alone && !ImproveBest(context, best)) best.model.reset();
  return best;
}

// A graph without the pairs that hold a group where the model has it.
ViewGraph WithoutPairsOf(const LooseGroup& group, const ViewGraph& of_model, ViewGraph graph) {
  const auto joins = [&](const ViewEdge& edge) {
    return (group.images.contains(edge.image_id1) && group.others.contains(edge.image_id2)) ||
           (group.others.contains(edge.image_id1) && group.images.contains(edge.image_id2));
  };
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    if (of_model.edges[e].IsActive() && joins(graph.edges[e])) {
      graph.edges[e].removal = EdgeRemoval::kAmbiguous;
    }
  }
  return graph;
}

// As many images, and nearly as many pairs in use: the matches of a pair that sees what looks alike
// hang together.
bool UsesAsMuch(const BuiltModel& other, const BuiltModel& best) {
  constexpr double kNearly = 0.95;
  const auto num_pairs = [](const BuiltModel& built) {  // twice
    int num = 0;
    for (const auto& [id, of_image] : NumPairsInUse(built.graph, *built.model)) num += of_image;
    return num;
  };
  return other.model->images.size() >= best.model->images.size() &&
         num_pairs(other) >= kNearly * num_pairs(best);
}

LooseGroup FindLoose(StageContext& context, const Reconstruction& model) {
  ModelStage stage(context, "loose_group");
  LooseGroup group = FindLooseGroup(model, context.scene.tried_pairs(), context.run);
  stage.Add("images", group.images.size());
  stage.Add("relative_rate", group.relative_rate);
  return group;
}

// Images of another side of a building that looks alike match the side that they are put on badly.
// Do other pairs put them elsewhere? (Of many groups one is always loose: at night, say.)
void PlaceLooseGroup(StageContext& context, std::span<const image_t> component,
                     const ViewGraph& graph, BuiltModel& best) {
  if (!context.scene.tried_pairs || !IsQuick(*best.model)) return;
  const LooseGroup group = FindLoose(context, *best.model);
  if (!group.IsLoose()) return;
  BuiltModel other = BuildImproved(context, component, WithoutPairsOf(group, best.graph, graph));
  context.report.failure.clear();
  if (other.model && UsesAsMuch(other, best) && !FindLoose(context, *other.model).IsLoose()) {
    const std::vector<image_t> images(group.images.begin(), group.images.end());
    ModelStage(context, "another_place")
        .Note("images of another side that looks alike get the place that other pairs give them (" +
              std::to_string(images.size()) + "): " + Names(context.scene, images));
    best = std::move(other);
  }
  context.min_angle_deg = best.min_angle_deg;
}

// The images of an earlier model, and those that are in none.
std::vector<image_t> ImagesWithin(const StageContext& context, const Reconstruction& earlier) {
  std::vector<image_t> images;
  for (const auto& [id, pixels] : context.scene.pixels) {
    const bool is_elsewhere = context.taken.contains(id) || context.reserved.contains(id);
    if (earlier.images.contains(id) || !is_elsewhere) images.push_back(id);
  }
  return images;
}

// Tracks of the graph with all matches that agree with the model.
std::vector<Track> TracksOfModel(StageContext& context, const ViewGraph& graph,
                                 const Reconstruction& model) {
  return TracksOfGraph(context, graph, VerifyAgain(context, model, graph).matches).tracks;
}

// Registers images in an earlier model, whose intrinsics are known to be right, and refines it.
// False: as above.
bool GrowEarlier(StageContext& context, ViewGraph& graph, Reconstruction& model) {
  if (context.settings.reconstruct.register_left_out) RegisterLeftOut(context, graph, model);
  ReviseEdges(EvidenceFor(context, model, graph), model, graph);
  std::vector<Track> tracks = TracksOfModel(context, graph, model);
  if (!FitAndRefine(context, std::move(tracks), RefineStart::kChanged, model)) return false;
  const std::optional<int> num_refined = GrowModel(context, graph, model);
  return num_refined && (*num_refined == 0 || RefineWithMovedIntrinsics(context, graph, model));
}

}  // namespace

BuiltModel BuildModel(StageContext& context, std::span<const image_t> component,
                      const ViewGraph& graph) {
  BuiltModel best = BuildImproved(context, component, graph);
  if (!best.model) return best;
  if (context.settings.reconstruct.separate_duplicates && !context.scene.poses_alone) {
    PlaceLooseGroup(context, component, graph, best);
    best.duplicate_edges =
        FindDuplicates(context, best.graph, "are removed and their images reconstructed again",
                       *best.model, best.warnings);
    if (!best.duplicate_edges.empty()) {
      best.model.reset();
      return best;
    }
  }
  NormalizeFrame(*best.model);
  RenumberPoints(context.run.num_threads, *best.model);
  return best;
}

BuiltModel ContinueModel(StageContext& context, const Reconstruction& earlier,
                         const ViewGraph& graph) {
  BuiltModel built{std::nullopt, graph, {}, {}};
  KeepImages(ImagesWithin(context, earlier), built.graph);
  Reconstruction model = earlier;
  ReviseEdges(EvidenceFor(context, model, built.graph), model, built.graph);
  std::vector<Track> tracks = TracksOfModel(context, built.graph, model);
  if (!FitTracksToMemory(context, model, tracks)) return built;
  const auto confidences = TriangulateModel(context, tracks, model);
  model.cameras.insert(earlier.cameras.begin(), earlier.cameras.end());
  if (!GrowEarlier(context, built.graph, model)) return built;
  if (FreePrincipalPoints(context, built.graph, true, model, built.warnings) &&
      !FitAndRefine(context, TracksOfGraph(context, built.graph).tracks, RefineStart::kRefined,
                    model)) {
    return built;
  }
  AdjustToPlaces(context, model);
  built.evidence = EvidenceFor(context, model, built.graph);
  const size_t num_images = std::max(earlier.images.size(), model.images.size());
  if (!CheckModel(context, num_images, built.evidence, model)) {
    return built;
  }
  if (context.settings.reconstruct.separate_duplicates &&
      !FindDuplicates(context, built.graph, "stay, since an earlier model has them", model,
                      built.warnings)
           .empty()) {
    built.warnings.push_back({"it puts similar places on top of each other",
                              "reconstruct without --input_path to separate them"});
  }
  model.UpdatePointErrors(context.run.num_threads);
  const std::vector<ResultWarning> moved = KeepFrame(context, earlier, confidences, model);
  built.warnings.insert(built.warnings.end(), moved.begin(), moved.end());
  RenumberPoints(context.run.num_threads, model);
  built.model = std::move(model);
  built.keeps_frame = true;
  return built;
}

}  // namespace cairn
