#include <algorithm>
#include <utility>

#include "cairn/math/angles.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

std::vector<image_t> ImagesOf(const Reconstruction& model) {
  std::vector<image_t> images;
  for (const auto& [id, image] : model.images) images.push_back(id);
  return images;
}

// Components that wait for their model, the largest first.
class ComponentQueue {
 public:
  struct Component {
    std::vector<image_t> images;
    bool is_part = false;                     // duplicate structure was found on the way to it
    const Reconstruction* earlier = nullptr;  // the model that it has already
  };

  explicit ComponentQueue(const std::vector<std::vector<image_t>>& components) {
    for (const std::vector<image_t>& images : components) Add({images});
  }
  explicit ComponentQueue(std::span<const Reconstruction> earlier) {
    for (const Reconstruction& model : earlier) Add({ImagesOf(model), false, &model});
  }

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
  // Images of earlier models, and of parts, that wait for a model of their own.
  std::set<image_t> Reserved(int min_images) const {
    std::set<image_t> reserved;
    for (const Component& component : components_) {
      const bool is_large = static_cast<int>(component.images.size()) >= min_images;
      if (component.earlier == nullptr && !(component.is_part && is_large)) continue;
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

// The relative pose of an edge that a model uses: the model's, where it uses the matches, although
// its rotation is another.
Rigid3d PoseOf(const ViewEdge& edge, const Reconstruction& model, double max_rotation_error_deg) {
  const auto image1 = model.images.find(edge.image_id1);
  const auto image2 = model.images.find(edge.image_id2);
  if (image1 == model.images.end() || image2 == model.images.end()) return edge.cam2_from_cam1;
  const Rigid3d pose = image2->second.cam_from_world * Inverse(image1->second.cam_from_world);
  const double error = AngleBetween(pose.rotation, edge.cam2_from_cam1.rotation);
  if (RadToDeg(error) <= max_rotation_error_deg) return edge.cam2_from_cam1;
  return {pose.rotation, pose.translation.normalized()};
}

// Keeps what became of the component's edges. Those between a part that was reconstructed and what
// was cut off from it stay as they were, and so do those that only a model uses that is gone.
void TakeOver(const BuiltModel& built, double max_rotation_error_deg, ViewGraph& graph) {
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const ViewEdge& edge = built.graph.edges[e];
    if (edge.removal == EdgeRemoval::kOtherComponent || (!built.model && edge.IsActive())) continue;
    graph.edges[e] = edge;
    if (!edge.IsActive()) continue;
    graph.edges[e].cam2_from_cam1 = PoseOf(edge, *built.model, max_rotation_error_deg);
  }
}

std::vector<image_t> NotTaken(const StageContext& context, std::span<const image_t> images) {
  std::vector<image_t> rest;
  for (const image_t id : images) {
    if (!context.taken.contains(id)) rest.push_back(id);
  }
  return rest;
}

// Keeps the cameras of a model for the smaller ones.
void KeepFound(const Reconstruction& model, StageContext& context) {
  for (const auto& [id, num] : NumImagesOfCameras(model)) {
    if (num >= kEnoughToFind) context.found_cameras.try_emplace(id, model.cameras.at(id));
  }
}

// Keeps a finished model, with its warnings.
void TakeIn(StageContext& context, BuiltModel built, SceneModels& result) {
  for (const auto& [id, image] : built.model->images) context.taken.insert(id);
  std::vector<ResultWarning> warnings = std::move(built.warnings);
  if (!context.scene.poses_alone) {
    result.explained_shares.push_back(built.evidence.inside.Share());
    for (ResultWarning& each : JudgeModel(context, built)) {
      warnings.push_back(std::move(each));
    }
  }
  result.models.push_back(std::move(*built.model));
  result.keeps_frame.push_back(built.keeps_frame);
  result.warnings.push_back(std::move(warnings));
  result.evidence_nats += built.evidence.nats;
  result.num_explained += built.evidence.inside.num_explained;
}

// Input models stay as they are, also where new photographs join them.
void WarnOfJoinedModels(StageContext& context, const std::vector<Reconstruction>& models,
                        const ViewGraph& graph) {
  std::map<image_t, size_t> model_of;
  for (size_t k = 0; k < models.size(); ++k) {
    for (const auto& [id, image] : models[k].images) model_of[id] = k;
  }
  const auto joins = [&](const ViewEdge& edge) {
    const auto one = model_of.find(edge.image_id1), two = model_of.find(edge.image_id2);
    return edge.IsActive() && one != model_of.end() && two != model_of.end() &&
           one->second != two->second;
  };
  const auto first = std::ranges::find_if(graph.edges, joins);
  if (first == graph.edges.end()) return;
  const std::vector<image_t> ends = {first->image_id1, first->image_id2};
  context.report.warnings.push_back(
      {std::to_string(std::ranges::count_if(graph.edges, joins)) +
           " verified pairs join models that stay apart, since they began as input models: " +
           Names(context.scene, ends) + ", ...",
       "reconstruct with the largest of them as --input_path, or without, to join them"});
}

// A component that fails leaves the other models as they are. `failures`: why.
void GiveUp(StageContext& context, const ComponentQueue::Component& component, SceneModels& result,
            std::vector<std::string>& failures) {
  const std::string failure = std::exchange(context.report.failure, "");
  if (context.run.monitor.StopRequested()) return;
  failures.push_back(failure);
  if (component.earlier == nullptr) {
    result.without_model.push_back({component.images, failure});
  } else {
    context.report.warnings.push_back({"an input model of " +
                                           std::to_string(component.images.size()) +
                                           " images was given up: " + failure,
                                       context.settings.reconstruct.register_left_out
                                           ? "its images are reconstructed from nothing"
                                           : "reconstruct from the database alone"});
  }
}

// Of pairs whose images no model has together.
void TakeOutOthers(std::span<const Reconstruction> models, ViewGraph& graph) {
  if (models.empty()) return;
  for (ViewEdge& edge : graph.edges) {
    const auto has_both = [&](const Reconstruction& model) { return IsWithin(edge, model); };
    if (edge.IsActive() && std::ranges::none_of(models, has_both)) {
      edge.removal = EdgeRemoval::kOtherComponent;
    }
  }
}

}  // namespace

std::map<camera_t, int> NumImagesOfCameras(const Reconstruction& model) {
  std::map<camera_t, int> num_images;
  for (const auto& [id, image] : model.images) ++num_images[image.image.camera_id];
  return num_images;
}

std::set<camera_t> StageContext::FoundCamerasOf(const Reconstruction& model) const {
  std::set<camera_t> cameras;
  if (found_cameras.empty()) return cameras;
  for (const auto& [id, num] : NumImagesOfCameras(model)) {
    if (num < kEnoughToFind && found_cameras.contains(id)) cameras.insert(id);
  }
  return cameras;
}

SceneModels BuildModels(StageContext& context, const std::vector<std::vector<image_t>>& components,
                        std::span<const Reconstruction> earlier, ViewGraph& graph) {
  const ReconstructOptions& options = context.settings.reconstruct;
  ComponentQueue queue = earlier.empty() ? ComponentQueue(components) : ComponentQueue(earlier);
  SceneModels result;
  std::vector<std::string> failures;
  for (bool is_first = true; !queue.empty() && !context.run.monitor.StopRequested();
       is_first = false) {
    const ComponentQueue::Component component = queue.Pop();
    const std::vector<image_t> rest = NotTaken(context, component.images);
    if (component.earlier == nullptr && rest.size() < component.images.size()) {
      // A model has registered the others by matches of pairs that join no components.
      queue.AddPartsOf(rest, component.is_part, graph);
      continue;
    }
    const bool is_small = component.earlier == nullptr &&
                          static_cast<int>(component.images.size()) < options.min_model_images;
    if ((is_small && !is_first) || static_cast<int>(result.models.size()) == options.max_models) {
      result.without_model.push_back({component.images});
      continue;
    }
    context.reserved = queue.Reserved(options.min_model_images);
    BuiltModel built = component.earlier != nullptr
                           ? ContinueModel(context, *component.earlier, graph)
                           : BuildModel(context, component.images, graph);
    // What a wrong input model made of the edges tells nothing.
    if (built.model || component.earlier == nullptr) {
      TakeOver(built, context.settings.view_graph.max_rotation_error_deg, graph);
    }
    for (const size_t e : built.duplicate_edges) graph.edges[e].removal = EdgeRemoval::kAmbiguous;
    if (built.model) {
      if (component.earlier == nullptr) KeepFound(*built.model, context);
      TakeIn(context, std::move(built), result);
      if (component.earlier == nullptr) {
        queue.AddPartsOf(NotTaken(context, component.images), component.is_part, graph);
      }
    } else if (!built.duplicate_edges.empty()) {
      queue.AddPartsOf(component.images, true, graph);
    } else {
      GiveUp(context, component, result, failures);
    }
    context.model = static_cast<int>(result.models.size());
    if (component.earlier != nullptr && queue.empty()) {
      WarnOfJoinedModels(context, result.models, graph);
      // What no earlier model could take.
      if (options.register_left_out) {
        queue.AddPartsOf(NotTaken(context, graph.image_ids), false, graph);
      }
    }
  }
  TakeOutOthers(result.models, graph);
  if (result.models.empty() && context.report.Succeeded() && !failures.empty()) {
    context.report.failure = failures.front();
  } else {
    for (const std::string& failure : failures) context.run.monitor.Warning(failure);
  }
  return result;
}

}  // namespace cairn
