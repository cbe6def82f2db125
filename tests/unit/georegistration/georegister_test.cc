#include "cairn/georegistration/georegister.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "support/gps_at.h"
#include "support/synthetic_reconstruction.h"
#include "support/temp_folder.h"
#include "support/test_monitor.h"

namespace cairn {
namespace {

const LocalFrame kFrame({46.2, 7.1, 1200});

GpsPosition GpsAt(const Eigen::Vector3d& enu) { return testing::GpsAt(kFrame, enu); }

// A model of 40 images in a frame of its own, and the positions of its cameras in east, north, up.
class GeoregisterTest : public ::testing::Test {
 protected:
  void SetUp() override {
    model_ = testing_support::MakeSyntheticScene({.num_images = 40, .num_points = 10}).truth;
    Rng rng(3);
    for (auto& [id, image] : model_.images) {
      Eigen::Vector3d enu(rng.Uniform(-300, 300), rng.Uniform(-200, 200), rng.Uniform(40, 90));
      Place(id, enu);
      rows_[image.image.name].position = GpsAt(enu);
    }
    truth_ = Inverse(world_from_enu_);
  }
  // Gives the image's camera this center.
  void Place(image_t id, const Eigen::Vector3d& enu) {
    enu_[id] = enu;
    Rigid3d& pose = model_.images.at(id).cam_from_world;
    pose.translation = -(pose.rotation * (world_from_enu_ * enu));
  }
  void AddNoise(double sigma_m) {
    Rng rng(5);
    for (const auto& [id, enu] : enu_) {
      const Eigen::Vector3d noise(rng.Gaussian(), rng.Gaussian(), rng.Gaussian());
      rows_[model_.images.at(id).image.name].position = GpsAt(enu + sigma_m * noise);
    }
  }
  // Moves every fifth position by some hundred meters; returns which.
  std::set<std::string> MakeEveryFifthWrong() {
    std::set<std::string> wrong;
    Rng rng(9);
    for (const auto& [id, enu] : enu_) {
      if (id % 5 != 0) continue;
      const std::string name = model_.images.at(id).image.name;
      rows_[name].position =
          GpsAt(enu + Eigen::Vector3d(rng.Uniform(20, 300), rng.Uniform(-300, 300), 5));
      wrong.insert(name);
    }
    return wrong;
  }
  static std::set<std::string> WrongOf(const Georegistration& found) {
    std::set<std::string> names;
    for (const GeoregisteredImage& image : found.images) {
      if (image.is_wrong) names.insert(image.name);
    }
    return names;
  }
  // Largest distance of a camera, moved into the frame, from the truth, meters.
  double LargestError(const Georegistration& found) {
    Reconstruction moved = model_;
    moved.Transform(found.enu_from_world);
    const LocalFrame frame(found.origin);
    double largest = 0;
    for (const auto& [id, image] : moved.images) {
      largest = std::max(largest,
                         (image.cam_from_world.Center() - frame.FromGps(GpsAt(enu_[id]))).norm());
    }
    return largest;
  }

  const Sim3d world_from_enu_{.scale = 0.013,
                              .rotation = Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(),
                              .translation = Eigen::Vector3d(3, -4, 5)};
  Sim3d truth_;
  Reconstruction model_;
  std::map<image_t, Eigen::Vector3d> enu_;
  std::map<std::string, GpsRow> rows_;
};

TEST_F(GeoregisterTest, ExactPositionsGiveTheExactFrame) {
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(found.status, GeoregistrationStatus::kOk);
  EXPECT_LT(LargestError(found), 1e-6);
  EXPECT_LT(found.median_residual_m, 1e-6);
  EXPECT_TRUE(WrongOf(found).empty());
  EXPECT_NEAR(found.enu_from_world.scale, truth_.scale, 1e-9 * truth_.scale);
}

// The axes are east, north and up: a camera moved by a meter in one of them moves along it.
TEST_F(GeoregisterTest, AxesAreEastNorthUp) {
  const GpsPosition place{46.2, 7.1, 1200};
  const auto moved = [&](double latitude, double longitude, double altitude) {
    return kFrame.FromGps({place.latitude_deg + latitude, place.longitude_deg + longitude,
                           *place.altitude_m + altitude});
  };
  EXPECT_LT(moved(0, 0, 0).norm(), 1e-9);
  EXPECT_LT((moved(0, 0, 7) - Eigen::Vector3d(0, 0, 7)).norm(), 1e-8);
  // Radii of curvature of WGS84 at 46.2 degrees (plus the altitude): N 6389279 m, M 6368657 m.
  EXPECT_NEAR(moved(0, 1e-5, 0).x(), DegToRad(1e-5) * (6389283 + 1200) * std::cos(DegToRad(46.2)),
              1e-5);
  EXPECT_NEAR(moved(1e-5, 0, 0).y(), DegToRad(1e-5) * (6368752 + 1200), 1e-4);
}

TEST_F(GeoregisterTest, WrongRowsAreFoundAndDoNotMatter) {
  const std::set<std::string> wrong = MakeEveryFifthWrong();
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(found.status, GeoregistrationStatus::kOk);
  EXPECT_EQ(WrongOf(found), wrong);
  EXPECT_LT(LargestError(found), 1e-6);
}

TEST_F(GeoregisterTest, WrongRowsAreFoundInNoise) {
  AddNoise(1.5);
  const std::set<std::string> wrong = MakeEveryFifthWrong();
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(WrongOf(found), wrong);
  EXPECT_NEAR(found.median_residual_m, 1.5 * 1.538, 0.8);
  EXPECT_LT(LargestError(found), 1.5);
}

// Seven of eleven agree within centimeters: that is not chance, though it is hardly a majority.
TEST_F(GeoregisterTest, OfFewRowsManyMayBeWrong) {
  while (model_.images.size() > 11) {
    const image_t last = model_.images.rbegin()->first;
    rows_.erase(model_.images.at(last).image.name);
    enu_.erase(last);
    model_.images.erase(last);
  }
  AddNoise(0.05);
  std::set<std::string> wrong;
  Rng rng(11);
  for (const auto& [id, enu] : enu_) {
    if (wrong.size() == 4) break;
    wrong.insert(model_.images.at(id).image.name);
    const Eigen::Vector3d error(rng.Uniform(3, 6), rng.Uniform(-6, -3), rng.Uniform(-3, 3));
    rows_[model_.images.at(id).image.name].position = GpsAt(enu + error);
  }
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(WrongOf(found), wrong);
  EXPECT_LT(LargestError(found), 0.3);
}

TEST_F(GeoregisterTest, SigmasWeigh) {
  AddNoise(20);
  for (const auto& [id, enu] : enu_) {
    GpsRow& row = rows_[model_.images.at(id).image.name];
    row.sigma_m = 20;
    if (id % 4 != 0) continue;
    row = {GpsAt(enu), 0.1};
  }
  EXPECT_LT(LargestError(Georegister(model_, {rows_})), 0.5);
}

TEST_F(GeoregisterTest, TooFewPositionsAreNoResult) {
  while (rows_.size() > 2) rows_.erase(rows_.begin());
  rows_["other.jpg"] = {};
  EXPECT_EQ(Georegister(model_, {rows_}).status, GeoregistrationStatus::kTooFewImages);
  EXPECT_EQ(Georegister(model_, {}).status, GeoregistrationStatus::kTooFewImages);
}

TEST_F(GeoregisterTest, ALineIsToldFromAStrip) {
  for (auto& [id, enu] : enu_) {
    enu = {10.0 * id, 3.0 * id, 60};
    Place(id, enu);
    rows_[model_.images.at(id).image.name].position = GpsAt(enu);
  }
  EXPECT_EQ(Georegister(model_, {rows_}).status, GeoregistrationStatus::kOnALine);
  for (auto& [id, enu] : enu_) {
    enu.y() += id % 2;  // one meter
    Place(id, enu);
  }
  AddNoise(1);
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(found.status, GeoregistrationStatus::kOk);
  EXPECT_GT(found.roll_sigma_deg, 5);
}

TEST_F(GeoregisterTest, PositionsOfAnotherPlaceDoNotAgree) {
  Rng rng(1);
  for (auto& [name, row] : rows_) {
    row.position = GpsAt({rng.Uniform(-300, 300), rng.Uniform(-300, 300), rng.Uniform(0, 300)});
  }
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(found.status, GeoregistrationStatus::kNoAgreement);
  EXPECT_THAT(WarningsOf(found).at(0).what,
              ::testing::MatchesRegex(".* are [0-9]{3} m off the model .*"));
}

TEST_F(GeoregisterTest, RowsWithoutAltitudeAreNotMixedIn) {
  rows_.begin()->second.position.altitude_m.reset();
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(found.without_altitude, std::vector<std::string>{rows_.begin()->first});
  EXPECT_LT(LargestError(found), 1e-6);
}

// A boat: what is above the sea is not all that there is.
TEST_F(GeoregisterTest, AltitudesOfZeroAreUsed) {
  for (auto& [id, enu] : enu_) {
    const std::string name = model_.images.at(id).image.name;
    GpsPosition gps = GpsAt(enu);
    gps.altitude_m = id % 3 == 0 ? 0.0 : 5.0 * (id % 7);
    rows_[name].position = gps;
    Place(id, kFrame.FromGps(gps));
  }
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(found.images.size(), model_.images.size());
  EXPECT_TRUE(found.without_altitude.empty());
  EXPECT_LT(found.median_residual_m, 1e-6);
  EXPECT_EQ(nlohmann::json::parse(GeoregistrationToJson(found))["images"][2]["gps"]["altitude_m"],
            0.0);
}

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
    EXPECT_THAT(line, ::testing::Not(::testing::HasSubstr(" up ")));
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

// Control points at points of the model, seen exactly; in the order of their ids.
class ControlPointsTest : public GeoregisterTest {
 protected:
  void SetUp() override {
    GeoregisterTest::SetUp();
    model_ = testing_support::MakeSyntheticScene({.num_images = 8, .num_points = 40}).truth;
    model_.Transform(world_from_enu_);
    for (const auto& [id, point] : model_.points3D) {
      ControlPoint& control = points_.emplace_back();
      control.name = "point " + std::to_string(id);
      control.position = GpsAt(truth_ * point.xyz);
      for (const TrackElement& element : point.track) {
        const RegisteredImage& image = model_.images.at(element.image_id);
        control.pixels[image.image.name] = image.points2D[element.point2D];
      }
    }
    rows_.clear();
  }
  std::vector<ControlPoint> points_;
};

TEST_F(ControlPointsTest, ExactPointsGiveTheExactFrameAndChecksOfZero) {
  points_[1].is_check = points_[4].is_check = true;
  points_[5].pixels = {{"another.jpg", {1, 2}}};
  const Georegistration found = Georegister(model_, {rows_, points_});
  ASSERT_EQ(found.status, GeoregistrationStatus::kOk);
  EXPECT_TRUE(found.by_control_points);
  ASSERT_EQ(found.points.size(), points_.size() - 1);
  const LocalFrame frame(found.origin);
  for (const GeoregisteredPoint& point : found.points) {
    EXPECT_LT(point.residual.norm(), 1e-6) << point.name;
    EXPECT_LT(point.error_px, 1e-6) << point.name;
    EXPECT_FALSE(point.is_wrong);
    EXPECT_EQ(point.is_check, point.name == points_[1].name || point.name == points_[4].name);
    EXPECT_LT((frame.FromGps(point.position) - point.enu).norm(), 1e-9);
  }
  const auto json = nlohmann::json::parse(GeoregistrationToJson(found));
  EXPECT_EQ(json["control_points"][1]["is_check"], true);
  EXPECT_THAT(DescribeResiduals(found)[1], ::testing::HasSubstr("(check)"));
}

TEST_F(ControlPointsTest, AWrongPointIsFoundAndACheckShowsItsError) {
  const auto moved = [&](size_t i, double up_m) {
    GpsPosition gps = points_[i].position;
    *gps.altitude_m += up_m;
    return gps;
  };
  points_[2].position = moved(2, 3);
  points_[3].position = moved(3, 0.5);
  points_[3].is_check = true;
  const Georegistration found = Georegister(model_, {rows_, points_});
  ASSERT_EQ(found.status, GeoregistrationStatus::kOk);
  for (size_t i = 0; i < found.points.size(); ++i) {
    EXPECT_EQ(found.points[i].is_wrong, i == 2);
    const double off_m = i == 2 ? -3 : i == 3 ? -0.5 : 0;
    EXPECT_LT((found.points[i].residual - Eigen::Vector3d(0, 0, off_m)).norm(), 1e-3);
    EXPECT_EQ(found.points[i].error_px > 1, off_m != 0);
  }
}

// What is counted is what is used.
TEST_F(ControlPointsTest, ChecksAloneAreTooFew) {
  points_.resize(6);
  for (ControlPoint& point : points_) point.is_check = true;
  const Georegistration found = Georegister(model_, {rows_, points_});
  EXPECT_EQ(found.status, GeoregistrationStatus::kTooFewImages);
  EXPECT_THAT(WarningsOf(found).at(0).what,
              ::testing::AllOf(::testing::HasSubstr(" 0 control points"),
                               ::testing::HasSubstr(" 6 check points")));
}

// Few or many, exact to some centimeters: the one that is far off is found.
TEST_F(ControlPointsTest, AWrongOneIsFoundAmongAFew) {
  Rng rng(5);
  for (ControlPoint& point : points_) {
    const Eigen::Vector3d noise(rng.Gaussian(), rng.Gaussian(), rng.Gaussian());
    point.position = GpsAt(kFrame.FromGps(point.position) + 0.03 * noise);
  }
  for (const size_t num_points : {5, 6, 8, 12, 20, 40}) {
    for (const double off_m : {0.0, 30.0, 500.0}) {
      std::vector<ControlPoint> points(points_.begin(), points_.begin() + num_points);
      *points[0].position.altitude_m += off_m;
      const Georegistration found = Georegister(model_, {rows_, points});
      EXPECT_EQ(found.status, GeoregistrationStatus::kOk);
      EXPECT_EQ(found.points[0].is_wrong, off_m > 0) << num_points << " points, " << off_m << " m";
      const auto num_wrong = std::ranges::count_if(found.points, &GeoregisteredPoint::is_wrong);
      EXPECT_LE(num_wrong, off_m > 0 ? 2 : 0) << num_points << " points, " << off_m << " m";
    }
  }
}

// The ends of a model that bends are not wrong, since the others do not agree any better.
TEST_F(ControlPointsTest, AFewOfABentModelAreKept) {
  for (ControlPoint& point : points_) {
    Eigen::Vector3d enu = kFrame.FromGps(point.position);
    enu.z() += 1e-4 * enu.x() * enu.x();
    point.position = GpsAt(enu);
  }
  for (const size_t num_points : {6, 8, 12}) {
    const std::vector<ControlPoint> points(points_.begin(), points_.begin() + num_points);
    const Georegistration found = Georegister(model_, {rows_, points});
    EXPECT_TRUE(std::ranges::none_of(found.points, &GeoregisteredPoint::is_wrong)) << num_points;
  }
}

// A receiver that gives each fix to three photographs: those of one fix agree best, with a scale
// near zero.
TEST_F(GeoregisterTest, FixesThatRepeatAreNotWrong) {
  AddNoise(1.5);
  std::map<std::string, GpsRow> rows;
  GpsRow fix;
  for (const auto& [name, row] : rows_) {
    if (rows.size() == 9) break;
    if (rows.size() % 3 == 0) fix = row;
    rows[name] = fix;
  }
  EXPECT_THAT(WrongOf(Georegister(model_, {rows})), ::testing::IsEmpty());
}

TEST_F(ControlPointsTest, WhatCannotBeRightIsSaid) {
  points_.resize(8);
  EXPECT_THAT(WarningsOf(Georegister(model_, {rows_, points_})), ::testing::IsEmpty());
  std::vector<ControlPoint> other_order = points_, larger = points_;
  for (ControlPoint& point : other_order) {
    point.position.latitude_deg = 46.2 + (point.position.longitude_deg - 7.1);
    point.position.longitude_deg = 7.1 + 2 * (points_[0].position.latitude_deg - 46.2);
  }
  for (ControlPoint& point : larger) {
    for (auto& [name, pixel] : point.pixels) pixel *= 10;
  }
  const auto first_warning = [&](const std::vector<ControlPoint>& points) {
    return WarningsOf(Georegister(model_, {rows_, points})).at(0).what;
  };
  EXPECT_THAT(first_warning(other_order), ::testing::HasSubstr("do not fit the model"));
  EXPECT_THAT(first_warning(larger), ::testing::HasSubstr("outside of their photographs ("));
}

// Below three, the images' positions decide, and the points are checks. Above, these are checked.
TEST_F(ControlPointsTest, TakeTheImagesPlaceWhenThereAreThree) {
  for (const auto& [id, image] : model_.images) {
    const Eigen::Vector3d enu = truth_ * image.cam_from_world.Center();
    rows_[image.image.name].position = GpsAt(enu + Eigen::Vector3d(5, 0, 0));
  }
  points_.resize(2);
  Georegistration found = Georegister(model_, {rows_, points_});
  EXPECT_FALSE(found.by_control_points);
  ASSERT_EQ(found.points.size(), 2u);
  EXPECT_TRUE(found.points[0].is_check);
  EXPECT_LT((found.points[0].residual - Eigen::Vector3d(5, 0, 0)).norm(), 1e-3);
  points_.push_back(points_[1]);
  points_[2].name = "the same again";
  EXPECT_EQ(Georegister(model_, {rows_, points_}).status, GeoregistrationStatus::kOnALine);
  SetUp();
  for (const auto& [id, image] : model_.images) {
    const Eigen::Vector3d enu = truth_ * image.cam_from_world.Center();
    rows_[image.image.name].position = GpsAt(enu + Eigen::Vector3d(5, 0, 0));
  }
  found = Georegister(model_, {rows_, points_});
  EXPECT_TRUE(found.by_control_points);
  EXPECT_LT((found.images[0].residual + Eigen::Vector3d(5, 0, 0)).norm(), 1e-3);
}

TEST_F(GeoregisterTest, SigmasAreWhatResidualsShow) {
  AddNoise(2);
  for (const GeoregisteredImage& image : Georegister(model_, {rows_}).images) {
    EXPECT_NEAR(image.sigma_m, 2, 0.5);
  }
  for (auto& [name, row] : rows_) row.sigma_m = 7;
  EXPECT_EQ(Georegister(model_, {rows_}).images[0].sigma_m, 7);
  for (auto& [name, row] : rows_) row.sigma_m = 0.1;
  EXPECT_NEAR(Georegister(model_, {rows_}).images[0].sigma_m, 2, 0.5);
}

TEST(ReadPositions, NamesOfNoImageAreAWarning) {
  const testing::TempFolder folder;
  WriteFileAtomically(folder / "gps.csv", "a.jpg,45,7\nB.jpg,45,7\n");
  const std::vector<std::string> names = {"a.jpg", "b.jpg"};
  TestMonitor monitor;
  EXPECT_EQ(ReadPositions(names, folder / "gps.csv", "", {.monitor = monitor}).size(), 1u);
  EXPECT_THAT(monitor.warnings(),
              ::testing::ElementsAre(folder / "gps.csv: 1 of 2 names are of no image: B.jpg"));
}

TEST_F(GeoregisterTest, JsonHasTheSimilarityAndEveryResidual) {
  const Georegistration found = Georegister(model_, {rows_});
  const auto json = nlohmann::json::parse(GeoregistrationToJson(found));
  EXPECT_EQ(json["images"].size(), 40u);
  EXPECT_EQ(json["enu_from_world"]["scale"], found.enu_from_world.scale);
  EXPECT_EQ(json["images"][3]["is_wrong"], false);
}

}  // namespace
}  // namespace cairn
