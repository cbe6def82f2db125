#include "cairn/io/gcp_file.h"

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

class GcpFileTest : public ::testing::Test {
 protected:
  std::vector<ControlPoint> Read(const std::string& text) {
    WriteFileAtomically(folder_ / "gcp_list.txt", text);
    return ReadGcpFile(folder_ / "gcp_list.txt");
  }
  std::string Message(const std::string& text) {
    return ThrownMessage<IoError>([&] { Read(text); });
  }
  TempFolder folder_;
};

TEST_F(GcpFileTest, MeasurementsOfAPointAreOne) {
  const auto points = Read(
      "# a comment\nEPSG:4326\n"
      "8.5 47.25 0 10 20.5 b.jpg corner\n8.5 47.25 0.0 11 21 a.jpg corner an extra\n\n"
      "-8.5 -47.25 300 1 2 a.jpg CHK-1\r\n"
      "8.6 47.25 300 1 2 a.jpg\n8.6 47.25 300 1 3 b.jpg\n");
  ASSERT_EQ(points.size(), 3u);
  EXPECT_EQ(points[0].name, "corner");
  EXPECT_EQ(points[0].position.latitude_deg, 47.25);
  EXPECT_EQ(points[0].position.longitude_deg, 8.5);
  EXPECT_EQ(points[0].position.altitude_m, 0.0);
  EXPECT_FALSE(points[0].is_check);
  ASSERT_EQ(points[0].pixels.size(), 2u);
  EXPECT_EQ(points[0].pixels.at("b.jpg"), Eigen::Vector2d(10.5, 21));  // as everywhere in cairn
  EXPECT_TRUE(points[1].is_check);
  EXPECT_EQ(points[1].position.latitude_deg, -47.25);
  EXPECT_EQ(points[2].name, "8.6 47.25 300");
  EXPECT_EQ(points[2].pixels.size(), 2u);
}

TEST_F(GcpFileTest, NamesBetweenTabsMayHaveBlanks) {
  const auto points = Read("WGS84\n8\t47\t5\t1\t2\tday 1/a 2.jpg \tthe corner \n");
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].name, "the corner");
  EXPECT_EQ(points[0].pixels.count("day 1/a 2.jpg"), 1u);
}

TEST_F(GcpFileTest, UtmIsReadHoweverItIsNamed) {
  const GpsPosition place = GpsFromUtm(32, false, 450000, 5200000);
  for (const char* name : {"EPSG:32632", "epsg:32632", "WGS84 UTM 32N", "wgs84 utm 32n",
                           "+proj=utm +zone=32 +ellps=WGS84 +datum=WGS84 +units=m +no_defs"}) {
    const auto points = Read(std::string(name) + "\n450000 5200000 7 1 2 a.jpg\n");
    EXPECT_EQ(points.at(0).position.latitude_deg, place.latitude_deg) << name;
    EXPECT_EQ(points.at(0).position.longitude_deg, place.longitude_deg) << name;
    EXPECT_EQ(points.at(0).position.altitude_m, 7) << name;
  }
  for (const char* name :
       {"EPSG:32732", "WGS84 UTM 32S", "+proj=utm +zone=32 +south +datum=WGS84"}) {
    EXPECT_LT(
        Read(std::string(name) + "\n450000 5200000 7 1 2 a.jpg\n").at(0).position.latitude_deg, -40)
        << name;
  }
}

TEST_F(GcpFileTest, WhatIsNoneIsNamed) {
  EXPECT_THAT(Message(""), HasSubstr("the file ends before the projection"));
  for (const char* projection :
       {"EPSG:2056", "EPSG:32661", "EPSG:326", "WGS84 UTM 0N", "WGS84 UTM 32", "WGS84 UTM 61S",
        "WGS84 UTM 3X2N", "+proj=utm +zone=32 +ellps=intl", "+proj=tmerc +datum=WGS84",
        "8.5 47 300 1 2 a.jpg"}) {
    EXPECT_THAT(Message(projection), HasSubstr(":1: '" + std::string(projection))) << projection;
  }
  for (const char* row : {"8 47 5 1 2", "8 x 5 1 2 a.jpg", "8 91 5 1 2 a.jpg", "8 47 nan 1 2 a.jpg",
                          "181 47 5 1 2 a.jpg", "8\t47\t5\t1\t2\t"}) {
    EXPECT_THAT(Message(std::string("WGS84\n") + row + "\n"), HasSubstr("is not x y z pixel_x"))
        << row;
  }
  EXPECT_THAT(Message("WGS84\n8 47 5 1 2 a.jpg p\n8 47 6 1 2 b.jpg p\n"),
              HasSubstr(":3: 'p' has other coordinates"));
  EXPECT_THAT(Message("WGS84\n8 47 5 1 2 a.jpg p\n8 47 5 1 3 a.jpg p\n"),
              HasSubstr(":3: 'p' is measured twice in a.jpg"));
  EXPECT_THROW(ReadGcpFile(folder_ / "absent.txt"), IoError);
}

}  // namespace
}  // namespace cairn
