#include <algorithm>
#include <utility>

#include "mapper/stages.h"

namespace cairn {
namespace {

class PartMerger {
 public:
  PartMerger(const SceneData& scene, const ReconstructOptions& options, const RunContext& run)
      : scene_(scene), options_(options), run_(run) {}

  ReconstructResult Merge(std::vector<PartResult> parts, RunReport report) {
    result_.report = std::move(report);
    TakeGraphsAndReports(parts);
    TakeModels(parts);
    for (PartResult& part : parts) {
      if (!part.report.Succeeded()) continue;  // which a warning names
      std::ranges::move(part.without_model, std::back_inserter(without_model_));
    }
    if (result_.report.Succeeded() && !run_.monitor.StopRequested()) ReportLeftOut();
    return std::move(result_);
  }

 private:
  void TakeGraphsAndReports(std::vector<PartResult>& parts) {
    result_.graph.edges = scene_.edges;
    const auto has_models = [](const PartResult& part) { return !part.models.empty(); };
    const bool succeeds = std::ranges::any_of(parts, has_models);
    for (size_t k = 0; k < parts.size(); ++k) {
      PartResult& part = parts[k];
      std::ranges::copy(part.graph.image_ids, std::back_inserter(result_.graph.image_ids));
      std::ranges::move(part.graph.edges, std::back_inserter(result_.graph.edges));
      for (StageReport& stage : part.report.stages) {
        if (parts.size() > 1) stage.Add("part", k + 1);
        if (part.is_side_by_side) stage.Add("side_by_side", 1);
        result_.report.stages.push_back(std::move(stage));
      }
      std::ranges::move(part.report.warnings, std::back_inserter(result_.report.warnings));
      if (!part.report.Succeeded()) TakeFailure(part, succeeds);
    }
    result_.graph.Normalize();
  }

  // A part that fails leaves the others as they are.
  void TakeFailure(const PartResult& part, bool others_succeed) {
    const std::vector<image_t>& images = part.graph.image_ids;
    if (others_succeed) {
      result_.report.warnings.push_back({"no model of " + std::to_string(images.size()) +
                                             " images (" + Names(scene_, images) +
                                             "): " + part.report.failure,
                                         ""});
      named_.insert(images.begin(), images.end());
    } else if (result_.report.Succeeded()) {
      result_.report.failure = part.report.failure;
    }
  }

  // The largest first, with their warnings, which name their folders. (Every part builds its
  // largest component, however small it is, and models may be smaller than their components.)
  void TakeModels(std::vector<PartResult>& parts) {
    std::vector<std::pair<PartResult*, size_t>> built;
    for (PartResult& part : parts) {
      for (size_t i = 0; i < part.models.size(); ++i) built.emplace_back(&part, i);
    }
    std::ranges::stable_sort(built, std::ranges::greater(), [](const auto& each) {
      return each.first->models[each.second].images.size();
    });
    for (const auto& [part, i] : built) {
      Reconstruction& model = part->models[i];
      const bool is_small = !result_.models.empty() && !part->keeps_frame[i] &&
                            std::ssize(model.images) < options_.min_model_images;
      const bool are_enough = std::ssize(result_.models) == options_.max_models;
      if (are_enough || is_small) {
        std::vector<image_t>& images = without_model_.emplace_back().images;
        for (const auto& [id, image] : model.images) images.push_back(id);
        continue;
      }
      for (ResultWarning& warning : part->warnings[i]) {
        warning.what = "sparse/" + std::to_string(result_.models.size()) + " (" +
                       std::to_string(model.images.size()) + " images): " + warning.what;
        result_.report.warnings.push_back(std::move(warning));
      }
      if (!scene_.poses_alone) result_.explained_shares.push_back(part->explained_shares[i]);
      result_.keeps_frame.push_back(part->keeps_frame[i]);
      result_.models.push_back(std::move(model));
    }
  }

  // Names what is in no model.
  void ReportLeftOut() {
    RunStage stage(result_.report, run_.monitor, "left_out");
    std::set<image_t> taken;
    for (const Reconstruction& model : result_.models) {
      for (const auto& [id, image] : model.images) taken.insert(id);
    }
    for (const auto& [images, reason] : without_model_) {
      stage.Note("no model of " + std::to_string(images.size()) + " connected images (" + reason +
                 "): " + Names(scene_, images));
      named_.insert(images.begin(), images.end());
    }
    std::vector<image_t> others;
    for (const auto& [id, image] : scene_.images) {
      if (!taken.contains(id) && !named_.contains(id)) others.push_back(id);
    }
    if (!others.empty()) {
      stage.Note(std::string("images in no model (") +
                 (options_.register_left_out ? "too few verified matches with others"
                                             : "--reconstruct.register_left_out 0") +
                 "): " + Names(scene_, others));
    }
    stage.Add("small_components", without_model_.size());
    stage.Add("images", scene_.images.size() - taken.size());
  }

  const SceneData& scene_;
  const ReconstructOptions& options_;
  const RunContext& run_;
  ReconstructResult result_;
  std::vector<WithoutModel> without_model_;
  std::set<image_t> named_;  // in a warning or a note
};

}  // namespace

ReconstructResult MergeParts(std::vector<PartResult> parts, const SceneData& scene,
                             const ReconstructOptions& options, const RunContext& run,
                             RunReport report) {
  return PartMerger(scene, options, run).Merge(std::move(parts), std::move(report));
}

}  // namespace cairn
