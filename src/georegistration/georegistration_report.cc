#include <nlohmann/json.hpp>

#include "base/text.h"
#include "cairn/georegistration/georegister.h"

namespace cairn {
namespace {

using Json = nlohmann::ordered_json;

Json ToJson(const Eigen::Vector3d& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json ToJson(const GpsPosition& gps) {
  return Json{{"latitude_deg", gps.latitude_deg},
              {"longitude_deg", gps.longitude_deg},
              {"altitude_m", gps.altitude_m ? Json(*gps.altitude_m) : Json()}};
}

}  // namespace

std::string GeoregistrationFailure(const Georegistration& georegistration) {
  switch (georegistration.status) {
    case GeoregistrationStatus::kOk:
      return "";
    case GeoregistrationStatus::kTooFewImages:
      return std::to_string(georegistration.images.size()) +
             " images of the model have a position, and it has " +
             std::to_string(georegistration.points.size()) +
             " control points; it takes three of either";
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

std::vector<std::string> DescribePoints(const Georegistration& georegistration) {
  std::vector<std::string> lines;
  for (const GeoregisteredPoint& point : georegistration.points) {
    lines.push_back("control point " + point.name +
                    Formatted(": %.3f m east, %.3f m north, %.3f m up, %.2f px, in %zu images%s",
                              point.residual.x(), point.residual.y(), point.residual.z(),
                              point.error_px, point.pixels.size(),
                              point.is_wrong   ? " (wrong: not used)"
                              : point.is_check ? " (check)"
                                               : ""));
  }
  return lines;
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
  root["median_residual_m"] = georegistration.median_residual_m;
  root["roll_sigma_deg"] = georegistration.roll_sigma_deg;
  root["without_altitude"] = georegistration.without_altitude;
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
