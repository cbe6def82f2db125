// Positions of photographs.
#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "cairn/image/bitmap.h"
#include "cairn/image/exif.h"
#include "cairn/math/angles.h"
#include "math/random_vectors.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "unit/georegistration/georegister_fixture.h"

namespace cairn {
namespace {

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
    const Eigen::Vector3d error = UniformVector({{3, 6}, {-6, -3}, {-3, 3}}, rng);
    rows_[model_.images.at(id).image.name].position = GpsAt(enu + error);
  }
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_EQ(WrongOf(found), wrong);
  EXPECT_LT(LargestError(found), 0.3);
}

// Of few rows quartiles tell little: what is normal is not wrong.
TEST_F(GeoregisterTest, OfFewRowsWithNormalErrorsNoneIsWrong) {
  AddNoise(1.5);
  const std::map<std::string, GpsRow> all = rows_;
  int num_wrong = 0;
  for (const int n : {6, 8, 11}) {
    for (auto first = all.begin(); std::distance(first, all.end()) >= n; ++first) {
      rows_ = {first, std::next(first, n)};
      num_wrong += WrongOf(Georegister(model_, {rows_})).empty() ? 0 : 1;
    }
  }
  EXPECT_LE(num_wrong, 2);  // of 98 models
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

// Most are better than they say; the others are as good.
TEST_F(GeoregisterTest, NothingIsWrongWithinWhatIsStated) {
  for (const auto& [id, enu] : enu_) {
    const Eigen::Vector3d error =
        id % 5 == 0 ? Eigen::Vector3d(0.6, -0.6, 0.6) : Eigen::Vector3d::Zero();
    rows_[model_.images.at(id).image.name] = {GpsAt(enu + error), 0.5};
  }
  EXPECT_THAT(WrongOf(Georegister(model_, {rows_})), IsEmpty());
  for (auto& [name, row] : rows_) row.sigma_m = 0;
  EXPECT_THAT(WrongOf(Georegister(model_, {rows_})), Not(IsEmpty()));
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
  EXPECT_THAT(WarningsOf(found).at(0).what, StartsWith("positions without an altitude"));
  EXPECT_LT(LargestError(found), 1e-6);
}

TEST_F(GeoregisterTest, HalfOfTheAltitudesAreEnough) {
  std::set<std::string> without;
  for (auto& [name, row] : rows_) {
    if (without.size() == 20) break;
    row.position.altitude_m.reset();
    without.insert(name);
  }
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_THAT(found.without_altitude, ::testing::UnorderedElementsAreArray(without));
  EXPECT_TRUE(found.unused_altitudes.empty());
  EXPECT_LT(LargestError(found), 1e-6);
}

// A telephone among cameras without: what it knows does not cost the others their positions.
TEST_F(GeoregisterTest, AFewAltitudesAreNotUsed) {
  const std::map<std::string, GpsRow> all = rows_;
  for (const size_t num_with : {0, 1, 2, 19}) {
    rows_ = all;
    size_t left = num_with;
    for (auto& [name, row] : rows_) {
      if (left > 0) {
        --left;
      } else {
        row.position.altitude_m.reset();
      }
    }
    rows_["of another model.jpg"].position = GpsAt({0, 0, 65});
    const Georegistration found = Georegister(model_, {rows_});
    ASSERT_EQ(found.status, GeoregistrationStatus::kOk) << num_with;
    EXPECT_EQ(found.tilt_source, TiltSource::kPositions);
    EXPECT_EQ(found.images.size(), all.size());
    EXPECT_TRUE(found.without_altitude.empty());
    EXPECT_EQ(found.unused_altitudes.size(), num_with);
    EXPECT_EQ(WarningsOf(found).at(0).what.starts_with("altitudes, which most"), num_with > 0);
    for (const GeoregisteredImage& image : found.images) {
      EXPECT_FALSE(image.gps.altitude_m);
      EXPECT_LT(image.residual.norm(), 1e-2);
    }
    // At the height that the altitudes have in the middle, in place of sea level.
    EXPECT_LT(LargestError(found), 50);
  }
}

TEST_F(GeoregisterTest, WithTwoAltitudesThreePositionsAreEnough) {
  while (rows_.size() > 3) rows_.erase(std::prev(rows_.end()));
  rows_.begin()->second.position.altitude_m.reset();
  EXPECT_EQ(Georegister(model_, {rows_}).images.size(), 3u);
}

TEST_F(GeoregisterTest, ThreePositionsAreEnough) {
  const std::map<std::string, GpsRow> all = rows_;
  for (auto first = all.begin(); std::distance(first, all.end()) >= 3; ++first) {
    rows_ = {first, std::next(first, 3)};
    const Georegistration found = Georegister(model_, {rows_});
    EXPECT_EQ(found.status, GeoregistrationStatus::kOk);
    EXPECT_TRUE(WrongOf(found).empty());
    EXPECT_LT(LargestError(found), 1e-3);
  }
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

// The middle of longitudes on both sides of the 180th meridian is not on the other side of the
// Earth.
TEST_F(GeoregisterTest, UpIsUpAtTheDateLine) {
  const LocalFrame frame({-16.8, 180, 1200});
  for (auto& [id, enu] : enu_) {
    enu.x() = (id % 2 == 0 ? 1 : -1) * (10 + std::abs(enu.x()));
    Place(id, enu);
    GpsPosition& gps = rows_[model_.images.at(id).image.name].position;
    gps = GpsAt(frame, enu);
    gps.longitude_deg = std::remainder(gps.longitude_deg, 360.0);
  }
  const Georegistration found = Georegister(model_, {rows_});
  EXPECT_NEAR(std::abs(found.origin.longitude_deg), 180, 0.01);
  const Eigen::Vector3d up_in_model = truth_.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  EXPECT_GT((found.enu_from_world.rotation * up_in_model).z(), 0.9999);
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
  EXPECT_THAT(WrongOf(Georegister(model_, {rows})), IsEmpty());
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
  const TempFolder folder;
  WriteFileAtomically(folder / "gps.csv", "a.jpg,45,7\nB.jpg,45,7\n");
  const std::vector<std::string> names = {"a.jpg", "b.jpg"};
  TestMonitor monitor;
  EXPECT_EQ(ReadPositions(names, folder / "gps.csv", "", {.monitor = monitor}).size(), 1u);
  EXPECT_THAT(monitor.warnings(),
              ElementsAre(folder / "gps.csv: 1 of 2 names are of no image: B.jpg"));
}

TEST(ReadPositions, PhotographsThatCannotBeReadAreAWarning) {
  const TempFolder folder;
  WriteBitmap(folder / "a.jpg", {8, 8, 3, std::vector<uint8_t>(192)});
  WriteExif(folder / "a.jpg", {.gps = GpsPosition{46, 7}});
  CreateFolders(folder / "b.jpg");
  const std::vector<std::string> names = {"a.jpg", "b.jpg", "gone.jpg", std::string(300, 'c'),
                                          "../d.jpg"};
  TestMonitor monitor;
  const auto rows = ReadPositions(names, "", folder.path(), {.monitor = monitor});
  EXPECT_EQ(rows.size(), 1u);
  EXPECT_THAT(monitor.warnings(),
              ElementsAre(AllOf(HasSubstr("b.jpg"), HasSubstr("ccc"), HasSubstr("../d.jpg"),
                                Not(HasSubstr("gone.jpg")))));
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
