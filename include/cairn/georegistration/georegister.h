#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/io/gps_file.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

enum class GeoregistrationStatus {
  kOk,
  kTooFewImages,  // fewer than three images of the model have a position
  kOnALine,       // the cameras (or the positions) lie on a line: the model may turn about it
  kNoAgreement,   // no similarity explains more than half of the positions
};

// An image of the model that has a position.
struct GeoregisteredImage {
  image_t image_id = kInvalidImageId;
  std::string name;
  GpsPosition gps;
  Eigen::Vector3d gps_enu;   // meters
  Eigen::Vector3d residual;  // the camera's center in the model, moved, minus gps_enu; meters
  bool is_wrong = false;     // the position is too far off to be what the others make of it
};

struct Georegistration {
  GeoregistrationStatus status = GeoregistrationStatus::kTooFewImages;
  GpsPosition origin;    // of the east-north-up frame: the medians of the positions
  Sim3d enu_from_world;  // meters
  std::vector<GeoregisteredImage> images;     // in the order of their ids
  std::vector<std::string> without_altitude;  // names; their positions are not used
  double median_residual_m = 0;               // of the positions that are not wrong
  // Standard deviation of the rotation about the longest axis of the cameras' path, which their
  // extent across it holds; large for a nearly straight strip.
  double roll_sigma_deg = 0;
};

// The similarity from the model to local east-north-up axes by the positions of its images, of
// which up to half may be wrong: least median of residuals (AlignSimilarityRobust), then weighted
// least squares over the rows that agree, until these stay the same. A row is wrong if its residual
// is far out by Tukey's fence: three quartile distances beyond the upper quartile of the rows that
// agree, relative to each row's sigma; but never within 5 cm.
// Where some positions have an altitude, those without are not used.
Georegistration Georegister(const Reconstruction& model, const std::map<std::string, GpsRow>& rows,
                            const RunContext& run = {});

// As JSON: frame, similarity, and each image's position and residual.
std::string GeoregistrationToJson(const Georegistration& georegistration);

}  // namespace cairn
