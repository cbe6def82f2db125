#include "cairn/io/gps_file.h"

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

class GpsFileTest : public ::testing::Test {
 protected:
  std::map<std::string, GpsRow> Read(const std::string& text) {
    WriteFileAtomically(folder_ / "gps.txt", text);
    return ReadGpsFile(folder_ / "gps.txt");
  }
  std::string Message(const std::string& text) {
    return ThrownMessage<IoError>([&] { Read(text); });
  }
  TempFolder folder_;
};

TEST_F(GpsFileTest, CommasAndBlanksSeparate) {
  const auto rows = Read(
      "# a comment\n\na.jpg ,45.5, 7 ,300,2\n"
      "day 1/b 2.jpg 45.5\t-7 300.5 \n  c.jpg -45 7 1.5 0.5\r\nd.jpg,1,2\ne.jpg 1 2\n"
      "sea.jpg,1,2,0\n");
  ASSERT_EQ(rows.size(), 6u);
  const auto values = [&](const std::string& name) {
    const GpsRow& row = rows.at(name);
    return std::vector<double>{row.position.latitude_deg, row.position.longitude_deg,
                               row.position.altitude_m.value_or(-9999), row.sigma_m};
  };
  EXPECT_THAT(values("a.jpg"), ElementsAre(45.5, 7, 300, 2));
  EXPECT_THAT(values("day 1/b 2.jpg"), ElementsAre(45.5, -7, 300.5, 0));
  EXPECT_THAT(values("c.jpg"), ElementsAre(-45, 7, 1.5, 0.5));
  EXPECT_THAT(values("d.jpg"), ElementsAre(1, 2, -9999, 0));
  EXPECT_THAT(values("e.jpg"), ElementsAre(1, 2, -9999, 0));
  EXPECT_THAT(values("sea.jpg"), ElementsAre(1, 2, 0, 0));
}

// As spreadsheets write them: in quotes, with cells that are empty.
TEST_F(GpsFileTest, QuotesAreNoPartOfNamesAndNumbers) {
  const auto rows = Read(
      "\"a, 1.jpg\",\"45.5\",\"7\",\"300\"\n\"5\"\" b.jpg\", 46,7,,\n"
      "6\" c.jpg,47,7,\n");
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows.at("a, 1.jpg").position.altitude_m, 300);
  EXPECT_EQ(rows.at("5\" b.jpg").position.latitude_deg, 46);
  EXPECT_FALSE(rows.at("5\" b.jpg").position.altitude_m);
  EXPECT_EQ(rows.at("6\" c.jpg").position.latitude_deg, 47);
  EXPECT_EQ(Read("\"name\",\"lat\",\"lon\"\n\"a.jpg\",\"1\",\"2\"\n").size(), 1u);
}

// As exiftool -csv writes them of photographs without GPS.
TEST_F(GpsFileTest, RowsOfEmptyCellsHaveNoPosition) {
  const auto rows = Read(
      "SourceFile,GPSLatitude,GPSLongitude,GPSAltitude\n"
      "a.jpg,45,7,300\nb.jpg,,,\n\"c, 1.jpg\",\"\",\"\"\n");
  EXPECT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows.at("a.jpg").position.altitude_m, 300);
}

TEST_F(GpsFileTest, RowsThatAreNoneAreNamed) {
  EXPECT_THAT(Message("a.jpg,45,7,300\nb.jpg,45\n"),
              HasSubstr("gps.txt:2: 'b.jpg,45' is not name,latitude"));
  for (const char* line : {"a.jpg,91,7", "a.jpg,45,181", "a.jpg -98.1 7"}) {
    EXPECT_THAT(Message(line), HasSubstr("'" + std::string(line) +
                                         "': its latitude or longitude is out of range"));
  }
  for (const char* line : {"a.jpg 45", "a.jpg 45 x", "a.jpg,45,7,1,-1", "a.jpg,45,7,1,1,1",
                           "a.jpg,45,,1", "nan nan nan"}) {
    EXPECT_THAT(Message(std::string("z.jpg,1,2\n") + line), HasSubstr("is not name,latitude"))
        << line;
  }
  EXPECT_THAT(Message("a.jpg,45,7\nb.jpg,45,7\na.jpg 45 8\n"),
              HasSubstr("gps.txt:3: 'a.jpg' has a position already"));
  EXPECT_THROW(ReadGpsFile(folder_ / "absent.csv"), IoError);
}

TEST_F(GpsFileTest, AHeaderIsSkipped) {
  for (const char* header : {"name,latitude,longitude,altitude",
                             "\xEF\xBB\xBFname, latitude, longitude", "name\tlatitude\tlongitude",
                             "# from a spreadsheet\nImage GPSLatitude  GPSLongitude\tsigma"}) {
    EXPECT_EQ(Read(std::string(header) + "\na.jpg,45,7,300\n").count("a.jpg"), 1u) << header;
    EXPECT_EQ(Read(std::string(header) + "\na.jpg,45,7,300\n").size(), 1u) << header;
  }
  for (const char* header :
       {"name,longitude,latitude,altitude", "Latitude,Longitude,Image", "name\tLong\tLat",
        "name,altitude,longitude,latitude", "\"name\",\"longitude\",\"latitude\"",
        "SourceFile,GPSLongitude,GPSLatitude"}) {
    EXPECT_THAT(Message(std::string(header) + "\na.jpg,45,7,300\n"),
                HasSubstr("gps.txt:1: its columns are in another order"));
  }
  // A row that lacks something is none.
  for (const char* line : {"a.jpg", "a.jpg 45", "a.jpg,45,", "a.jpg,,7"}) {
    EXPECT_THAT(Message(line), HasSubstr("is not name,latitude")) << line;
  }
}

TEST_F(GpsFileTest, NamesOfNoImageAreCountedAndNamed) {
  const auto rows = Read("a.jpg,45,7\nb.jpg,45,7\nc.JPG,45,7\n");
  const std::vector<std::string> all = {"a.jpg", "b.jpg", "c.JPG"}, some = {"c.jpg", "a.jpg"};
  EXPECT_EQ(UnknownNames(rows, all), "");
  EXPECT_EQ(UnknownNames(rows, some), "2 of 3 names are of no image: b.jpg, c.JPG");
}

}  // namespace
}  // namespace cairn
