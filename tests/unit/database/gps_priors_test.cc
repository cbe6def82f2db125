// Positions of photographs in databases of every COLMAP.
#include "support/database_dump.h"
#include "unit/database/database_fixture.h"

namespace cairn {
namespace {

TEST_F(DatabaseTest, GpsPriorsAreThoseOfEveryColmap) {
  Database database(Path());
  WriteImages(database, 5);
  database.WriteGpsPrior(1, GpsPosition{46.5, 7.25, 500.5});
  database.WriteGpsPrior(2, GpsPosition{46.5, 7.25, {}});  // COLMAP has none without an altitude
  RunSql(Path(),
         "UPDATE images SET prior_tx = 1000, prior_ty = 2, prior_tz = 3 WHERE image_id = 3; "
         "UPDATE images SET prior_tx = 0, prior_ty = 0, prior_tz = 0 WHERE image_id = 4");
  ASSERT_EQ(database.ReadGpsPriors().size(), 1u);
  EXPECT_EQ(database.ReadGpsPriors().at(1).longitude_deg, 7.25);
  EXPECT_EQ(database.ReadGpsPriors().at(1).altitude_m, 500.5);
  // 3.10 and 4.x: little-endian doubles 45, 8 and 300; those in meters are of no place on Earth.
  const std::string position = "x'000000000080464000000000000020400000000000C07240'";
  RunSql(Path(),
         "CREATE TABLE pose_priors(image_id INTEGER, position BLOB, coordinate_system INTEGER); "
         "INSERT INTO pose_priors VALUES(4, " +
             position + ", 0), (5, " + position + ", 1)");
  ASSERT_EQ(database.ReadGpsPriors().size(), 2u);
  EXPECT_EQ(database.ReadGpsPriors().at(4).latitude_deg, 45);
  RunSql(
      Path(),
      "DROP TABLE pose_priors; CREATE TABLE pose_priors(corr_data_id INTEGER, corr_sensor_type "
      "INTEGER, position BLOB, coordinate_system INTEGER); INSERT INTO pose_priors VALUES(5, 0, " +
          position + ", 0), (4, 1, " + position + ", 0), (77, 0, " + position + ", 0)");
  ASSERT_EQ(database.ReadGpsPriors().size(), 2u);
  EXPECT_EQ(database.ReadGpsPriors().at(5).altitude_m, 300);
}

}  // namespace
}  // namespace cairn
