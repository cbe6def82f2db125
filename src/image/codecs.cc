#include "image/codecs.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <iterator>
#include <limits>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/memory.h"
#include "cairn/base/error.h"
#include "image/cv_bitmap.h"
#include "image/image_container.h"

namespace cairn {
namespace {

// Copies the channels in reverse order (RGB, OpenCV's BGR) to an image of the same size.
void SwapRedBlue(const cv::Mat& from, cv::Mat to) {
  if (from.channels() == 1) return from.copyTo(to);
  constexpr int kReversed[] = {0, 2, 1, 1, 2, 0};
  cv::mixChannels(&from, 1, &to, 1, kReversed, 3);
}

// (The extended header's flags; RFC 9649, 2.7.)
bool IsAnimatedWebP(std::string_view bytes) {
  return bytes.size() > 20 && bytes.starts_with("RIFF") && bytes.substr(8, 8) == "WEBPVP8X" &&
         (bytes[20] & 2) != 0;
}

// Is it of a format that is read, by the first bytes by which OpenCV's decoder takes a file? OpenCV
// has decoders of more formats, which are not for files of strangers (src/UNTRUSTED_DATA.md).
bool IsOfReadFormat(std::string_view bytes) {
  using namespace std::string_view_literals;
  constexpr std::string_view kSignatures[] = {"\xFF\xD8\xFF"sv, "\x89PNG\r\n\x1A\n"sv, "BM"sv,
                                              "II\x2A\0"sv,     "MM\0\x2A"sv,  // TIFF and BigTIFF
                                              "II\x2B\0"sv,     "MM\0\x2B"sv};
  if (std::any_of(std::begin(kSignatures), std::end(kSignatures),
                  [&](std::string_view signature) { return bytes.starts_with(signature); })) {
    return true;
  }
  if (bytes.starts_with('P')) {
    return bytes.size() > 2 && bytes[1] >= '1' && bytes[1] <= '6' &&
           std::isspace(static_cast<unsigned char>(bytes[2]));
  }
  // A WebP file with a damaged header is offered to the other decoders, and GDCM, which ends the
  // program on damaged files, takes all with this mark at byte 128.
  return bytes.starts_with("RIFF") && bytes.size() >= 12 && bytes.substr(8, 4) == "WEBP" &&
         !IsAnimatedWebP(bytes) && (bytes.size() < 132 || bytes.substr(128, 4) != "DICM");
}

// A frequent format that is not read, by the first bytes; "": none of them.
std::string_view UnreadFormat(std::string_view bytes) {
  if (bytes.starts_with("GIF8")) return "GIF";
  if (IsAnimatedWebP(bytes)) return "animated WebP";
  if (bytes.size() >= 12 && bytes.substr(4, 4) == "ftyp") return "HEIC, AVIF or a video";
  return "";
}

// GDAL, which OpenCV registers among its codecs where they are first used, ends the program where
// memory is missing, and OpenBLAS's threads take what is left until each has its 128 MiB. Throws
// std::bad_alloc where that much is not there.
void PrepareCodecs() {
  PrepareOpenCv();
  [[maybe_unused]] static const bool are_prepared = [] {
    RequireMemory(192 << 20);
    return cv::haveImageWriter(".png");
  }();
}

int NumBits(double largest) {
  return std::max(8, static_cast<int>(std::bit_width(static_cast<unsigned>(largest))));
}

void CheckBits(const std::string& path, const cv::Mat& image) {
  if (image.depth() == CV_8U || image.depth() == CV_16U) return;
  throw IoError(path, "cannot be decoded: not of 8 or 16 bits");
}

// Cameras of 10 to 14 bits leave the upper bits of 16 empty: of those that an image uses, the eight
// uppermost. Thermal cameras write temperatures, in a narrow range far above 0: where a photograph
// needs fewer bits for what its values are more than the least one, that much of them. (One value
// all over stays.)
cv::Mat EightBits(const std::string& path, const cv::Mat& image, bool is_photograph) {
  CheckBits(path, image);
  if (image.depth() == CV_8U) return image;
  double least = 0, largest = 0;
  cv::minMaxIdx(image.reshape(1), &least, &largest);
  const bool is_narrow = least < largest && NumBits(largest - least) < NumBits(largest);
  const int black = is_photograph && is_narrow ? static_cast<int>(least) : 0;
  const int shift = NumBits(largest - black) - 8;
  cv::Mat eight(image.size(), CV_MAKETYPE(CV_8U, image.channels()));
  for (int y = 0; y < image.rows; ++y) {
    const auto* const row = image.ptr<uint16_t>(y);
    std::transform(
        row, row + image.cols * image.channels(), eight.ptr(y),
        [black, shift](uint16_t value) { return static_cast<uint8_t>((value - black) >> shift); });
  }
  return eight;
}

}  // namespace

cv::Mat DecodeToMat(const std::string& path, std::string_view bytes, int flags) {
  if (!InspectContainer(bytes).is_complete) throw IoError(path, "the image is truncated");
  if (bytes.size() > static_cast<size_t>(std::numeric_limits<int>::max())) {
    throw IoError(path, "the file has more than 2 GiB");
  }
  if (!IsOfReadFormat(bytes)) {
    const std::string_view format = UnreadFormat(bytes);
    throw IoError(path, format.empty() ? "cannot be decoded: not an image, or a damaged one"
                                       : std::string(format) + " is not read");
  }
  const std::string essential = EssentialPngChunks(bytes), upright = UprightTiff(bytes);
  if (!essential.empty()) bytes = essential;
  if (!upright.empty()) bytes = upright;
  // OpenCV wants a mutable pointer but only reads.
  const cv::Mat row(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  cv::Mat image;
  try {
    PrepareCodecs();
    image = cv::imdecode(row, flags);
  } catch (const cv::Exception& exception) {
    ThrowIfOutOfMemory(exception);
    throw IoError(path, "cannot be decoded: " + exception.err);
  }
  if (image.empty())
    throw IoError(path, "cannot be decoded: a damaged image, or not of 8 or 16 bits");
  return image;
}

Bitmap DecodeImage(const std::string& path, std::string_view bytes, BitmapColor color,
                   int reduction) {
  int flags = color == BitmapColor::kGray ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR;
  if (reduction == 2) flags |= cv::IMREAD_REDUCED_GRAYSCALE_2;
  if (reduction == 4) flags |= cv::IMREAD_REDUCED_GRAYSCALE_4;
  if (reduction == 8) flags |= cv::IMREAD_REDUCED_GRAYSCALE_8;
  flags |= cv::IMREAD_IGNORE_ORIENTATION | cv::IMREAD_ANYDEPTH;
  const cv::Mat image = EightBits(path, DecodeToMat(path, bytes, flags), /*is_photograph=*/true);
  Bitmap bitmap{image.cols, image.rows, image.channels(), {}};
  bitmap.data.resize(image.total() * image.channels());
  SwapRedBlue(image, View(bitmap));
  return bitmap;
}

Bitmap DecodeMask(const std::string& path, std::string_view bytes) {
  const cv::Mat image = DecodeToMat(
      path, bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION | cv::IMREAD_ANYDEPTH);
  CheckBits(path, image);
  Bitmap mask{image.cols, image.rows, 1, {}};
  mask.data.resize(image.total());
  cv::Mat to = View(mask);
  image.convertTo(to, CV_8U);  // 255 where it is more
  return mask;
}

bool MayHaveOpacity(std::string_view bytes) {
  if (bytes.size() < 26) return false;
  if (bytes.starts_with("\x89PNG")) return bytes[25] == 3 || bytes[25] == 4 || bytes[25] == 6;
  if (!bytes.starts_with("RIFF") || bytes.substr(8, 4) != "WEBP") return false;
  return bytes.substr(12, 4) == "VP8L" || (bytes.substr(12, 4) == "VP8X" && (bytes[20] & 16) != 0);
}

std::optional<Bitmap> DecodeOpacity(const std::string& path, std::string_view bytes) {
  const cv::Mat image =
      EightBits(path, DecodeToMat(path, bytes, cv::IMREAD_UNCHANGED), /*is_photograph=*/false);
  if (image.channels() != 4) return std::nullopt;
  Bitmap opacity{image.cols, image.rows, 1, {}};
  opacity.data.resize(image.total());
  cv::Mat to = View(opacity);
  constexpr int kAlpha[] = {3, 0};
  cv::mixChannels(&image, 1, &to, 1, kAlpha, 1);
  return opacity;
}

std::vector<uint8_t> EncodeImage(const std::string& path, const std::string& extension,
                                 const Bitmap& bitmap, int jpeg_quality, const Bitmap* opacity) {
  cv::Mat image(bitmap.height, bitmap.width, CV_8UC(bitmap.channels));
  SwapRedBlue(View(bitmap), image);
  if (opacity != nullptr && (extension == ".png" || extension == ".webp")) {
    cv::merge(std::vector<cv::Mat>{image, View(*opacity)}, image);
  }
  const bool is_gray_format = extension == ".pgm";
  if (is_gray_format && bitmap.channels == 3) cv::cvtColor(image, image, cv::COLOR_BGR2GRAY);
  std::vector<uint8_t> bytes;
  try {
    PrepareCodecs();
    if (cv::imencode(extension == ".jfif" ? ".jpg" : extension, image, bytes,
                     {cv::IMWRITE_JPEG_QUALITY, jpeg_quality})) {
      return bytes;
    }
  } catch (const cv::Exception& exception) {
    ThrowIfOutOfMemory(exception);
    throw IoError(path, "no image format has the extension '" + extension + "'");
  }
  throw IoError(path, "cannot be encoded");
}

}  // namespace cairn
