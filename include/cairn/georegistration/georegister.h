#pragma once

#include <Eigen/Core>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/io/gcp_file.h"
#include "cairn/io/gps_file.h"
#include "cairn/report/run_report.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// What is known of places on Earth.
struct KnownPositions {
  std::map<std::string, GpsRow> images;  // by name
  std::vector<ControlPoint> control_points = {};
};

// Of the images with these names: by the file gps_path or, where it is "", by the EXIF of the
// photographs under image_path. Names of the file that are none of these, and photographs that
// cannot be read, are a warning. Throws IoError where the file cannot be read.
std::map<std::string, GpsRow> ReadPositions(std::span<const std::string> names,
                                            const std::string& gps_path,
                                            const std::string& image_path, const RunContext& run);

// OpenDroneMap's gcp_list.txt (see ReadGcpFile). Photographs in it that are none of these are a
// warning.
std::vector<ControlPoint> ReadControlPoints(std::span<const std::string> names,
                                            const std::string& gcp_path, const RunContext& run);

// Of a surveyed point, along each axis: no receiver is better (differential GPS, fixed), and few
// are as good.
inline constexpr double kControlPointSigmaM = 0.01;
// Control points that are farther off, on average over their measurements, do not fit the model:
// twice what measurements by hand err.
inline constexpr double kDoubtfulErrorPx = 2;

enum class GeoregistrationStatus {
  kOk,
  kTooFewImages,  // fewer than three images of the model have a position
  kOnALine,       // the cameras (or the positions) lie on a line: the model may turn about it
  kNoAgreement,   // no similarity explains more than half of the positions
};

// What decides how a model is tilted.
enum class TiltSource {
  kAltitudes,    // of positions or control points
  kPositions,    // horizontal ones alone: no altitude is used
  kPhotographs,  // these leave two tilts: the one by which the photographs are held more level
  kNothing,      // horizontal positions show none: all photographs are taken at the same height
};

// An image of the model that has a position.
struct GeoregisteredImage {
  image_t image_id = kInvalidImageId;
  std::string name;
  GpsPosition gps;          // with an altitude if it is used
  Eigen::Vector3d gps_enu;  // meters; without an altitude, at that of the origin
  // Standard deviation along each axis: as given, but not less than the residuals show; where none
  // is given, what they show.
  double sigma_m = 0;
  bool is_sigma_given = false;
  // The camera's center in the model, moved, minus gps_enu; meters. z is 0 without an altitude.
  Eigen::Vector3d residual;
  bool is_wrong = false;  // the position is too far off to be what the others make of it
};

// A control point that two images of the model or more show.
struct GeoregisteredPoint {
  std::string name;
  GpsPosition position;
  Eigen::Vector3d enu;                        // meters
  std::map<image_t, Eigen::Vector2d> pixels;  // of the images that agree on where it is
  // Where the model has it, moved, minus enu; meters. z is 0 where heights are open.
  Eigen::Vector3d residual;
  double error_px = 0;    // mean distance of its place, projected, from the measurements
  bool is_check = false;  // or one of too few control points: it has no part in the similarity
  bool is_wrong = false;
};

struct Georegistration {
  GeoregistrationStatus status = GeoregistrationStatus::kTooFewImages;
  GpsPosition origin;              // of the east-north-up frame: the medians of the positions
  Sim3d enu_from_world;            // meters
  bool by_control_points = false;  // not by the images' positions
  TiltSource tilt_source = TiltSource::kAltitudes;
  std::vector<GeoregisteredImage> images;     // in the order of their ids
  std::vector<GeoregisteredPoint> points;     // in the order of the file
  std::vector<std::string> without_altitude;  // names; their positions are not used
  std::vector<std::string> unused_altitudes;  // names; their horizontal positions are used
  // "point in photograph": measurements of control points that lie outside of the photograph.
  std::vector<std::string> outside;
  std::vector<std::string> shown_once;  // control points that one image alone of the model shows
  // Control points whose measurements contradict each other, or meet at too small an angle.
  std::vector<std::string> unlocated;
  double median_residual_m = 0;  // of what the similarity is by, without wrong rows
  // Standard deviation of the rotation about the longest axis of the cameras' path, which their
  // extent across it holds; large for a nearly straight strip.
  double roll_sigma_deg = 0;
};

// The similarity from the model to local east-north-up axes, by the control points that the model
// has, if there are three, or else by the positions of its images. Of these nearly half may be
// wrong (of those beyond the three that a similarity takes): least median of residuals
// (AlignSimilarityRobust), then weighted least squares over the rows that agree, until these stay
// the same. A row is wrong if its residual is far out by Tukey's fence: three quartile distances
// beyond the upper quartile of the rows that agree, relative to each row's sigma; but never within
// 5 cm, nor within 4.8 of the standard deviations that are given. Where at least three images of
// the model, and half of those with a position, have an altitude, positions without are not used.
// Else no altitude is, and heights are open: horizontal residuals alone count, and TiltSource says
// what the tilt is by (F test, 1 %). The frame is that of `known`, whatever the model: models of
// one collection share it.
Georegistration Georegister(const Reconstruction& model, const KnownPositions& known,
                            const RunContext& run = {});

// Why the model has no place on Earth, or what is doubtful about it.
std::vector<ResultWarning> WarningsOf(const Georegistration& georegistration);

// A line a wrong position of an image, and a line a control point: residuals, in meters and pixels.
std::vector<std::string> DescribeResiduals(const Georegistration& georegistration);

// As JSON: frame, similarity, and each image's and control point's position and residual.
std::string GeoregistrationToJson(const Georegistration& georegistration);
// Of such JSON, where on Earth the model's frame is, without residuals: for a model that goes on
// from this one; "" if it is not such JSON.
std::string PlaceAlone(const std::string& georegistration_json);

}  // namespace cairn
