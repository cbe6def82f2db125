// Positions without altitudes.
#include <nlohmann/json.hpp>

#include "cairn/math/angles.h"
#include "support/test.h"
#include "unit/georegistration/georegister_fixture.h"

namespace cairn {
namespace {

// No position has an altitude: up and heights are of the model alone.
class OpenHeightsTest : public GeoregisterTest {
 protected:
  // The cameras at heights over their horizontal places; photographs are held level, upright or on
  // edge, look down a little, and have no altitude.
  template <class HeightOf>
  void PlaceAtHeights(const HeightOf& height_of) {
    Rng rng(7);
    for (auto& [id, enu] : enu_) {
      const double heading = rng.Uniform(0, 6), pitch = 0.4;
      const Eigen::Vector3d right(std::cos(heading), std::sin(heading), 0);
      const Eigen::Vector3d ahead(-std::sin(heading), std::cos(heading), -std::tan(pitch));
      Eigen::Matrix3d cam_from_enu;
      cam_from_enu.row(0) = right;
      cam_from_enu.row(2) = ahead.normalized();
      cam_from_enu.row(1) = cam_from_enu.row(2).cross(cam_from_enu.row(0));
      if (id % 3 == 0) cam_from_enu.row(0).swap(cam_from_enu.row(1)), cam_from_enu.row(0) *= -1;
      model_.images.at(id).cam_from_world.rotation =
          Eigen::Quaterniond(cam_from_enu) * truth_.rotation;
      enu.z() = height_of(enu);
      Place(id, enu);
      rows_[model_.images.at(id).image.name].position = GpsAt(enu);
    }
    ForgetAltitudes();
  }
  void ForgetAltitudes() {
    for (auto& [name, row] : rows_) row.position.altitude_m.reset();
  }
  // Of the model that was moved, degrees.
  double TiltDeg(const Georegistration& found) const {
    return RadToDeg(AngleBetween(
        found.enu_from_world.rotation * truth_.rotation.conjugate() * Eigen::Vector3d::UnitZ(),
        Eigen::Vector3d(0, 0, 1)));
  }
};

TEST_F(OpenHeightsTest, SlopesAreFoundAndHeightsAreNotWrong) {
  PlaceAtHeights([](const Eigen::Vector3d& enu) { return 0.3 * enu.x() + 20 * (enu.y() > 0); });
  const std::set<std::string> wrong = MakeEveryFifthWrong();
  ForgetAltitudes();
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(found.status, GeoregistrationStatus::kOk);
  EXPECT_EQ(found.tilt_source, TiltSource::kPositions);
  EXPECT_EQ(WrongOf(found), wrong);
  EXPECT_LT(TiltDeg(found), 0.1);
  EXPECT_NEAR(found.enu_from_world.scale, truth_.scale, 1e-3 * truth_.scale);
  for (const GeoregisteredImage& image : found.images) EXPECT_EQ(image.residual.z(), 0);
  for (const std::string& line : DescribeResiduals(found)) {
    EXPECT_THAT(line, Not(HasSubstr(" up ")));
  }
  EXPECT_EQ(WarningsOf(found).size(), 2u);  // of wrong positions, and of how up is found
}

// Seen from above, a plane that tilts the other way looks the same. The photographs decide.
TEST_F(OpenHeightsTest, OfTwoSlopesThePhotographsTakeTheirOwn) {
  for (const double slope : {0.4, -0.4}) {
    for (const double noise_m : {0.0, 1.5}) {
      PlaceAtHeights([&](const Eigen::Vector3d& enu) { return slope * enu.x(); });
      if (noise_m > 0) AddNoise(noise_m);
      ForgetAltitudes();
      const Georegistration found = Georegister(model_, {rows_});
      EXPECT_EQ(found.tilt_source, TiltSource::kPhotographs);
      EXPECT_LT(TiltDeg(found), noise_m > 0 ? 2 : 0.1) << slope << ", " << noise_m << " m";
      EXPECT_TRUE(WrongOf(found).empty());
      for (const GeoregisteredImage& image : found.images) {
        EXPECT_NEAR(image.sigma_m, noise_m, 0.3 * noise_m + 0.02);
      }
    }
  }
}

// Noise would tilt a level model by 9 degrees before it showed.
TEST_F(OpenHeightsTest, WithoutASignOfASlopeTheModelIsLevel) {
  PlaceAtHeights([](const Eigen::Vector3d& enu) { return enu.x() > 0 ? 1.0 : 0.0; });
  AddNoise(3);
  ForgetAltitudes();
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(found.tilt_source, TiltSource::kNothing);
  EXPECT_LT(TiltDeg(found), 0.5);
  EXPECT_TRUE(WrongOf(found).empty());
  EXPECT_EQ(WarningsOf(found).size(), 1u);
}

TEST_F(OpenHeightsTest, JsonSaysWhatTheTiltIsBy) {
  const auto json = [&] {
    return nlohmann::json::parse(GeoregistrationToJson(Georegister(model_, {rows_})));
  };
  EXPECT_EQ(json()["tilt_by"], "altitudes");
  ForgetAltitudes();
  const auto without = json();
  EXPECT_EQ(without["images"].size(), model_.images.size());
  EXPECT_EQ(without["tilt_by"], "horizontal positions");
  EXPECT_TRUE(without["origin"]["altitude_m"].is_null());
  EXPECT_TRUE(without["images"][0]["gps"]["altitude_m"].is_null());
}

}  // namespace
}  // namespace cairn
