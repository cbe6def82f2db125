#include <cstdio>

#include "mapper/stages.h"

namespace cairn {
namespace {

// In few photographs, a principal point is hardly told from their rotations.
constexpr int kMinImages = 8;
// Standard errors of a gain beyond doubt.
constexpr double kDecisiveErrors = 3;
// Larger models are not adjusted once more only to say that principal points are off.
constexpr int64_t kMaxObservationsToLook = 500'000;
// Of bundle adjustment, which is nearly there after the first few.
constexpr int kIterations = 100;
constexpr int kIterationsToLook = 4;

std::string WithOneDigit(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f", value);
  return text;
}

std::string CenterText(const Camera& camera) {
  const Eigen::Vector2d center = camera.PrincipalPoint();
  return "(" + WithOneDigit(center.x()) + ", " + WithOneDigit(center.y()) + ")";
}

// Cameras of enough images whose principal points are guesses, the image centers.
std::set<camera_t> GuessedPrincipalPoints(const SceneData& scene, const Reconstruction& model) {
  std::map<camera_t, int> num_images;
  for (const auto& [id, image] : model.images) ++num_images[image.image.camera_id];
  std::set<camera_t> guessed;
  for (const auto& [id, num] : num_images) {
    const Camera& camera = model.cameras.at(id);
    const Eigen::Vector2d center(0.5 * camera.width, 0.5 * camera.height);
    const bool is_guess =
        scene.constant_cameras.count(id) == 0 && camera.PrincipalPoint() == center;
    if (is_guess && num >= kMinImages) guessed.insert(id);
  }
  return guessed;
}

}  // namespace

void FreePrincipalPoints(StageContext& context, const ViewGraph& graph, Reconstruction& model) {
  const bool is_wanted = context.settings.reconstruct.refine_principal_points;
  const std::set<camera_t> guessed = GuessedPrincipalPoints(context.scene, model);
  if (guessed.empty() || (!is_wanted && model.NumObservations() > kMaxObservationsToLook)) return;
  Reconstruction other = model;
  context.free_principal_points = guessed;
  AdjustModel(context, is_wanted ? kIterations : kIterationsToLook, other);
  const double errors =
      StandardErrorsOfGain(EvidenceFor(context, model, graph), EvidenceFor(context, other, graph));
  const bool is_decisive = errors > kDecisiveErrors && other.images.size() == model.images.size();
  if (!is_wanted || !is_decisive) context.free_principal_points.clear();
  ModelStage stage(context, "principal_points");
  stage.Add("standard_errors_of_gain", errors);
  stage.Add("refined", context.free_principal_points.size());
  if (!is_decisive) return;
  const std::string by = ", by " + WithOneDigit(errors) + " standard errors";
  for (const camera_t id : guessed) {
    const std::string camera = "camera " + std::to_string(id) + ": ";
    const std::string before = CenterText(model.cameras.at(id));
    stage.Note(is_wanted ? camera + "principal point " + CenterText(other.cameras.at(id)) +
                               " in place of " + before + by
                         : camera + "the principal point is not " + before + by +
                               "; --reconstruct.refine_principal_points 1 finds it");
  }
  if (is_wanted) model = std::move(other);
}

}  // namespace cairn
