#include <cstdio>

#include "cairn/georegistration/georegister.h"

namespace cairn {

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
      return "the positions contradict the model: half of them are far off, whatever the "
             "similarity";
  }
  return "";
}

std::vector<std::string> DescribePoints(const Georegistration& georegistration) {
  std::vector<std::string> lines;
  for (const GeoregisteredPoint& point : georegistration.points) {
    char text[160];
    std::snprintf(text, sizeof(text),
                  ": %.3f m east, %.3f m north, %.3f m up, %.2f px, in %zu images%s",
                  point.residual.x(), point.residual.y(), point.residual.z(), point.error_px,
                  point.pixels.size(),
                  point.is_wrong   ? " (wrong: not used)"
                  : point.is_check ? " (check)"
                                   : "");
    lines.push_back("control point " + point.name + text);
  }
  return lines;
}

}  // namespace cairn
