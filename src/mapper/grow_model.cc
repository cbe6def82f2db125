#include "mapper/stages.h"

namespace cairn {

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
    if (num_new == 0 && static_cast<double>(num_gained) < kMinGain * model.NumObservations()) {
      break;
    }
    std::vector<Track> tracks = TracksOfGraph(context, graph).tracks;
    if (!FitTracksToMemory(context, model, tracks)) return std::nullopt;
    const RefineStart start = num_new > 0 ? RefineStart::kChanged : RefineStart::kRefined;
    if (!RefineModel(context, tracks, start, model)) break;
  }
  return round;
}

}  // namespace cairn
