// Positions of photographs and control points in reconstruction: a street, which bends by itself.
#include <algorithm>
#include <fstream>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <utility>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/rng.h"
#include "cairn/geometry/gps.h"
#include "math/random_vectors.h"
#include "support/gps_at.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

constexpr double kMetersPerUnit = 10;
const LocalFrame kFrame({46.2, 7.1, 1200});

SceneOptions Street() {
  SceneOptions options;
  options.layout = CameraLayout::kStreet;
  options.num_images = 60;
  options.num_points = 3000;
  options.num_cameras = 1;
  options.image_noise_px = 0.5;
  options.camera_model = CameraModel::kSimpleRadial;
  options.radial_distortion = -0.02;
  options.descriptors = false;
  return options;
}

// The street, 270 m long, and a lens of which nothing is known: what it does to the images bends
// the street.
class PlacesTest : public ::testing::Test {
 protected:
  explicit PlacesTest(const SceneOptions& options = Street())
      : scene_(MakeScene(options, 1)), database_(MakeUnknownLens(scene_)) {}

  static Database MakeUnknownLens(const SyntheticScene& scene) {
    Database database = MakeDatabase(scene);
    Camera camera = scene.cameras.at(1);
    camera.params[3] = 0;
    camera.SetMeanFocal(1.03 * camera.MeanFocal());
    camera.has_prior_focal_length = false;
    database.WriteCamera(camera);
    return database;
  }
  // Of every image, with noise; the first num_wrong of a shuffled order are off by 20 m to 200 m.
  std::set<std::string> WriteGps(double sigma_m, int num_wrong, bool states_sigma = false) {
    Rng rng(4);
    std::vector<image_t> order;
    for (const auto& [id, image] : scene_.truth.images) order.push_back(id);
    rng.Shuffle(order);
    std::set<std::string> wrong;
    std::ofstream file(folder_ / "gps.txt");
    file << std::setprecision(17);
    for (const image_t id : order) {
      const RegisteredImage& image = scene_.truth.images.at(id);
      Eigen::Vector3d enu =
          kMetersPerUnit * image.cam_from_world.Center() + sigma_m * GaussianVector<3>(rng);
      if (static_cast<int>(wrong.size()) < num_wrong) {
        enu += RandomOfLength(20, 200, rng);
        wrong.insert(image.image.name);
      }
      const GpsPosition gps = GpsAt(kFrame, enu);
      file << image.image.name << " " << gps.latitude_deg << " " << gps.longitude_deg << " "
           << *gps.altitude_m;
      if (states_sigma) file << " " << sigma_m;
      file << "\n";
    }
    return wrong;
  }
  // Points of the scene as control points, every second of them a check; exact but for the noise of
  // the keypoints.
  // The first is said to be so many meters higher than it is.
  void WriteControlPoints(int num_points, double first_up_m = 0) {
    std::ofstream file(folder_ / "gcp_list.txt");
    file << std::setprecision(17) << "EPSG:4326\n";
    const size_t step = scene_.truth.points3D.size() / num_points;
    size_t index = 0;
    for (const auto& [id, point] : scene_.truth.points3D) {
      if (index++ % step != 0 || point.track.size() < 3) continue;
      GpsPosition gps = GpsAt(kFrame, kMetersPerUnit * point.xyz);
      *gps.altitude_m += std::exchange(first_up_m, 0);
      for (const TrackElement& element : point.track) {
        const RegisteredImage& image = scene_.truth.images.at(element.image_id);
        const Eigen::Vector2d pixel = image.points2D[element.point2D].array() - 0.5;  // ODM's
        file << gps.longitude_deg << " " << gps.latitude_deg << " " << *gps.altitude_m << " "
             << pixel.x() << " " << pixel.y() << " " << image.image.name << " "
             << ((index / step) % 2 ? "CHK-" : "P-") << id << "\n";
      }
    }
  }
  ReconstructResult Run(const PlaceOptions& places) {
    ReconstructSettings settings;
    settings.places = places;
    return Reconstruct(database_, settings);
  }
  // Largest distance of a camera from the truth, meters, after the best similarity.
  double BendM(const ReconstructResult& result) {
    EXPECT_EQ(result.models.size(), 1u);
    EXPECT_EQ(result.models[0].images.size(), scene_.truth.images.size());
    return kMetersPerUnit * CompareAligned(result.models[0], scene_.truth).center;
  }
  // The same as the model is, in its frame.
  double ErrorM(const ReconstructResult& result) {
    const auto origin = nlohmann::json::parse(result.georegistrations.at(0))["origin"];
    const LocalFrame frame(
        {origin["latitude_deg"], origin["longitude_deg"], origin["altitude_m"].get<double>()});
    double largest = 0;
    for (const auto& [id, image] : result.models[0].images) {
      const Eigen::Vector3d truth =
          kMetersPerUnit * scene_.truth.images.at(id).cam_from_world.Center();
      largest = std::max(
          largest, (image.cam_from_world.Center() - frame.FromGps(GpsAt(kFrame, truth))).norm());
    }
    return largest;
  }
  PlaceOptions Gps() const { return {true, folder_ / "gps.txt", ""}; }

  TempFolder folder_;
  const SyntheticScene scene_;
  const Database database_;
};

TEST_F(PlacesTest, GpsKeepsAStreetStraight) {
  const double bend_m = BendM(Run({}));
  WriteGps(1.0, 0);
  const ReconstructResult result = Run(Gps());
  EXPECT_EQ(Value(*FindStage(result.report, "translation_averaging"), "positions_known"),
            scene_.truth.images.size());
  EXPECT_GT(bend_m, 2);
  EXPECT_LT(BendM(result), 0.3 * bend_m);
  EXPECT_LT(ErrorM(result), 1.5);
  const auto json = nlohmann::json::parse(result.georegistrations.at(0));
  EXPECT_EQ(json["enu_from_world"]["scale"], 1.0);  // the model is in the frame
  ASSERT_EQ(result.report.warnings.size(), 1u);
  EXPECT_THAT(result.report.warnings[0].what, HasSubstr("the path is nearly straight"));
}

// What bends comes back, though at first the ends look wrong.
TEST_F(PlacesTest, PrecisePositionsAtTheEndsAreUsed) {
  WriteGps(0.02, 0, true);
  const ReconstructResult result = Run(Gps());
  const auto json = nlohmann::json::parse(result.georegistrations.at(0));
  const auto& images = json["images"];
  EXPECT_LE(std::ranges::count_if(images, [](const auto& i) { return i["is_wrong"]; }), 3);
  EXPECT_LT(ErrorM(result), 0.3);
}

// Half of the street, by a lens without distortion.
class ShortStreetTest : public PlacesTest {
 protected:
  ShortStreetTest() : PlacesTest(Short()) {}
  static SceneOptions Short() {
    SceneOptions options = Street();
    options.num_images = 30;
    options.image_noise_px = 1;
    options.radial_distortion = 0;
    return options;
  }
};

// A model that is adjusted to noisy positions again and again comes as near to them as one likes.
TEST_F(ShortStreetTest, PositionsAreAsGoodAsHeldOutOnesShow) {
  constexpr double kSigmaM = 0.05, kMedianLength = 1.54;  // of three normal coordinates
  WriteGps(kSigmaM, 0);
  const ReconstructResult result = Run(Gps());
  EXPECT_GT(Value(*FindStage(result.report, "georegistration"), "median_residual_m"),
            0.9 * kSigmaM * kMedianLength);
  const double unstated_m = BendM(result);
  WriteGps(kSigmaM, 0, true);
  EXPECT_LT(unstated_m, 1.2 * BendM(Run(Gps())));
}

TEST_F(PlacesTest, PositionsOfTheDatabaseCount) {
  Database database = MakeUnknownLens(scene_);
  for (const auto& [id, image] : scene_.truth.images) {
    database.WriteGpsPrior(id, GpsAt(kFrame, kMetersPerUnit * image.cam_from_world.Center()));
  }
  ReconstructSettings settings;
  settings.places.use_gps = true;
  EXPECT_LT(ErrorM(Reconstruct(database, settings)), 0.5);
}

TEST_F(PlacesTest, WrongPositionsDoNoHarmAndAreNamed) {
  const std::set<std::string> wrong = WriteGps(1.0, 12);
  const ReconstructResult result = Run(Gps());
  EXPECT_LT(ErrorM(result), 2.25);  // without the wrong ones, 1.5 (GpsKeepsAStreetStraight)
  std::set<std::string> named;
  const auto json = nlohmann::json::parse(result.georegistrations.at(0));
  for (const auto& image : json["images"]) {
    if (image["is_wrong"]) named.insert(image["name"]);
  }
  EXPECT_EQ(named, wrong);
  ASSERT_EQ(result.report.warnings.size(), 2u);
  EXPECT_THAT(result.report.warnings[0].what,
              HasSubstr("far from where the others put them, which hardly count (12)"));
}

TEST_F(PlacesTest, ControlPointsKeepItStraight) {
  WriteControlPoints(12);
  const ReconstructResult result = Run({.gcp_path = folder_ / "gcp_list.txt"});
  const auto json = nlohmann::json::parse(result.georegistrations.at(0));
  EXPECT_TRUE(json["by_control_points"]);
  int num_checks = 0;
  for (const auto& point : json["control_points"]) {
    const Eigen::Vector3d residual(point["residual_m"][0], point["residual_m"][1],
                                   point["residual_m"][2]);
    EXPECT_LT(residual.norm(), point["is_check"] ? 0.3 : 0.1);
    EXPECT_LT(point["error_px"], 5);
    num_checks += point["is_check"].get<bool>();
  }
  EXPECT_GE(num_checks, 4);
  EXPECT_LT(ErrorM(result), 0.8);  // at the ends, beyond the control points
}

TEST_F(PlacesTest, AWrongControlPointIsNamedThoughTheModelBends) {
  WriteControlPoints(16, 20);
  const ReconstructResult result = Run({.gcp_path = folder_ / "gcp_list.txt"});
  const auto json = nlohmann::json::parse(result.georegistrations.at(0));
  for (const auto& point : json["control_points"]) {
    EXPECT_EQ(point["is_wrong"], point == json["control_points"][0]) << point.dump();
  }
  EXPECT_LT(ErrorM(result), 1);  // less with fewer points (ControlPointsKeepItStraight)
  ASSERT_EQ(result.report.warnings.size(), 1u);
  EXPECT_THAT(result.report.warnings[0].what, HasSubstr("control point P-"));
}

TEST(Places, AModelWithoutAPlaceIsAsWithoutGps) {
  const TempFolder folder;
  const Database database = MakeDatabase(MakeScene(SmallScene(), 1));
  WriteFileAtomically(folder / "gps.txt", "image00000.jpg 46 7 1\nother.jpg 46 7 1\n");
  ReconstructSettings settings;
  const ReconstructResult without = Reconstruct(database, settings);
  settings.places = {true, folder / "gps.txt", ""};
  const ReconstructResult with = Reconstruct(database, settings);
  ASSERT_EQ(without.models.size(), 1u);
  ASSERT_EQ(with.models.size(), 1u);
  for (const auto& [id, image] : without.models[0].images) {
    EXPECT_EQ(with.models[0].images.at(id).cam_from_world.translation,
              image.cam_from_world.translation);
  }
  EXPECT_EQ(with.georegistrations, std::vector<std::string>{""});
  ASSERT_EQ(with.report.warnings.size(), 1u);
  EXPECT_THAT(with.report.warnings[0].what,
              HasSubstr("no positions were used: 1 images of the model have a position"));
}

TEST_F(PlacesTest, OptionsThatMeanNothingAreRefused) {
  EXPECT_THROW(Run({.use_gps = true}), ConfigError);
  EXPECT_THROW(Run({.gps_path = "gps.txt"}), ConfigError);
  EXPECT_THROW(Run({true, folder_ / "absent.txt", ""}), IoError);
  EXPECT_THROW(Run({.gcp_path = folder_ / "absent.txt"}), IoError);
}

}  // namespace
}  // namespace cairn
