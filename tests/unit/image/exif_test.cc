#include "cairn/image/exif.h"

#include <cmath>
#include <exiv2/exiv2.hpp>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/image/bitmap.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

using Tags = std::vector<std::pair<std::string, std::string>>;

// A 120 x 80 JPEG with these tags; integers as numbers, fractions as "a/b", text as it is.
void WriteJpegWithExif(const std::string& path, const Tags& tags) {
  WriteBitmap(path, Bitmap{120, 80, 1, std::vector<uint8_t>(120 * 80, 128)});
  auto image = Exiv2::ImageFactory::open(path);
  image->readMetadata();
  for (const auto& [key, value] : tags) image->exifData()[key] = value;
  image->writeMetadata();
}

TEST(Exif, FocalFrom35mmEquivalentAsColmap) {
  const TempFolder folder;
  WriteJpegWithExif(folder / "a.jpg", {{"Exif.Photo.FocalLengthIn35mmFilm", "43"},
                                       {"Exif.Photo.FocalLength", "29/1"},
                                       {"Exif.Image.Make", "NIKON CORPORATION  "},
                                       {"Exif.Image.Model", "NIKON D60"}});
  const ExifInfo info = ReadExif(folder / "a.jpg", 1296, 1936);
  ASSERT_TRUE(info.focal_px);
  EXPECT_NEAR(*info.focal_px, 43 / 43.27 * std::hypot(1296, 1936), 1e-9);
  EXPECT_EQ(info.camera_make, "NIKON CORPORATION");
  EXPECT_EQ(info.camera_model, "NIKON D60");
}

TEST(Exif, TellsWholeSpheres) {
  const TempFolder folder;
  WriteBitmap(folder / "a.jpg", Bitmap{120, 60, 1, std::vector<uint8_t>(120 * 60, 128)});
  EXPECT_FALSE(ReadExif(folder / "a.jpg", 120, 60).is_panorama);
  const auto set_type = [&](const std::string& type) {
    auto image = Exiv2::ImageFactory::open(folder / "a.jpg");
    image->readMetadata();
    image->xmpData()["Xmp.GPano.ProjectionType"] = type;
    image->writeMetadata();
  };
  set_type("equirectangular");
  EXPECT_TRUE(ReadExif(folder / "a.jpg", 120, 60).is_panorama);
  EXPECT_FALSE(ReadExif(folder / "a.jpg", 120, 50).is_panorama);  // a part of one
  set_type("cylindrical");
  EXPECT_FALSE(ReadExif(folder / "a.jpg", 120, 60).is_panorama);
}

TEST(Exif, FocalFromMillimetersAndSensorSize) {
  const TempFolder folder;
  // A sensor 22.2 mm x 14.8 mm, 3000 x 2000 pixels at first; the file was made smaller and turned.
  Tags tags = {{"Exif.Photo.FocalLength", "50/2"},
               {"Exif.Photo.PixelXDimension", "3000"},
               {"Exif.Photo.PixelYDimension", "2000"},
               {"Exif.Photo.FocalPlaneXResolution", "300000/222"},
               {"Exif.Photo.FocalPlaneYResolution", "200000/148"},
               {"Exif.Photo.FocalPlaneResolutionUnit", "3"}};
  const double sensor_cm = 3000 / (300000.0 / 222);
  const auto expect_focal = [&](double sensor_mm) {
    WriteJpegWithExif(folder / "a.jpg", tags);
    const ExifInfo info = ReadExif(folder / "a.jpg", 1000, 1500);
    ASSERT_TRUE(info.focal_px);
    EXPECT_NEAR(*info.focal_px, 25.0 / sensor_mm * 1500, 1e-6);
  };
  expect_focal(10 * sensor_cm);
  tags.back().second = std::string("2");
  expect_focal(25.4 * sensor_cm);
  tags.back().second = std::string("4");
  expect_focal(sensor_cm);
}

TEST(Exif, FocalFromMillimetersAndTheCamerasSensor) {
  const TempFolder folder;
  const auto focal = [&](const char* make, const char* model, int width, int height) {
    WriteJpegWithExif(folder / "a.jpg", {{"Exif.Photo.FocalLength", "60/10"},
                                         {"Exif.Image.Make", make},
                                         {"Exif.Image.Model", model}});
    return ReadExif(folder / "a.jpg", width, height).focal_px.value_or(0);
  };
  // A 1/1.7" sensor, 7.44 mm x 5.58 mm by the data sheet.
  const double truth = 6.0 / 7.44 * 3648;
  EXPECT_NEAR(focal("Canon", "Canon PowerShot S90", 3648, 2736), truth, 0.01 * truth);
  EXPECT_NEAR(focal("CANON", "canon powershot s90", 2736, 3648), truth, 0.01 * truth);
  // 2736 rows of the sensor, all or some of its columns.
  EXPECT_NEAR(focal("Canon", "Canon PowerShot S90", 2736, 2736), truth, 0.01 * truth);
  // 23.6 mm x 15.8 mm; all 3872 columns, some of its rows.
  const double truth_slr = 6.0 / 23.6 * 3872;
  EXPECT_NEAR(focal("NIKON CORPORATION", "NIKON D60", 3872, 2592), truth_slr, 0.01 * truth_slr);
  EXPECT_NEAR(focal("NIKON CORPORATION", "NIKON D60", 3872, 2178), truth_slr, 0.01 * truth_slr);

  EXPECT_EQ(focal("NIKON CORPORATION", "NIKON D60 of nobody", 3872, 2592), 0);
  EXPECT_EQ(focal("", "", 3872, 2592), 0);
  // Its sensor has another crop factor for every format.
  EXPECT_EQ(focal("Panasonic", "DMC-LX3", 3648, 2736), 0);
}

// A program made the photograph smaller, and wrote its new size beside the old resolution.
TEST(Exif, ASensorThatTheCameraDoesNotHaveIsNotTaken) {
  const TempFolder folder;
  const auto focal = [&](const char* width, const char* f35) {
    WriteJpegWithExif(folder / "a.jpg", {{"Exif.Photo.FocalLength", "50/1"},
                                         {"Exif.Photo.FocalLengthIn35mmFilm", f35},
                                         {"Exif.Image.Make", "Canon"},
                                         {"Exif.Image.Model", "Canon EOS 5D Mark III"},
                                         {"Exif.Photo.PixelXDimension", width},
                                         {"Exif.Photo.PixelYDimension", "960"},
                                         {"Exif.Photo.FocalPlaneXResolution", "5760/36"},
                                         {"Exif.Photo.FocalPlaneResolutionUnit", "4"}});
    return ReadExif(folder / "a.jpg", 1440, 960).focal_px.value_or(0);
  };
  EXPECT_NEAR(focal("5760", "0"), 2000, 1);
  EXPECT_NEAR(focal("1440", "0"), 2000, 20);     // by the table of sensors
  EXPECT_NEAR(focal("5760", "65535"), 2000, 1);  // which no lens has
}

TEST(Exif, NoUsableFocalIsAbsent) {
  const TempFolder folder;
  const auto focal = [&](const Tags& tags) {
    WriteJpegWithExif(folder / "a.jpg", tags);
    return ReadExif(folder / "a.jpg", 120, 80).focal_px;
  };
  EXPECT_FALSE(focal({}));
  EXPECT_FALSE(focal({{"Exif.Photo.FocalLengthIn35mmFilm", "0"}}));
  EXPECT_FALSE(focal({{"Exif.Photo.FocalLength", "50/1"}}));  // no sensor size
  EXPECT_FALSE(focal({{"Exif.Photo.FocalLength", "0/0"},
                      {"Exif.Photo.PixelXDimension", "3000"},
                      {"Exif.Photo.PixelYDimension", "2000"},
                      {"Exif.Photo.FocalPlaneXResolution", "1/0"}}));
}

TEST(Exif, TimeByTheCamerasClock) {
  const TempFolder folder;
  const auto taken_at = [&](const Tags& tags) {
    WriteJpegWithExif(folder / "a.jpg", tags);
    return ReadExif(folder / "a.jpg", 120, 80).taken_at_s;
  };
  // date -u -d '2009-04-09 15:28:39' +%s
  const double expected = 1239290919;
  EXPECT_EQ(taken_at({{"Exif.Photo.DateTimeOriginal", "2009:04:09 15:28:39"}}), expected);
  EXPECT_EQ(taken_at({{"Exif.Photo.DateTimeOriginal", "2009:04:09 15:28:39"},
                      {"Exif.Photo.SubSecTimeOriginal", "25"}}),
            expected + 0.25);
  EXPECT_EQ(taken_at({{"Exif.Photo.DateTimeOriginal", "0000:00:00 00:00:00"},
                      {"Exif.Photo.DateTimeDigitized", "2009:04:09 15:28:39"},
                      {"Exif.Image.DateTime", "2011:04:09 15:28:39"}}),
            expected);
  EXPECT_EQ(taken_at({{"Exif.Image.DateTime", "2009:04:09 15:28:39"}}), expected);
  EXPECT_FALSE(taken_at({{"Exif.Photo.DateTimeOriginal", "0000:00:00 00:00:00"}}));
  EXPECT_FALSE(taken_at({{"Exif.Photo.DateTimeOriginal", "    :  :     :  :  "}}));
  EXPECT_FALSE(taken_at({}));
}

TEST(Exif, GpsPosition) {
  const TempFolder folder;
  const auto gps = [&](const Tags& tags) {
    WriteJpegWithExif(folder / "a.jpg", tags);
    return ReadExif(folder / "a.jpg", 120, 80).gps;
  };
  const Tags tags = {{"Exif.GPSInfo.GPSLatitude", "35/1 54/1 3600/100"},
                     {"Exif.GPSInfo.GPSLatitudeRef", "S"},
                     {"Exif.GPSInfo.GPSLongitude", "79/1 15/10 0/1"},
                     {"Exif.GPSInfo.GPSLongitudeRef", "W"},
                     {"Exif.GPSInfo.GPSAltitude", "1505/10"}};
  const std::optional<GpsPosition> found = gps(tags);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->latitude_deg, -35.91, 1e-12);
  EXPECT_NEAR(found->longitude_deg, -79.025, 1e-12);
  EXPECT_EQ(found->altitude_m, 150.5);
  EXPECT_LT(gps({tags[0], {tags[1].first, "south"}, tags[2]})->latitude_deg, 0);
  EXPECT_LT(gps({tags[0], tags[2], {tags[3].first, "w"}})->longitude_deg, 0);
  EXPECT_FALSE(gps({tags[0]}));
  // At sea level is not the same as not known.
  EXPECT_EQ(gps({tags[0], tags[2], {"Exif.GPSInfo.GPSAltitude", "0/10"}})->altitude_m, 0.0);
  EXPECT_FALSE(gps({tags[0], tags[2], {"Exif.GPSInfo.GPSAltitude", "0/0"}})->altitude_m);
  EXPECT_FALSE(gps({tags[0], tags[2]})->altitude_m);
  EXPECT_FALSE(gps({{tags[0].first, "0/1 0/1 0/1"}, {tags[2].first, "0/1 0/1 0/1"}}));
  EXPECT_FALSE(gps({{tags[0].first, "1/0 0/1 0/1"}, tags[2]}));
  EXPECT_FALSE(gps({{tags[0].first, "91/1 0/1 0/1"}, tags[2]}));
  // All bits set, as some write what they do not know.
  EXPECT_FALSE(gps({{tags[0].first, "4294967295/1 0/1 0/1"}, tags[2]}));
  EXPECT_FALSE(gps({tags[0], tags[2], {"Exif.GPSInfo.GPSAltitude", "4294967295/1"}})->altitude_m);
}

TEST(Exif, WrittenTimeAndPlaceAreRead) {
  const TempFolder folder;
  WriteJpegWithExif(folder / "a.jpg", {});
  WriteExif(folder / "a.jpg",
            {.taken_at = "2009:04:09 15:28:39", .gps = GpsPosition{48.1234567, -11.7654321, -3.5}});
  const ExifInfo info = ReadExif(folder / "a.jpg", 120, 80);
  EXPECT_EQ(info.taken_at_s, 1239290919);
  ASSERT_TRUE(info.gps);
  EXPECT_NEAR(info.gps->latitude_deg, 48.1234567, 1e-8);
  EXPECT_NEAR(info.gps->longitude_deg, -11.7654321, 1e-8);
  EXPECT_EQ(info.gps->altitude_m, -3.5);
  WriteJpegWithExif(folder / "a.jpg", {});
  WriteExif(folder / "a.jpg", {.gps = GpsPosition{48, 11}});
  EXPECT_FALSE(ReadExif(folder / "a.jpg", 120, 80).gps->altitude_m);
}

TEST(Exif, DamagedOrAbsentExifIsEmptyAndSilent) {
  const TempFolder folder;
  ::testing::internal::CaptureStderr();
  ::testing::internal::CaptureStdout();
  WriteFileAtomically(folder / "text.jpg", "no image");
  EXPECT_FALSE(ReadExif(folder / "text.jpg", 10, 10).focal_px);
  WriteJpegWithExif(folder / "a.jpg", {{"Exif.Photo.FocalLengthIn35mmFilm", "28"},
                                       {"Exif.Image.Model", "a camera with a name"}});
  const std::string bytes = ReadFile(folder / "a.jpg");
  for (size_t i = 2; i < 260 && i < bytes.size(); i += 3) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x5A);
    WriteFileAtomically(folder / "damaged.jpg", damaged);
    ReadExif(folder / "damaged.jpg", 120, 80);
    WriteFileAtomically(folder / "cut.jpg", bytes.substr(0, i));
    ReadExif(folder / "cut.jpg", 120, 80);
  }
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
}

TEST(Exif, FocalLengthsThatNoPhotographHasAreAbsent) {
  const TempFolder folder;
  const auto has_focal = [&](const char* f35) {
    WriteJpegWithExif(folder / "a.jpg", {{"Exif.Photo.FocalLengthIn35mmFilm", f35}});
    return ReadExif(folder / "a.jpg", 120, 80).focal_px.has_value();
  };
  EXPECT_FALSE(has_focal("2"));
  EXPECT_TRUE(has_focal("8"));
  EXPECT_TRUE(has_focal("800"));
  EXPECT_FALSE(has_focal("65000"));
}

TEST(Exif, ThreadsReadAtTheSameTime) {
  const TempFolder folder;
  WriteJpegWithExif(folder / "a.jpg", {{"Exif.Photo.FocalLengthIn35mmFilm", "28"}});
  auto image = Exiv2::ImageFactory::open(folder / "a.jpg");
  image->readMetadata();
  image->xmpData()["Xmp.dc.creator"] = "somebody";
  image->writeMetadata();
  std::vector<double> focals(64);
  ParallelFor(8, 64, [&](int64_t i) {
    focals[i] = ReadExif(folder / "a.jpg", 120, 80).focal_px.value_or(0);
  });
  EXPECT_THAT(focals, ::testing::Each(28 / 43.27 * std::hypot(120, 80)));
}

TEST(Exif, AbsentFileIsAnError) { EXPECT_THROW(ReadExif("/nowhere/a.jpg", 10, 10), IoError); }

}  // namespace
}  // namespace cairn
