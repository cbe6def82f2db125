#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "cairn/base/error.h"
#include "cairn/math/median.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Positions of images look wrong, too, where the model bends: `with_wrong`, those count with a
// third of their residual for a standard deviation. That pulls the ends of a strip straight, and
// moves nothing that the photographs hold.
PlacePriors PriorsOf(const Georegistration& found, bool with_wrong) {
  PlacePriors priors;
  for (const GeoregisteredPoint& point : found.points) {
    if (point.is_check || point.is_wrong) continue;
    priors.points.push_back(
        {{point.enu, Eigen::Vector3d::Constant(1.0 / kControlPointSigmaM)}, point.pixels});
  }
  // The images' positions err together, by meters: control points need no help of theirs.
  if (found.by_control_points) return priors;
  for (const GeoregisteredImage& image : found.images) {
    if (image.is_wrong && !with_wrong) continue;
    const double sigma_m =
        image.is_wrong ? std::max(image.sigma_m, image.residual.norm() / 3.0) : image.sigma_m;
    Eigen::Vector3d precision = Eigen::Vector3d::Constant(1.0 / sigma_m);
    if (!image.gps.altitude_m) precision.z() = 0;
    priors.images[image.image_id] = {image.gps_enu, precision};
  }
  return priors;
}

// In the frame of the model that was moved.
CenterPrior PriorInModel(image_t image_id, const PositionPrior& prior,
                         const Sim3d& enu_from_world) {
  const Eigen::Matrix3d axes = enu_from_world.rotation.toRotationMatrix();
  const Eigen::Vector3d precision = enu_from_world.scale * prior.precision;
  return {image_id, Inverse(enu_from_world) * prior.position,
          axes.transpose() * precision.cwiseAbs2().asDiagonal() * axes};
}

// So many wrong control points are looked for one by one.
constexpr int kFewWrong = 3;

// Of those in use, the one that fits worst in a model, if it does not fit.
GeoregisteredPoint* WorstPoint(const Georegistration& after, Georegistration& tried) {
  std::map<std::string, double> errors_px;
  for (const GeoregisteredPoint& point : after.points) errors_px[point.name] = point.error_px;
  // (One whose measurements contradict each other in the model is not there.)
  const auto error_px = [&](const GeoregisteredPoint& point) {
    const auto found = errors_px.find(point.name);
    return found == errors_px.end() ? std::numeric_limits<double>::infinity() : found->second;
  };
  GeoregisteredPoint* worst = nullptr;
  for (GeoregisteredPoint& point : tried.points) {
    if (point.is_check || point.is_wrong) continue;
    if (worst == nullptr || error_px(point) > error_px(*worst)) worst = &point;
  }
  return worst != nullptr && error_px(*worst) > kDoubtfulErrorPx ? worst : nullptr;
}

Reconstruction AdjustedTo(StageContext& context, const Georegistration& found,
                          Reconstruction placed) {
  AdjustWithPriors(context, PriorsOf(found, true), placed);
  return placed;
}

// How good positions are whose precision nobody states: as good as they agree with a model that is
// adjusted to the others and to every second of them alone. With one that is adjusted to all, they
// agree too well. nullopt: too few would be left for either.
std::optional<double> HeldOutSigmaM(StageContext& context, const Georegistration& found,
                                    Reconstruction placed) {
  constexpr size_t kMinNum = 3;
  // Medians of the squared length of three normal coordinates, and of two.
  constexpr double kMedian3D = 2.366, kMedian2D = 1.386;
  PlacePriors priors = PriorsOf(found, true);
  std::vector<const GeoregisteredImage*> held_out;
  size_t num_right = 0;
  bool holds_out = false;
  for (const GeoregisteredImage& image : found.images) {
    if (image.is_wrong) continue;
    ++num_right;
    if (image.is_sigma_given || !(holds_out = !holds_out)) continue;
    held_out.push_back(&image);
    priors.images.erase(image.image_id);
  }
  if (held_out.size() < kMinNum || num_right - held_out.size() < kMinNum) return std::nullopt;
  AdjustWithPriors(context, priors, placed);
  std::vector<double> variances;
  for (const GeoregisteredImage* image : held_out) {
    const auto adjusted = placed.images.find(image->image_id);
    if (adjusted == placed.images.end()) continue;
    Eigen::Vector3d residual = adjusted->second.cam_from_world.Center() - image->gps_enu;
    if (!image->gps.altitude_m) residual.z() = 0;
    variances.push_back(residual.squaredNorm() / (image->gps.altitude_m ? kMedian3D : kMedian2D));
  }
  if (variances.empty()) return std::nullopt;
  return std::max(std::sqrt(UpperMedian(std::move(variances))), kControlPointSigmaM);
}

// A model in meters, adjusted to known positions. Where a model bends, right control points at its
// ends look wrong, too: after an adjustment to all of them, the worst one is taken out while the
// others do not fit.
Reconstruction AdjustTo(StageContext& context, const Georegistration& found,
                        const Reconstruction& placed) {
  const auto num_wrong = std::ranges::count_if(found.points, &GeoregisteredPoint::is_wrong);
  Georegistration tried = found;
  for (GeoregisteredPoint& point : tried.points) point.is_wrong = false;
  for (int k = 0; k < std::min<int64_t>(num_wrong, kFewWrong); ++k) {
    if (context.run.monitor.StopRequested()) break;
    Reconstruction adjusted = AdjustedTo(context, tried, placed);
    const Georegistration after = Georegister(adjusted, *context.scene.places, context.run);
    GeoregisteredPoint* worst = WorstPoint(after, tried);
    if (worst == nullptr && ReasonToRefuse(adjusted).empty()) return adjusted;
    if (worst == nullptr) break;
    worst->is_wrong = true;
  }
  return AdjustedTo(context, found, placed);
}

// Gives positions without a stated precision what held-out ones show, but not more than in the last
// round (sigma_m).
void SetUnstatedSigmas(StageContext& context, const Reconstruction& placed,
                       std::optional<double>& sigma_m, Georegistration& found) {
  const auto set = [&] {
    for (GeoregisteredImage& image : found.images) {
      if (!image.is_sigma_given && sigma_m) image.sigma_m = *sigma_m;
    }
  };
  if (found.by_control_points) return;
  set();
  const std::optional<double> shown_m = HeldOutSigmaM(context, found, placed);
  if (shown_m) sigma_m = std::min(sigma_m.value_or(*shown_m), *shown_m);
  set();
}

void ReportPlace(const Georegistration& found, Stage& stage) {
  double num_checks = 0, squared_m = 0;
  for (const GeoregisteredPoint& point : found.points) {
    num_checks += point.is_check;
    if (point.is_check) squared_m += point.residual.squaredNorm();
  }
  stage.Add("positions", found.images.size());
  stage.Add("control_points", found.points.size());
  stage.Add("wrong", std::ranges::count_if(found.images, &GeoregisteredImage::is_wrong) +
                         std::ranges::count_if(found.points, &GeoregisteredPoint::is_wrong));
  stage.Add("median_residual_m", found.median_residual_m);
  if (num_checks > 0) stage.Add("check_points_rms_m", std::sqrt(squared_m / num_checks));
  stage.NoteEach(DescribeResiduals(found));
}

}  // namespace

void CheckPlaceOptions(const PlaceOptions& places, const std::string& image_path,
                       const Database& database) {
  if (!places.gps_path.empty() && !places.use_gps) {
    throw ConfigError("gps_path", "is read with --use_gps 1 only");
  }
  if (places.use_gps && places.gps_path.empty() && image_path.empty() &&
      database.ReadGpsPriors().empty()) {
    throw ConfigError("use_gps",
                      "needs gps_path, image_path with photographs that have GPS, or a database "
                      "with their positions");
  }
}

std::shared_ptr<const KnownPositions> ReadPlaces(const Database& database, const SceneData& scene,
                                                 const PlaceOptions& places,
                                                 const std::string& image_path,
                                                 const RunContext& run) {
  if (!places.use_gps && places.gcp_path.empty()) return nullptr;
  KnownPositions known;
  std::vector<std::string> names;
  for (const auto& [id, image] : scene.images) names.push_back(image.name);
  if (places.use_gps && (!places.gps_path.empty() || !image_path.empty())) {
    known.images = ReadPositions(names, places.gps_path, image_path, run);
  }
  if (places.use_gps && places.gps_path.empty()) {
    for (const auto& [id, position] : database.ReadGpsPriors()) {
      const auto image = scene.images.find(id);
      if (image != scene.images.end())
        known.images.try_emplace(image->second.name, GpsRow{position});
    }
  }
  if (!places.gcp_path.empty()) {
    known.control_points = ReadControlPoints(names, places.gcp_path, run);
  }
  return std::make_shared<const KnownPositions>(std::move(known));
}

CenterPriors PriorsOfCenters(const StageContext& context,
                             const std::map<image_t, Eigen::Quaterniond>& rotations) {
  if (!context.scene.places || context.scene.places->images.empty()) return nullptr;
  return [&context, &rotations](const std::map<image_t, Eigen::Vector3d>& centers) {
    Reconstruction model;
    for (const auto& [id, center] : centers) {
      model.images[id].image = context.scene.images.at(id);
      const Eigen::Quaterniond& rotation = rotations.at(id);
      model.images[id].cam_from_world = {rotation, -(rotation * center)};
    }
    const Georegistration found =
        Georegister(model, {.images = context.scene.places->images}, context.run);
    std::vector<CenterPrior> priors;
    if (found.status != GeoregistrationStatus::kOk) return priors;
    for (const auto& [id, prior] : PriorsOf(found, false).images) {
      priors.push_back(PriorInModel(id, prior, found.enu_from_world));
    }
    return priors;
  };
}

void AdjustToPlaces(StageContext& context, Reconstruction& model) {
  const ReconstructOptions& options = context.settings.reconstruct;
  if (!context.scene.places || model.points3D.empty()) return;
  double last_residual_m = std::numeric_limits<double>::infinity();
  std::optional<double> sigma_m;  // of positions without one
  int64_t last_num_wrong = std::numeric_limits<int64_t>::max();
  for (int i = 0; i < options.max_rounds && !context.run.monitor.StopRequested(); ++i) {
    Georegistration found = Georegister(model, *context.scene.places, context.run);
    // A straighter model shows better how good the positions are, and which are wrong.
    const int64_t num_wrong = std::ranges::count_if(found.images, &GeoregisteredImage::is_wrong);
    const bool is_nearer = found.median_residual_m < (1.0 - kMinGain) * last_residual_m;
    if (found.status != GeoregistrationStatus::kOk || !(is_nearer || num_wrong < last_num_wrong)) {
      return;
    }
    last_residual_m = found.median_residual_m;
    last_num_wrong = num_wrong;
    Reconstruction placed = model;
    placed.Transform(found.enu_from_world);
    SetUnstatedSigmas(context, placed, sigma_m, found);
    Reconstruction adjusted = AdjustTo(context, found, placed);
    if (!ReasonToRefuse(adjusted).empty()) return;
    model = std::move(adjusted);
  }
}

void PlaceModels(const SceneData& scene, const RunContext& run, ReconstructResult& result) {
  if (!scene.places) return;
  for (size_t k = 0; k < result.models.size(); ++k) {
    Reconstruction& model = result.models[k];
    RunStage stage(result.report, run.monitor, "georegistration");
    stage.Add("model", k);
    Georegistration found = Georegister(model, *scene.places, run);
    for (ResultWarning& warning : WarningsOf(found)) {
      warning.what = "sparse/" + std::to_string(k) + " (" + std::to_string(model.images.size()) +
                     " images): " + warning.what;
      stage.RecordWarning(warning);
    }
    const bool is_placed = found.status == GeoregistrationStatus::kOk;
    if (is_placed) {
      model.Transform(std::exchange(found.enu_from_world, Sim3d()));  // the frame is its world now
      ReportPlace(found, stage);
    }
    result.georegistrations.push_back(is_placed ? GeoregistrationToJson(found) : "");
  }
}

}  // namespace cairn
