#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>

#include "base/text.h"
#include "intrinsics/known_intrinsics.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// What a gain must exceed, in standard errors, as a normal deviate: little, since lenses of one
// parameter and principal points in the very center are rare. Photographs in a row may throw both
// off, which Student's t allows for.
constexpr double kMinDeviate = 1.645;
// A smaller gain says nothing.
constexpr double kChance = 1;
// Beyond doubt: for lenses of photographs with EXIF, which have COLMAP's model else, for image
// centers that an earlier model has kept, and for a warning.
constexpr double kDecisiveDeviate = 3;
// Larger models are not adjusted only to warn that principal points are off.
constexpr int64_t kMaxObservationsToLook = 500'000;
// Of bundle adjustment; after the first few it is seen whether the matches agree better.
constexpr int kIterations = 100;
constexpr int kIterationsToLook = 4;

// The cameras of so many images and more whose intrinsics are not constant.
std::set<camera_t> CamerasWith(const std::function<bool(const Camera&)>& property,
                               const StageContext& context, const Reconstruction& model,
                               int min_images = kEnoughToFind) {
  const std::set<camera_t> constant = context.ConstantCameras(model);
  std::set<camera_t> cameras;
  for (const auto& [id, num] : NumImagesOfCameras(model)) {
    if (num >= min_images && !constant.contains(id) && property(model.cameras.at(id))) {
      cameras.insert(id);
    }
  }
  return cameras;
}

// A model in which the intrinsics of some cameras are freer, and how much better the matches agree
// with it, as a normal deviate.
struct FreerModel {
  Reconstruction model;
  Agreement agreement;
  double deviate = 0;
};

// What becomes freer: the lenses of cameras, or their principal points.
struct Freedom {
  const std::set<camera_t>& cameras;
  bool has_centers;
  double min_deviate;  // from which on it is worth it
};

// What bundle adjustment makes of the freer model, unless it is soon seen that the matches do not
// agree better by more than that with it than with the plain one, adjusted for as long.
FreerModel Adjusted(StageContext& context, const ViewGraph& graph, const Freedom& freedom,
                    Reconstruction plain, Reconstruction model) {
  const size_t num_all = plain.images.size();
  const auto num_images = std::ranges::count_if(plain.images, [&](const auto& entry) {
    return freedom.cameras.contains(entry.second.image.camera_id);
  });
  FreerModel freer{std::move(model), {}};
  for (const int iterations : {kIterationsToLook, kIterations}) {
    AdjustModel(context, iterations, plain);
    AdjustModel(context, iterations, freer.model,
                freedom.has_centers ? freedom.cameras : std::set<camera_t>());
    freer.agreement = AgreementFor(context, freer.model, graph);
    // Images that one of them loses would count for the other.
    const bool has_all = plain.images.size() == num_all && freer.model.images.size() == num_all;
    freer.deviate =
        has_all ? NormalDeviate(
                      StandardErrorsOfGain(AgreementFor(context, plain, graph), freer.agreement),
                      static_cast<double>(num_images) - 1)
                : 0;
    if (freer.deviate <= freedom.min_deviate) break;
  }
  return freer;
}

std::string CenterText(const Camera& camera) {
  const Eigen::Vector2d center = camera.PrincipalPoint();
  return Formatted("(%.1f, %.1f)", center.x(), center.y());
}

bool HasExif(const StageContext& context, camera_t id) {
  return context.scene.cameras.at(id).has_prior_focal_length;
}

bool MayBeFreed(const StageContext& context, const Camera& camera) {
  switch (context.settings.reconstruct.refine_principal_points) {
    case PrincipalPointRefinement::kNone:
      return false;
    case PrincipalPointRefinement::kUnknown:
      return !HasExif(context, camera.camera_id);
    case PrincipalPointRefinement::kAll:
      return true;
  }
  return false;
}

double DistortionOf(const Camera& camera) {
  return camera.params[camera.DistortionIndices().front()];
}

// Whether the next term of a lens's series, about k^2 r^5, would be seen in the image's corner.
bool BendsMuch(const Camera& camera) {
  const double radius = 0.5 * camera.DiagonalPx() / camera.MeanFocal();
  const double next = std::pow(DistortionOf(camera), 2) * std::pow(radius, 5);
  return camera.MeanFocal() * next > DefaultMaxErrorPx(camera, camera);
}

// A SIMPLE_RADIAL camera by a model of two parameters, equal up to the third power of the angle off
// axis: tan(a) = a + a^3 / 3 + ...
Camera WithTwoParameters(const Camera& camera, CameraModel lens) {
  const Eigen::Vector2d center = camera.PrincipalPoint();
  const double k = DistortionOf(camera) + (CameraModelIsFisheye(lens) ? 1.0 / 3 : 0);
  Camera other = camera;
  other.model = lens;
  other.params = {camera.MeanFocal(), center.x(), center.y(), k, 0.0};
  return other;
}

std::string FoundText(camera_t id, const Reconstruction& model, const FreerModel& found) {
  return "camera " + std::to_string(id) + ": principal point " +
         CenterText(found.model.cameras.at(id)) + " in place of " +
         CenterText(model.cameras.at(id)) + Formatted(", by %.1f standard errors", found.deviate);
}

// That principal points stay where they are, though they are found elsewhere.
ResultWarning OffCenter(const std::set<camera_t>& cameras, const Reconstruction& model,
                        const FreerModel& found) {
  const size_t num_more = cameras.size() - 1;
  const camera_t farthest = *std::ranges::max_element(cameras, {}, [&](camera_t id) {
    return (found.model.cameras.at(id).PrincipalPoint() - model.cameras.at(id).PrincipalPoint())
        .norm();
  });
  return {
      "image centers are kept that the photos contradict: " + FoundText(farthest, model, found) +
          (num_more > 0 ? ", and " + std::to_string(num_more) + " more" : "") +
          "; all directions are off with them",
      "take them from the photos by --reconstruct.refine_principal_points all, or give the "
      "camera's calibration"};
}

// Of these cameras, if the matches agree better with what bundle adjustment finds, by more than
// min_deviate. takes: they are taken, not warned of.
std::optional<FreerModel> FindPrincipalPoints(StageContext& context, const ViewGraph& graph,
                                              const std::set<camera_t>& cameras, double min_deviate,
                                              bool takes, const Reconstruction& model) {
  if (cameras.empty()) return std::nullopt;
  FreerModel found = Adjusted(context, graph, {cameras, true, min_deviate}, model, model);
  const bool is_found = found.deviate > min_deviate;
  ModelStage stage(context, "principal_points");
  stage.Add("standard_errors_of_gain", found.deviate);
  stage.Add(takes ? "found" : "off_center", is_found ? cameras.size() : 0);
  if (!is_found) return std::nullopt;
  if (takes) {
    for (const camera_t id : cameras) stage.Record(FoundText(id, model, found));
  }
  return found;
}

// Moves a principal point from where bundle adjustment finds it to its posterior mean between that
// and the image center, the mean of its prior. Its standard error is told by the gain, whose square
// is one standard error's by chance, and which grows with the square of the way: the way's relative
// error is half of the gain's.
void TakePosterior(const StageContext& context, const Camera& before, double deviate,
                   Camera& found) {
  const double prior_px = context.settings.focal_calibration.principal_point_sigma *
                          std::max(found.width, found.height);
  const Eigen::Vector2d way = found.PrincipalPoint() - before.PrincipalPoint();
  const double squared_gain = deviate * deviate - kChance * kChance;
  const double share = 1 / (1 + way.squaredNorm() / (4 * squared_gain * prior_px * prior_px));
  const std::vector<int> indices = found.PrincipalPointIndices();
  for (int i = 0; i < 2; ++i) {
    found.params[indices[i]] = before.PrincipalPoint()[i] + share * way[i];
  }
}

std::string LensText(const Camera& was, const Camera& is, double deviate) {
  const auto text = [](const Camera& camera) {
    return std::string(CameraModelName(camera.model)) +
           Formatted(" of %.1f px", camera.MeanFocal());
  };
  return "camera " + std::to_string(is.camera_id) + ": " + text(is) + " in place of " + text(was) +
         Formatted(", by %.1f standard errors", deviate);
}

// These SIMPLE_RADIAL cameras by the lens of two parameters with which the matches agree best, if
// they agree better by more than min_deviate.
std::optional<FreerModel> FindLens(StageContext& context, const BuiltModel& best,
                                   const std::set<camera_t>& cameras, double min_deviate) {
  if (cameras.empty()) return std::nullopt;
  const std::map<camera_t, Camera>& before = best.model->cameras;
  const bool may_be_fisheye =
      std::ranges::any_of(cameras, [&](camera_t id) { return BendsMuch(before.at(id)); });
  std::optional<FreerModel> chosen;
  double largest_deviate = -std::numeric_limits<double>::infinity();
  for (const CameraModel lens : {CameraModel::kRadial, CameraModel::kRadialFisheye}) {
    if (lens == CameraModel::kRadialFisheye && !may_be_fisheye) continue;
    Reconstruction other = *best.model;
    for (const camera_t id : cameras) {
      other.cameras.at(id) = WithTwoParameters(before.at(id), lens);
    }
    FreerModel freer =
        Adjusted(context, best.graph, {cameras, false, min_deviate}, *best.model, std::move(other));
    largest_deviate = std::max(largest_deviate, freer.deviate);
    if (freer.deviate <= min_deviate) continue;
    if (chosen && freer.agreement.sharp_nats <= chosen->agreement.sharp_nats) continue;
    chosen = std::move(freer);
  }
  ModelStage stage(context, "lens_models");
  stage.Add("cameras", cameras.size());
  stage.Add("standard_errors_of_gain", largest_deviate);
  if (!chosen) return std::nullopt;
  for (const camera_t id : cameras) {
    stage.Note(LensText(before.at(id), chosen->model.cameras.at(id), chosen->deviate));
  }
  return chosen;
}

}  // namespace

bool ChooseLensModels(StageContext& context, BuiltModel& best) {
  if (!context.settings.reconstruct.choose_lens_models) return false;
  bool has_chosen = false;
  for (const bool has_exif : {false, true}) {
    const auto may_change = [&](const Camera& camera) {
      return camera.model == CameraModel::kSimpleRadial &&
             HasExif(context, camera.camera_id) == has_exif;
    };
    auto found = FindLens(context, best, CamerasWith(may_change, context, *best.model),
                          has_exif ? kDecisiveDeviate : kMinDeviate);
    if (!found) continue;
    has_chosen = true;
    best.model = std::move(found->model);
  }
  return has_chosen;
}

bool FreePrincipalPoints(StageContext& context, const ViewGraph& graph, bool is_earlier,
                         Reconstruction& model, std::vector<ResultWarning>& warnings) {
  const auto centered = [&](bool may_be_freed, int min_images = kEnoughToFind) {
    return CamerasWith(
        [&](const Camera& camera) {
          return IsCentered(camera) && MayBeFreed(context, camera) == may_be_freed;
        },
        context, model, min_images);
  };
  const std::set<camera_t> wanted = centered(true), others = centered(false);
  const size_t num_small = centered(true, 1).size() - wanted.size();
  if (num_small > 0 &&
      context.settings.reconstruct.refine_principal_points == PrincipalPointRefinement::kAll) {
    context.run.monitor.Info("principal points of " + std::to_string(num_small) +
                             " cameras stay at the image centers: fewer than " +
                             std::to_string(kEnoughToFind) + " photographs hardly tell them");
  }
  auto taken = FindPrincipalPoints(context, graph, wanted, is_earlier ? kDecisiveDeviate : kChance,
                                   true, model);
  if (taken) {
    for (const camera_t id : wanted) {
      TakePosterior(context, model.cameras.at(id), taken->deviate, taken->model.cameras.at(id));
    }
    AdjustModel(context, kIterations, taken->model);
    // Poses that fit principal points far away may not survive what is left of the way there.
    if (taken->model.images.size() < model.images.size()) taken.reset();
  }
  if (taken) {
    for (const camera_t id : wanted) context.run.monitor.Info(FoundText(id, model, *taken));
    model = std::move(taken->model);
  }
  if (model.NumObservations() <= kMaxObservationsToLook) {
    if (const auto left =
            FindPrincipalPoints(context, graph, others, kDecisiveDeviate, false, model)) {
      warnings.push_back(OffCenter(others, model, *left));
    }
  }
  return taken.has_value();
}

}  // namespace cairn
