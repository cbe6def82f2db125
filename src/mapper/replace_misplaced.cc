#include <utility>

#include "mapper/stages.h"

namespace cairn {
namespace {

// Nats by which one of two models of the same images is the better one beyond doubt.
constexpr double kDecisiveNats = 10;

// Do images that were registered anew explain more matches than before, though others may be
// missing still?
bool ExplainMore(const std::set<image_t>& anew, const BuiltModel& after, const BuiltModel& before) {
  const auto is_registered = [&](image_t id) {
    return anew.contains(id) && after.model->images.contains(id);
  };
  int64_t num_after = 0, num_before = 0;
  for (size_t e = 0; e < after.graph.edges.size(); ++e) {
    const ViewEdge& edge = after.graph.edges[e];
    if (!is_registered(edge.image_id1) && !is_registered(edge.image_id2)) continue;
    num_after += after.evidence.pairs[e].num_explained;
    num_before += before.evidence.pairs[e].num_explained;
  }
  return num_after > num_before;
}

// The model after these images found another place, refined; none unless it then has more evidence
// beyond doubt.
std::optional<BuiltModel> RefineAnew(StageContext& context, const std::set<image_t>& anew,
                                     const BuiltModel& before, BuiltModel after) {
  Reconstruction& model = *after.model;
  after.evidence = EvidenceFor(context, model, after.graph);
  if (!IsQuick(*before.model) && !ExplainMore(anew, after, before)) {
    return std::nullopt;
  }
  ReviseEdges(after.evidence, model, after.graph);
  const std::string failure = context.report.failure;
  const bool has_grown = FitAndRefine(context, TracksOfGraph(context, after.graph).tracks,
                                      RefineStart::kChanged, model) &&
                         GrowModel(context, after.graph, model);
  context.report.failure = failure;
  if (!has_grown) return std::nullopt;
  after.evidence = EvidenceFor(context, model, after.graph);
  if (!(after.evidence.nats > before.evidence.nats + kDecisiveNats)) return std::nullopt;
  return after;
}

// The model with these images registered anew, by resection in the model of the others; none where
// that explains no more.
std::optional<BuiltModel> RegisterAnew(StageContext& context, const BuiltModel& built,
                                       const std::set<image_t>& misplaced) {
  if (misplaced.empty() || 2 * misplaced.size() >= built.model->images.size()) return std::nullopt;
  BuiltModel other = built;
  for (const image_t id : misplaced) RemoveImage(id, *other.model);
  if (RegisterLeftOut(context, other.graph, *other.model) == 0) return std::nullopt;
  return RefineAnew(context, misplaced, built, std::move(other));
}

// The model with a part placed as a whole; none where that explains no more.
std::optional<BuiltModel> PlaceAnew(StageContext& context, const BuiltModel& built,
                                    const std::set<image_t>& part) {
  const PartAndRest split = SplitOff(built, part);
  const PlaceOfPart place = PlacePart(context, built.graph, split.rest, split.part);
  if (place.num_agreeing <= place.num_before) return std::nullopt;
  BuiltModel other = built;
  for (const image_t id : part) {
    Rigid3d& cam_from_world = other.model->images.at(id).cam_from_world;
    cam_from_world = TransformCameraWorld(place.rest_from_part, cam_from_world);
  }
  return RefineAnew(context, part, built, std::move(other));
}

// Places a group whose scale may be wrong as a whole, or registers anew what may be misplaced: all
// groups that the matches contradict, else those whose scale beside the others the model does not
// know.
std::optional<BuiltModel> RegisterMisplaced(StageContext& context, const BuiltModel& built) {
  for (const MisplacedGroup& group : FindGroupsOfOwnScale(context, built)) {
    if (auto other = PlaceAnew(context, built, group.images)) return other;
  }
  const std::vector<MisplacedGroup> groups = FindMisplacedGroups(context, built);
  std::set<image_t> all;
  for (const MisplacedGroup& group : groups) all.insert(group.images.begin(), group.images.end());
  auto other = RegisterAnew(context, built, all);
  if (!other) other = RegisterAnew(context, built, FindHinged(context, built.graph, *built.model));
  return other;
}

}  // namespace

void ReplaceMisplaced(StageContext& context, BuiltModel& best) {
  if (!context.settings.reconstruct.register_left_out) return;
  while (!context.run.monitor.StopRequested()) {
    auto other = RegisterMisplaced(context, best);
    if (!other) break;
    best = std::move(*other);
  }
}

}  // namespace cairn
