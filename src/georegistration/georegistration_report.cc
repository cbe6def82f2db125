#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/text.h"
#include "cairn/georegistration/georegister.h"
#include "cairn/math/median.h"

namespace cairn {
namespace {

using Json = nlohmann::ordered_json;

// A rotation about the path that is less certain than this is worth a warning.
constexpr double kLargeRollDeg = 5;

Json ToJson(const Eigen::Vector3d& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json ToJson(const GpsPosition& gps) {
  return Json{{"latitude_deg", gps.latitude_deg},
              {"longitude_deg", gps.longitude_deg},
              {"altitude_m", gps.altitude_m ? Json(*gps.altitude_m) : Json()}};
}

std::vector<std::string> WrongOf(const Georegistration& found) {
  std::vector<std::string> names;
  for (const GeoregisteredImage& image : found.images) {
    if (image.is_wrong) names.push_back(image.name);
  }
  for (const GeoregisteredPoint& point : found.points) {
    if (point.is_wrong) names.push_back("control point " + point.name);
  }
  return names;
}

constexpr NamedValue<TiltSource> kTiltSources[] = {
    {TiltSource::kAltitudes, "altitudes"},
    {TiltSource::kPositions, "horizontal positions"},
    {TiltSource::kPhotographs, "photographs held level"},
    {TiltSource::kNothing, "nothing"}};

// What a tilt without altitudes is worth; "": it is by altitudes.
std::string DoubtOf(TiltSource source) {
  const std::string which = "positions without altitudes: ";
  switch (source) {
    case TiltSource::kAltitudes:
      return "";
    case TiltSource::kPositions:
      return which + "up is by the horizontal positions alone, and less exact";
    case TiltSource::kPhotographs:
      return which +
             "the cameras are on a plane that may tilt either way; up is by the way in which more "
             "photographs are level";
    case TiltSource::kNothing:
      return which + "all photographs are taken to be at the same height; the model may be tilted";
  }
  return "";
}

// Of the control points that the similarity is by; 0: it is not by any.
double MedianPointErrorPx(const Georegistration& found) {
  std::vector<double> errors_px;
  for (const GeoregisteredPoint& point : found.points) {
    if (!point.is_check && !point.is_wrong) errors_px.push_back(point.error_px);
  }
  return errors_px.empty() ? 0 : UpperMedian(errors_px);
}

std::string TooFew(const Georegistration& found) {
  const auto num_checks = std::ranges::count_if(found.points, &GeoregisteredPoint::is_check);
  return std::to_string(found.images.size()) + " images of the model have a position, and it has " +
         std::to_string(std::ssize(found.points) - num_checks) + " control points" +
         (num_checks > 0 ? ", beside " + std::to_string(num_checks) +
                               " check points (CHK-), which only measure it"
                         : "") +
         "; it takes three of either";
}

// Why the model has no place on Earth; "": it has one.
std::string FailureOf(const Georegistration& georegistration) {
  switch (georegistration.status) {
    case GeoregistrationStatus::kOk:
      return "";
    case GeoregistrationStatus::kTooFewImages:
      return TooFew(georegistration);
    case GeoregistrationStatus::kOnALine:
      return "the positions, or the cameras, lie on a line, about which the model may turn";
    case GeoregistrationStatus::kNoAgreement:
      return Formatted(
          "by the best similarity the positions are %.3g m off the model (median), "
          "more than half their spread: they are wrong, or too imprecise for so small a "
          "scene",
          georegistration.median_residual_m);
  }
  return "";
}

}  // namespace

std::vector<ResultWarning> WarningsOf(const Georegistration& found) {
  std::vector<ResultWarning> warnings;
  const auto warn = [&](const std::string& what, const std::vector<std::string>& names,
                        const std::string& advice) {
    if (names.empty()) return;
    warnings.push_back(
        {what + " (" + std::to_string(names.size()) + "): " + FirstNames(names), advice});
  };
  warn("measurements of control points outside of their photographs", found.outside,
       "are they pixels of photographs of another size?");
  warn("control points that only one photograph shows, not used", found.shown_once,
       "measure them in others, too");
  warn("control points whose measurements do not meet in the model, not used", found.unlocated,
       "is one of their photographs another point's?");
  if (!found.by_control_points) {
    warn("positions without an altitude, which most others have, not used", found.without_altitude,
         "");
  }
  if (const std::string failure = FailureOf(found); !failure.empty()) {
    warnings.push_back({"not in meters, east, north and up, and no positions were used: " + failure,
                        "see the formats of --gps_path and --gcp_path, and the names in them"});
    return warnings;
  }
  warn("positions far from where the others put them, which hardly count", WrongOf(found),
       "georegistration.json says how far");
  if (!found.by_control_points) {
    warn("altitudes, which most positions do not have, not used", found.unused_altitudes, "");
  }
  if (const std::string doubt = DoubtOf(found.tilt_source); !doubt.empty()) {
    warnings.push_back({doubt, "give altitudes, or ground control points"});
  }
  if (const double error_px = MedianPointErrorPx(found); error_px > kDoubtfulErrorPx) {
    warnings.push_back(
        {Formatted("the control points do not fit the model: %.1f px and %.3g m (median)", error_px,
                   found.median_residual_m),
         "look for one that is wrong, coordinates in another order, or pixels of another size"});
  }
  if (found.roll_sigma_deg > kLargeRollDeg) {
    warnings.push_back(
        {Formatted("the path is nearly straight: the model may turn about it by %.0f degrees",
                   found.roll_sigma_deg),
         ""});
  }
  return warnings;
}

std::vector<std::string> DescribeResiduals(const Georegistration& georegistration) {
  std::vector<std::string> lines;
  for (const GeoregisteredImage& image : georegistration.images) {
    if (!image.is_wrong) continue;
    const Eigen::Vector3d off = -image.residual;
    lines.push_back(image.name + Formatted(": %.2f m east, %.2f m north", off.x(), off.y()) +
                    (image.gps.altitude_m ? Formatted(", %.2f m up", off.z()) : "") +
                    " of where the others put it (wrong: it hardly counts)");
  }
  for (const GeoregisteredPoint& point : georegistration.points) {
    const bool has_height = georegistration.tilt_source == TiltSource::kAltitudes;
    lines.push_back(
        "control point " + point.name +
        Formatted(": %.3f m east, %.3f m north, ", point.residual.x(), point.residual.y()) +
        (has_height ? Formatted("%.3f m up, ", point.residual.z()) : "") +
        Formatted("%.2f px, in %zu images%s", point.error_px, point.pixels.size(),
                  point.is_wrong   ? " (wrong: not used)"
                  : point.is_check ? " (check)"
                                   : ""));
  }
  return lines;
}

std::string PlaceAlone(const std::string& georegistration_json) {
  const Json root = Json::parse(georegistration_json, nullptr, /*allow_exceptions=*/false);
  Json place;
  for (const char* key : {"axes", "origin", "enu_from_world"}) {
    if (!root.is_object() || !root.contains(key)) return "";
    place[key] = root.at(key);
  }
  return place.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string GeoregistrationToJson(const Georegistration& georegistration) {
  const Sim3d& enu_from_world = georegistration.enu_from_world;
  const Eigen::Quaterniond& q = enu_from_world.rotation;
  Json root;
  root["axes"] = "x east, y north, z up, meters from the origin (WGS84)";
  root["origin"] = ToJson(georegistration.origin);
  root["enu_from_world"] = Json{{"scale", enu_from_world.scale},
                                {"rotation_wxyz", Json::array({q.w(), q.x(), q.y(), q.z()})},
                                {"translation", ToJson(enu_from_world.translation)}};
  root["by_control_points"] = georegistration.by_control_points;
  root["tilt_by"] = std::string(NameOf(kTiltSources, georegistration.tilt_source));
  root["median_residual_m"] = georegistration.median_residual_m;
  root["roll_sigma_deg"] = georegistration.roll_sigma_deg;
  root["without_altitude"] = georegistration.without_altitude;
  root["unused_altitudes"] = georegistration.unused_altitudes;
  root["images"] = Json::array();
  for (const GeoregisteredImage& image : georegistration.images) {
    root["images"].push_back(Json{{"name", image.name},
                                  {"gps", ToJson(image.gps)},
                                  {"gps_enu", ToJson(image.gps_enu)},
                                  {"residual_m", ToJson(image.residual)},
                                  {"is_wrong", image.is_wrong}});
  }
  root["control_points"] = Json::array();
  for (const GeoregisteredPoint& point : georegistration.points) {
    root["control_points"].push_back(Json{{"name", point.name},
                                          {"position", ToJson(point.position)},
                                          {"enu", ToJson(point.enu)},
                                          {"images", point.pixels.size()},
                                          {"residual_m", ToJson(point.residual)},
                                          {"error_px", point.error_px},
                                          {"is_check", point.is_check},
                                          {"is_wrong", point.is_wrong}});
  }
  return root.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace cairn
