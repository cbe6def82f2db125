#include "cairn/image/bitmap.h"

#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/rng.h"
#include "cairn/image/image_folder.h"
#include "image/codecs.h"
#include "image/image_container.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

// Blocks of color with noise: large enough that every part of a JPEG carries data.
Bitmap MakeBitmap(int width, int height, int channels) {
  Bitmap bitmap{width, height, channels, {}};
  bitmap.data.resize(static_cast<size_t>(width) * height * channels);
  Rng rng(7);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        bitmap.Pixel(x, y)[c] =
            static_cast<uint8_t>((x / 8 * 13 + y / 8 * 29 + c * 71) % 200 + rng.UniformInt(40));
      }
    }
  }
  return bitmap;
}

std::string ReasonOf(const std::string& path) {
  try {
    ReadBitmap(path, BitmapColor::kRgb);
  } catch (const IoError& error) {
    EXPECT_EQ(error.path(), path);
    return error.reason();
  }
  return "no error";
}

TEST(Bitmap, LosslessFormatsKeepEveryByte) {
  const TempFolder folder;
  for (const char* name : {"a.png", "a.bmp", "a.tif", "a.PNG"}) {
    const Bitmap rgb = MakeBitmap(37, 23, 3);
    WriteBitmap(folder / name, rgb);
    const Bitmap read = ReadBitmap(folder / name, BitmapColor::kRgb);
    EXPECT_EQ(read.width, 37);
    EXPECT_EQ(read.height, 23);
    EXPECT_EQ(read.channels, 3);
    EXPECT_EQ(read.data, rgb.data) << name;

    const Bitmap gray = MakeBitmap(37, 23, 1);
    WriteBitmap(folder / name, gray);
    EXPECT_EQ(ReadBitmap(folder / name, BitmapColor::kGray).data, gray.data) << name;
  }
}

// As undistort does, by the names of the photographs.
TEST(Bitmap, EveryFormatThatIsReadIsWritten) {
  const TempFolder folder;
  const Bitmap gray{40, 30, 1, std::vector<uint8_t>(40 * 30, 90)};
  const Bitmap rgb{40, 30, 3, std::vector<uint8_t>(3 * 40 * 30, 90)};
  for (const char* extension :
       {"jpg", "jpeg", "jpe", "jfif", "png", "tif", "tiff", "bmp", "ppm", "pgm", "pnm", "webp"}) {
    const std::string path = folder / (std::string("a.") + extension);
    WriteBitmap(path, rgb);
    EXPECT_EQ(ReadBitmap(path, BitmapColor::kGray).data, gray.data) << extension;
  }
  EXPECT_EQ(ListImages(folder.path()).size(), 12u);
}

TEST(Bitmap, ChannelsAreRedGreenBlue) {
  const TempFolder folder;
  Bitmap red{16, 16, 3, std::vector<uint8_t>(16 * 16 * 3, 0)};
  for (size_t i = 0; i < red.data.size(); i += 3) red.data[i] = 250;
  WriteBitmap(folder / "red.jpg", red, 98);
  const Bitmap read = ReadBitmap(folder / "red.jpg", BitmapColor::kRgb);
  EXPECT_GT(read.Pixel(8, 8)[0], 240);
  EXPECT_LT(read.Pixel(8, 8)[1], 10);
  EXPECT_LT(read.Pixel(8, 8)[2], 10);
}

TEST(Bitmap, JpegQualityDecidesSize) {
  const TempFolder folder;
  const Bitmap bitmap = MakeBitmap(128, 96, 3);
  WriteBitmap(folder / "low.jpg", bitmap, 40);
  WriteBitmap(folder / "high.jpg", bitmap, 97);
  EXPECT_LT(2 * std::filesystem::file_size(folder / "low.jpg"),
            std::filesystem::file_size(folder / "high.jpg"));
}

TEST(Bitmap, FilesThatAreNoImagesAreNamedWithTheReason) {
  const TempFolder folder;
  EXPECT_THAT(ReasonOf(folder / "absent.jpg"), HasSubstr("No such file"));
  EXPECT_THAT(ReasonOf(folder.path()), HasSubstr("folder"));
  WriteFileAtomically(folder / "empty.jpg", "");
  EXPECT_THAT(ReasonOf(folder / "empty.jpg"), HasSubstr("empty"));
  WriteFileAtomically(folder / "text.jpg", "this is a text file, whatever its name says\n");
  EXPECT_THAT(ReasonOf(folder / "text.jpg"), HasSubstr("cannot be decoded"));
}

TEST(Bitmap, EveryTruncatedJpegAndPngIsAnError) {
  const TempFolder folder;
  for (const char* name : {"a.jpg", "a.png"}) {
    WriteBitmap(folder / name, MakeBitmap(96, 64, 3));
    const std::string bytes = ReadFile(folder / name);
    const std::string cut = folder / std::string("cut_").append(name);
    ASSERT_TRUE(InspectContainer(bytes).is_complete);
    for (size_t size = 9; size < bytes.size(); ++size) {
      ASSERT_FALSE(InspectContainer(std::string_view(bytes).substr(0, size)).is_complete)
          << name << " cut at " << size;
    }
    for (const size_t size : {1, 2, 5, 8, 20, 300, 1000}) {
      WriteFileAtomically(cut, std::string_view(bytes).substr(0, size));
      EXPECT_THROW(ReadBitmap(cut, BitmapColor::kRgb), IoError) << name << " cut at " << size;
    }
    for (const size_t missing : {1, 2, 3, 4, 5, 8, 12, 13}) {
      WriteFileAtomically(cut, std::string_view(bytes).substr(0, bytes.size() - missing));
      EXPECT_THROW(ReadBitmap(cut, BitmapColor::kRgb), IoError) << name << " without " << missing;
    }
    // A download whose rest was never written: the right size, zeros at the end.
    std::string holes = bytes;
    std::fill(holes.begin() + holes.size() / 2, holes.end(), '\0');
    WriteFileAtomically(cut, holes);
    EXPECT_THAT(ReasonOf(cut), HasSubstr("truncated")) << name;
    // Bytes after the end are no reason to refuse.
    WriteFileAtomically(cut, bytes + "trailer");
    EXPECT_EQ(ReasonOf(cut), "no error");
  }
}

// The header alone says 30000 x 30000; there are a few bytes.
TEST(Bitmap, AFileTooShortForItsSizeIsRefusedBeforeMemoryIsTaken) {
  const TempFolder folder;
  for (const char* name : {"a.jpg", "a.png"}) {
    WriteBitmap(folder / name, MakeBitmap(96, 64, 3));
    std::string bytes = ReadFile(folder / name);
    const size_t at = std::string(name) == "a.png" ? 18 : bytes.find("\xFF\xC0") + 5;
    for (const size_t position : {at, at + (name[2] == 'p' ? 4 : 2)}) {
      bytes[position] = 0x75;
      bytes[position + 1] = 0x30;
    }
    WriteFileAtomically(folder / name, bytes);
    EXPECT_EQ(ReadImageSize(folder / name), (ImageSize{30000, 30000})) << name;
    EXPECT_THAT(ReasonOf(folder / name), HasSubstr("truncated")) << name;
  }
}

TEST(Bitmap, ImagesOfTooManyPixelsAreNamed) {
  const TempFolder folder;
  WriteBitmap(folder / "a.png", MakeBitmap(96, 64, 3));
  std::string bytes = ReadFile(folder / "a.png");
  for (const size_t position : {18, 22}) bytes.replace(position, 2, "\x9C\x40");  // 40000
  WriteFileAtomically(folder / "a.png", bytes);
  try {
    ReadImageSize(folder / "a.png");
    ADD_FAILURE() << "not refused";
  } catch (const IoError& error) {
    EXPECT_THAT(error.reason(), HasSubstr("40000 x 40000 pixels; up to 2^30"));
  }
}

TEST(Bitmap, WhatPixelsDoNotDependOnIsNotLookedAt) {
  const TempFolder folder;
  const Bitmap bitmap = MakeBitmap(24, 16, 3);
  WriteBitmap(folder / "a.png", bitmap);
  std::string bytes = ReadFile(folder / "a.png");
  // A color profile of which libpng says on the error stream that it is damaged.
  bytes.insert(33, std::string("\0\0\0\x08iCCPprofile\0CRC.", 20));
  WriteFileAtomically(folder / "a.png", bytes);
  ::testing::internal::CaptureStderr();
  EXPECT_EQ(ReadBitmap(folder / "a.png", BitmapColor::kRgb).data, bitmap.data);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST(Bitmap, FormatsThatAreNotReadAreNamed) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a.gif", "GIF89a and what follows");
  EXPECT_THAT(ReasonOf(folder / "a.gif"), HasSubstr("GIF is not read"));
  using namespace std::string_literals;
  const std::string flags = "\x02\0\0\0"s, size = "\x0F\0\0\x0F\0\0"s;  // an animation, 16 x 16
  WriteFileAtomically(folder / "a.webp", "RIFF\x16\0\0\0WEBPVP8X\x0A\0\0\0"s + flags + size);
  EXPECT_THAT(ReasonOf(folder / "a.webp"), HasSubstr("animated WebP is not read"));
  WriteFileAtomically(folder / "a.jpg", std::string("\0\0\0\x18"
                                                    "ftypheic and what follows",
                                                    28));
  EXPECT_THAT(ReasonOf(folder / "a.jpg"), HasSubstr("HEIC, AVIF or a video is not read"));
}

// OpenCV's decoder of TIFF files turns them.
TEST(Bitmap, NoFormatIsTurnedByItsOrientation) {
  const TempFolder folder;
  const Bitmap bitmap = MakeBitmap(37, 23, 1);
  for (const std::string name : {"a.tif", "a.png"}) {
    for (const uint16_t orientation : {1, 3, 6}) {
      WriteBitmap(folder / name, bitmap);
      const auto image = Exiv2::ImageFactory::open(folder / name);
      image->readMetadata();
      image->exifData()["Exif.Image.Orientation"] = orientation;
      image->writeMetadata();
      const Bitmap read = ReadBitmap(folder / name, BitmapColor::kGray);
      EXPECT_EQ(read.width, 37) << name << orientation;
      EXPECT_EQ(read.data, bitmap.data) << name << orientation;
    }
  }
}

TEST(Bitmap, TiffsOfEitherOrderOfBytesAreUprightAndDamagedOnesReadOrLeft) {
  // A directory of one entry: orientation 6, one short number.
  for (const std::string order : {"II", "MM"}) {
    const auto number = [&](uint64_t value, int num_bytes) {
      std::string bytes;
      for (int i = 0; i < num_bytes; ++i) bytes += static_cast<char>(value >> 8 * i & 0xff);
      if (order == "MM") std::reverse(bytes.begin(), bytes.end());
      return bytes;
    };
    const std::string entry = number(274, 2) + number(3, 2) + number(1, 4);
    const std::string head = order + number(42, 2) + number(8, 4) + number(1, 2) + entry;
    EXPECT_EQ(UprightTiff(head + number(6, 2) + "\0\0"), head + number(1, 2) + "\0\0");
    EXPECT_EQ(UprightTiff(head), "");
    const std::string big_entry = number(274, 2) + number(3, 2) + number(1, 8);
    const std::string big = order + number(43, 2) + number(8, 2) + number(0, 2) + number(16, 8) +
                            number(1, 8) + big_entry;
    EXPECT_EQ(UprightTiff(big + number(6, 2)), big + number(1, 2));
    EXPECT_EQ(UprightTiff(order + number(42, 2) + number(0xffffffff, 4)), "");
  }
}

// Cameras of 10 and 12 bits write numbers of 16.
TEST(Bitmap, OfSixteenBitsTheUppermostInUseAreRead) {
  const TempFolder folder;
  const Bitmap bitmap = MakeBitmap(37, 23, 1);  // some value of 128 and more
  for (const int num_bits : {8, 10, 12, 16}) {
    cv::Mat wide(23, 37, CV_16U);
    for (int i = 0; i < 23 * 37; ++i) {
      wide.at<uint16_t>(i / 37, i % 37) = static_cast<uint16_t>(bitmap.data[i] << (num_bits - 8));
    }
    cv::imwrite(folder / "a.png", wide);
    EXPECT_EQ(ReadBitmap(folder / "a.png", BitmapColor::kGray).data, bitmap.data) << num_bits;
    EXPECT_EQ(ReadBitmap(folder / "a.png", BitmapColor::kRgb).Pixel(3, 4)[1], *bitmap.Pixel(3, 4));
  }
  cv::imwrite(folder / "a.tif", cv::Mat(23, 37, CV_32F, cv::Scalar(0.5)));
  EXPECT_THAT(ReasonOf(folder / "a.tif"), HasSubstr("not of 8 or 16 bits"));
}

// Of 29000 to 29000 + 8 * 255 hundredths of a degree, fewer than 16 gray levels would be left.
TEST(Bitmap, OfANarrowRangeFarAboveZeroEveryBitIsRead) {
  const TempFolder folder;
  Bitmap bitmap = MakeBitmap(37, 23, 1);
  bitmap.data.front() = 0;
  for (const int channels : {1, 3}) {
    cv::Mat wide(23, 37, CV_16UC(channels));
    for (int i = 0; i < 23 * 37; ++i) {
      for (int c = 0; c < channels; ++c) {
        wide.ptr<uint16_t>(i / 37, i % 37)[c] = static_cast<uint16_t>(29000 + 8 * bitmap.data[i]);
      }
    }
    cv::imwrite(folder / "a.png", wide);
    EXPECT_EQ(ReadBitmap(folder / "a.png", BitmapColor::kGray).data, bitmap.data) << channels;
    EXPECT_EQ(*ReadBitmap(folder / "a.png", BitmapColor::kRgb).Pixel(3, 4), *bitmap.Pixel(3, 4));
  }
  cv::imwrite(folder / "white.png", cv::Mat(23, 37, CV_16U, cv::Scalar(65535)));
  EXPECT_EQ(ReadBitmap(folder / "white.png", BitmapColor::kGray).data,
            std::vector<uint8_t>(23 * 37, 255));
}

// Numbers of objects, for one, or grays of which none is black.
TEST(Bitmap, AMaskIsBlackOnlyWhereItIsZero) {
  const TempFolder folder;
  cv::Mat wide = (cv::Mat_<uint16_t>(1, 5) << 0, 1, 300, 40000, 65535);
  cv::imwrite(folder / "wide.png", wide);
  EXPECT_THAT(ReadMask(folder / "wide.png").data, ElementsAre(0, 1, 255, 255, 255));
  cv::imwrite(folder / "gray.png", wide.colRange(3, 5));
  EXPECT_THAT(ReadMask(folder / "gray.png").data, ElementsAre(255, 255));
  WriteBitmap(folder / "narrow.png", {3, 1, 1, {0, 1, 255}});
  EXPECT_THAT(ReadMask(folder / "narrow.png").data, ElementsAre(0, 1, 255));
}

TEST(Bitmap, OpacityIsReadWhereThereIsOne) {
  const TempFolder folder;
  cv::Mat image(23, 37, CV_8UC4, cv::Scalar(10, 20, 30, 255));
  image.at<cv::Vec4b>(4, 3)[3] = 0;
  cv::imwrite(folder / "a.png", image);
  cv::imwrite(folder / "a.webp", image, {cv::IMWRITE_WEBP_QUALITY, 101});
  for (const char* name : {"a.png", "a.webp"}) {
    const auto opacity = ReadOpacity(folder / name);
    ASSERT_TRUE(opacity) << name;
    EXPECT_EQ(*opacity->Pixel(3, 4), 0);
    EXPECT_EQ(*opacity->Pixel(4, 3), 255);
  }
  for (const char* name : {"b.png", "b.jpg"}) {
    WriteBitmap(folder / name, MakeBitmap(37, 23, 3));
    EXPECT_FALSE(ReadOpacity(folder / name)) << name;
  }
}

// As programs that make PNG files small write photographs with a transparent background.
TEST(Bitmap, OpacityOfAPaletteIsRead) {
  // Two pixels of a palette of two gray levels, the first one transparent.
  constexpr uint8_t kPng[] = {
      137, 80,  78,  71,  13,  10,  26,  10,  0,  0,   0,   13,  73,  72,  68, 82,  0,  0,  0,  2,
      0,   0,   0,   1,   8,   3,   0,   0,   0,  195, 252, 143, 184, 0,   0,  0,   6,  80, 76, 84,
      69,  9,   9,   9,   200, 200, 200, 251, 80, 21,  192, 0,   0,   0,   1,  116, 82, 78, 83, 0,
      64,  230, 216, 102, 0,   0,   0,   11,  73, 68,  65,  84,  120, 156, 99, 96,  96, 4,  0,  0,
      4,   0,   2,   191, 122, 63,  74,  0,   0,  0,   0,   73,  69,  78,  68, 174, 66, 96, 130};
  const TempFolder folder;
  WriteFileAtomically(folder / "a.png", {reinterpret_cast<const char*>(kPng), sizeof(kPng)});
  const auto opacity = ReadOpacity(folder / "a.png");
  ASSERT_TRUE(opacity);
  EXPECT_THAT(opacity->data, ElementsAre(0, 255));
  EXPECT_THAT(ReadBitmap(folder / "a.png", BitmapColor::kGray).data, ElementsAre(9, 200));
}

// OpenCV decodes more formats than are read, by libraries that are not for files of strangers.
TEST(Bitmap, OtherFormatsDoNotReachTheirDecoders) {
  const TempFolder folder;
  const std::vector<uint8_t> raster = EncodeImage("a.ras", ".ras", MakeBitmap(40, 30, 3), 90);
  WriteFileAtomically(folder / "a.jpg", std::string(raster.begin(), raster.end()));
  EXPECT_THAT(ReasonOf(folder / "a.jpg"), HasSubstr("not an image"));
  // GDCM looks at this mark alone, and ends the program on a damaged file.
  for (const std::string_view begin : {"\x89PNG", "RIFF\x10\x10\x10\x10WEBP"}) {
    WriteFileAtomically(folder / "a.jpg",
                        std::string(begin) + std::string(128 - begin.size(), '\xE0') + "DICM`");
    EXPECT_THAT(ReasonOf(folder / "a.jpg"), HasSubstr("not an image"));
  }
}

TEST(Bitmap, DamagedHeadersAreReadOrRefused) {
  const TempFolder folder;
  Rng rng(3);
  for (const char* name : {"a.jpg", "a.png"}) {
    WriteBitmap(folder / name, MakeBitmap(24, 16, 3));
    const std::string bytes = ReadFile(folder / name);
    for (int i = 0; i < 5000; ++i) {
      std::string damaged = bytes;
      for (uint32_t n = 1 + rng.UniformInt(4); n > 0; --n) {
        damaged[2 + rng.UniformInt(200)] = static_cast<char>(rng.UniformInt(256));
      }
      EXPECT_NO_THROW(InspectContainer(damaged));
    }
  }
}

TEST(Bitmap, OtherTruncatedFormatsAreErrors) {
  const TempFolder folder;
  for (const char* name : {"a.bmp", "a.tif", "a.ppm"}) {
    WriteBitmap(folder / name, MakeBitmap(96, 64, 3));
    const std::string bytes = ReadFile(folder / name);
    WriteFileAtomically(folder / name, std::string_view(bytes).substr(0, bytes.size() / 2));
    EXPECT_THROW(ReadBitmap(folder / name, BitmapColor::kRgb), IoError) << name;
  }
}

TEST(Bitmap, SizeFromTheHeaderAgreesWithTheDecodedImage) {
  const TempFolder folder;
  for (const char* name : {"a.jpg", "a.png", "a.bmp", "a.ppm", "a.tif"}) {
    WriteBitmap(folder / name, MakeBitmap(61, 45, 3));
    EXPECT_EQ(ReadImageSize(folder / name), (ImageSize{61, 45})) << name;
  }
  WriteFileAtomically(folder / "text.jpg", "text");
  EXPECT_THROW(ReadImageSize(folder / "text.jpg"), IoError);
  EXPECT_THROW(ReadImageSize(folder / "absent.jpg"), IoError);
  const std::string jpeg = ReadFile(folder / "a.jpg");
  for (size_t size = 0; size < 100; size += 9) {
    WriteFileAtomically(folder / "cut.jpg", std::string_view(jpeg).substr(0, size));
    EXPECT_THROW(ReadImageSize(folder / "cut.jpg"), IoError) << size;
  }
}

TEST(Bitmap, WritingWhereNothingCanBeWrittenIsAnError) {
  const TempFolder folder;
  const Bitmap bitmap = MakeBitmap(8, 8, 1);
  EXPECT_THROW(WriteBitmap(folder / "absent/a.png", bitmap), IoError);
  EXPECT_THROW(WriteBitmap(folder / "a.nothing", bitmap), IoError);
  EXPECT_THROW(WriteBitmap(folder / "a", bitmap), IoError);
  Bitmap broken = bitmap;
  broken.data.pop_back();
  EXPECT_THROW(WriteBitmap(folder / "a.png", broken), BugError);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace cairn
