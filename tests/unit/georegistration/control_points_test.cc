// Ground control points.
#include <nlohmann/json.hpp>

#include "math/random_vectors.h"
#include "support/test.h"
#include "unit/georegistration/georegister_fixture.h"

namespace cairn {
namespace {

// Control points at points of the model, seen exactly; in the order of their ids.
class ControlPointsTest : public GeoregisterTest {
 protected:
  void SetUp() override {
    GeoregisterTest::SetUp();
    model_ = MakeSyntheticScene({.num_images = 8, .num_points = 40}).truth;
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
  EXPECT_THAT(DescribeResiduals(found)[1], HasSubstr("(check)"));
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
              AllOf(HasSubstr(" 0 control points"), HasSubstr(" 6 check points")));
}

// Few or many, exact to some centimeters: the one that is far off is found.
TEST_F(ControlPointsTest, AWrongOneIsFoundAmongAFew) {
  Rng rng(5);
  for (ControlPoint& point : points_) {
    const Eigen::Vector3d noise = GaussianVector<3>(rng);
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

TEST_F(ControlPointsTest, WhatCannotBeRightIsSaid) {
  points_.resize(8);
  EXPECT_THAT(WarningsOf(Georegister(model_, {rows_, points_})), IsEmpty());
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
  EXPECT_THAT(first_warning(other_order), HasSubstr("do not fit the model"));
  EXPECT_THAT(first_warning(larger), HasSubstr("outside of their photographs ("));
}

TEST_F(ControlPointsTest, PointsThatOnePhotographAloneShowsAreNamed) {
  std::vector<ControlPoint> points = points_;
  points[2].pixels = {*points[2].pixels.begin()};
  points[5].pixels = {{"another.jpg", {1, 2}}};
  const Georegistration found = Georegister(model_, {rows_, points});
  EXPECT_EQ(found.points.size(), points.size() - 2);
  EXPECT_THAT(WarningsOf(found).at(0).what,
              HasSubstr("only one photograph shows, not used (1): " + points[2].name));
}

TEST_F(ControlPointsTest, MeasurementsThatDoNotMeetAreNamed) {
  points_.resize(8);
  std::vector<ControlPoint> points = points_;
  points[3].pixels = {*points[3].pixels.begin(), *points[4].pixels.rbegin()};
  const Georegistration found = Georegister(model_, {rows_, points});
  EXPECT_EQ(found.points.size(), 7u);
  EXPECT_THAT(WarningsOf(found).at(0).what,
              HasSubstr("do not meet in the model, not used (1): " + points[3].name));
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

// Positions without altitudes leave heights open: those of check points are compared with nothing.
TEST_F(ControlPointsTest, WithoutAltitudesChecksAreHorizontal) {
  int index = 0;
  for (const auto& [id, image] : model_.images) {
    Place(id, truth_ * image.cam_from_world.Center() + Eigen::Vector3d(0, 0, 20 * (++index % 3)));
    GpsPosition& gps = rows_[image.image.name].position;
    gps = GpsAt(enu_[id]);
    gps.altitude_m.reset();
  }
  points_.resize(2);
  const Georegistration found = Georegister(model_, {rows_, points_});
  ASSERT_EQ(found.tilt_source, TiltSource::kPositions);
  ASSERT_EQ(found.points.size(), 2u);
  for (const GeoregisteredPoint& point : found.points) {
    EXPECT_LT(point.residual.norm(), 0.1);
    EXPECT_LT(point.error_px, 1);
  }
  EXPECT_THAT(DescribeResiduals(found)[0], Not(HasSubstr(" up")));
}

}  // namespace
}  // namespace cairn
