#include <algorithm>

#include "mapper/stages.h"

namespace cairn {
namespace {

// Components that wait for their model, the largest first.
class ComponentQueue {
 public:
  struct Component {
    std::vector<image_t> images;
    bool is_part = false;  // duplicate structure was found on the way to it
  };

  bool empty() const { return components_.empty(); }
  void Add(Component component) {
    const auto is_smaller = [&](const Component& other) {
      return other.images.size() < component.images.size();
    };
    components_.insert(std::find_if(components_.begin(), components_.end(), is_smaller),
                       std::move(component));
  }
  // Those that the active edges among these images form.
  void AddPartsOf(std::span<const image_t> images, bool is_part, ViewGraph graph) {
    KeepImages(images, graph);
    for (std::vector<image_t>& part : ActiveComponents(graph)) Add({std::move(part), is_part});
  }
  // Images of parts that wait for a model of their own.
  std::set<image_t> Reserved(int min_images) const {
    std::set<image_t> reserved;
    for (const Component& component : components_) {
      if (!component.is_part || static_cast<int>(component.images.size()) < min_images) {
        continue;
      }
      reserved.insert(component.images.begin(), component.images.end());
    }
    return reserved;
  }
  Component Pop() {
    Component component = std::move(components_.front());
    components_.erase(components_.begin());
    return component;
  }

 private:
  std::vector<Component> components_;
};

// Keeps what became of the component's edges. Those between a part that was reconstructed and what
// was cut off from it stay as they were.
void TakeOver(const ViewGraph& from, ViewGraph& graph) {
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    if (from.edges[e].removal != EdgeRemoval::kOtherComponent) {
      graph.edges[e].removal = from.edges[e].removal;
    }
  }
}

std::vector<image_t> NotTaken(const StageContext& context, std::span<const image_t> images) {
  std::vector<image_t> rest;
  for (const image_t id : images) {
    if (context.taken.count(id) == 0) rest.push_back(id);
  }
  return rest;
}

// Names what is in no model.
void ReportLeftOut(StageContext& context, const std::vector<std::vector<image_t>>& small) {
  RunStage stage(context.report, context.run.monitor, "left_out");
  std::set<image_t> named = context.taken;
  for (const std::vector<image_t>& images : small) {
    stage.Note("no model of " + std::to_string(images.size()) +
               " connected images (--reconstruct.min_model_images, --reconstruct.max_models): " +
               Names(context, images));
    named.insert(images.begin(), images.end());
  }
  std::vector<image_t> others;
  for (const auto& [id, image] : context.scene.images) {
    if (named.count(id) == 0) others.push_back(id);
  }
  if (!others.empty()) {
    stage.Note("images in no model (too few verified matches with others): " +
               Names(context, others));
  }
  stage.Add("small_components", small.size());
  stage.Add("images", context.scene.images.size() - context.taken.size());
}

struct JudgedModel {
  Reconstruction model;
  std::vector<ResultWarning> warnings;
};

// The largest model first; their warnings, in the report, name their folders.
std::vector<Reconstruction> SortBySize(std::vector<JudgedModel> judged, RunReport& report) {
  std::stable_sort(judged.begin(), judged.end(), [](const JudgedModel& a, const JudgedModel& b) {
    return a.model.images.size() > b.model.images.size();
  });
  std::vector<Reconstruction> models;
  for (JudgedModel& each : judged) {
    for (ResultWarning& warning : each.warnings) {
      warning.what = "sparse/" + std::to_string(models.size()) + " (" +
                     std::to_string(each.model.images.size()) + " images): " + warning.what;
      report.warnings.push_back(std::move(warning));
    }
    models.push_back(std::move(each.model));
  }
  return models;
}

}  // namespace

SceneModels BuildModels(StageContext& context, const std::vector<std::vector<image_t>>& components,
                        ViewGraph& graph) {
  const ReconstructOptions& options = context.settings.reconstruct;
  ComponentQueue queue;
  for (const std::vector<image_t>& images : components) queue.Add({images});
  std::vector<std::vector<image_t>> small;
  std::string first_failure;
  std::vector<JudgedModel> judged;
  SceneModels result;
  for (bool is_first = true; !queue.empty(); is_first = false) {
    if (context.run.monitor.StopRequested()) {
      context.report.failure = "stopped by the user after " + std::to_string(judged.size()) +
                               " models; run again to reconstruct";
      break;
    }
    const ComponentQueue::Component component = queue.Pop();
    const bool is_small = static_cast<int>(component.images.size()) < options.min_model_images;
    if ((is_small && !is_first) || static_cast<int>(judged.size()) == options.max_models) {
      small.push_back(component.images);
      continue;
    }
    context.reserved = queue.Reserved(options.min_model_images);
    BuiltModel built = BuildModel(context, component.images, graph);
    TakeOver(built.graph, graph);
    for (const size_t e : built.duplicate_edges) graph.edges[e].removal = EdgeRemoval::kAmbiguous;
    if (built.model) {
      result.evidence_nats += built.evidence.nats;
      for (const auto& [id, image] : built.model->images) context.taken.insert(id);
      queue.AddPartsOf(NotTaken(context, component.images), component.is_part, graph);
      std::vector<ResultWarning> warnings;
      if (!context.scene.poses_alone) {
        warnings = JudgeModel(context, *built.model, built.evidence, built.graph);
      }
      judged.push_back({std::move(*built.model), std::move(warnings)});
    } else if (!built.duplicate_edges.empty()) {
      queue.AddPartsOf(component.images, true, graph);
    } else {
      // A component that fails leaves the other models as they are.
      context.run.monitor.Warning(context.report.failure);
      if (first_failure.empty()) first_failure = context.report.failure;
      context.report.failure.clear();
      small.push_back(component.images);
    }
    context.model = static_cast<int>(judged.size());
  }
  if (judged.empty() && context.report.Succeeded()) context.report.failure = first_failure;
  ReportLeftOut(context, small);
  result.models = SortBySize(std::move(judged), context.report);
  return result;
}

}  // namespace cairn
