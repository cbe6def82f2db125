#include "cairn/image/thumbnail.h"

#include <cmath>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/image/bitmap.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

// Red grows to the right, green downwards.
Bitmap Gradient(int width, int height) {
  Bitmap bitmap{width, height, 3, std::vector<uint8_t>(static_cast<size_t>(3) * width * height)};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      bitmap.Pixel(x, y)[0] = static_cast<uint8_t>(255 * x / width);
      bitmap.Pixel(x, y)[1] = static_cast<uint8_t>(255 * y / height);
    }
  }
  return bitmap;
}

TEST(ReadReducedBitmap, ReducesWhileTheLongerSideKeepsSoManyPixels) {
  const TempFolder folder;
  for (const char* name : {"a.jpg", "a.png"}) {
    WriteBitmap(folder / name, Gradient(1200, 800));
    for (const auto& [min_longer_side, width] :
         {std::pair(3000, 1200), {601, 1200}, {600, 600}, {299, 300}, {150, 150}, {10, 150}}) {
      const Bitmap read = ReadReducedBitmap(folder / name, BitmapColor::kRgb, min_longer_side);
      EXPECT_EQ(read.width, width);
      EXPECT_EQ(read.height, width * 2 / 3);
      EXPECT_NEAR(read.Pixel(width / 4, width / 3)[0], 64, 3);
      EXPECT_NEAR(read.Pixel(width / 4, width / 3)[1], 128, 3);
    }
  }
}

TEST(Thumbnail, ShowsTheWholePhotographAtEverySize) {
  const TempFolder folder;
  for (const char* name : {"a.jpg", "a.png"}) {
    WriteBitmap(folder / name, Gradient(1200, 800));
    for (const int side : {1200, 700, 500, 200, 90, 16}) {
      WriteFileAtomically(folder / "small.jpg", MakeThumbnail(folder / name, side, 90));
      const Bitmap small = ReadBitmap(folder / "small.jpg", BitmapColor::kRgb);
      EXPECT_EQ(small.width, side);
      EXPECT_NEAR(small.height, side * 2 / 3.0, 1);
      for (const double at : {0.25, 0.75}) {
        const uint8_t* pixel =
            small.Pixel(static_cast<int>(at * small.width), static_cast<int>(at * small.height));
        EXPECT_NEAR(pixel[0], 255 * at, 12) << name << " " << side;
        EXPECT_NEAR(pixel[1], 255 * at, 12);
        EXPECT_NEAR(pixel[2], 0, 12);
      }
    }
  }
}

TEST(Thumbnail, SmallPhotographsStayAsTheyAre) {
  const TempFolder folder;
  WriteBitmap(folder / "a.png", Gradient(40, 80));
  WriteFileAtomically(folder / "small.jpg", MakeThumbnail(folder / "a.png", 500, 90));
  EXPECT_EQ(ReadImageSize(folder / "small.jpg"), (ImageSize{40, 80}));
}

TEST(Thumbnail, WhatCannotBeReadIsAnIoError) {
  const TempFolder folder;
  EXPECT_THROW(MakeThumbnail(folder / "absent.jpg", 100, 90), IoError);
  WriteFileAtomically(folder / "text.jpg", "no photograph");
  EXPECT_THROW(MakeThumbnail(folder / "text.jpg", 100, 90), IoError);
}

}  // namespace
}  // namespace cairn
