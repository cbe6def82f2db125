#include <utility>

#include "mapper/stages.h"

namespace cairn {
namespace {

// Nats by which one of two models of the same images is the better one beyond doubt.
constexpr double kDecisiveNats = 10;

}  // namespace

bool FitAndRefine(StageContext& context, std::vector<Track> tracks, RefineStart start,
                  Reconstruction& model) {
  if (!FitTracksToMemory(context, model, tracks)) return false;
  RefineModel(context, tracks, start, model);
  return true;
}

std::optional<int> GrowModel(StageContext& context, ViewGraph& graph, Reconstruction& model) {
  const ReconstructOptions& options = context.settings.reconstruct;
  int round = 0;
  for (; round < options.max_rounds && !context.run.monitor.StopRequested(); ++round) {
    const int num_new = options.register_left_out ? RegisterLeftOut(context, graph, model) : 0;
    const int64_t num_gained = ReviseEdges(EvidenceFor(context, model, graph), model, graph);
    if (num_new == 0 &&
        static_cast<double>(num_gained) < options.min_gain * model.NumObservations()) {
      break;
    }
    std::vector<Track> tracks = TracksOfGraph(context, graph).tracks;
    if (!FitTracksToMemory(context, model, tracks)) return std::nullopt;
    const RefineStart start = num_new > 0 ? RefineStart::kChanged : RefineStart::kRefined;
    if (!RefineModel(context, tracks, start, model)) break;
  }
  return round;
}

std::optional<BuiltModel> RefineIfBetter(StageContext& context, BuiltModel changed,
                                         double nats_before) {
  Reconstruction& model = *changed.model;
  ReviseEdges(changed.evidence, model, changed.graph);
  const std::string failure = context.report.failure;
  const bool has_grown = FitAndRefine(context, TracksOfGraph(context, changed.graph).tracks,
                                      RefineStart::kChanged, model) &&
                         GrowModel(context, changed.graph, model);
  context.report.failure = failure;
  if (!has_grown) return std::nullopt;
  changed.evidence = EvidenceFor(context, model, changed.graph);
  if (!(changed.evidence.nats > nats_before + kDecisiveNats)) return std::nullopt;
  return changed;
}

}  // namespace cairn
