#include <algorithm>
#include <bit>
#include <cstring>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/depth/depth_map.h"
#include "depth/raw_map.h"
#include "image/cv_bitmap.h"

namespace cairn {
namespace {

RawMap ReadPng(const std::string& path, const std::string& bytes) {
  const cv::Mat image = DecodeToMat(path, bytes, cv::IMREAD_UNCHANGED);
  if (image.channels() != 1) throw IoError(path, "has several channels; one is read");
  cv::Mat values;
  image.convertTo(values, CV_32F);
  return {image.cols, image.rows, std::vector<float>(values.begin<float>(), values.end<float>())};
}

}  // namespace

void CheckMapSize(const std::string& path, long long width, long long height,
                  size_t bytes_per_value, size_t num_bytes) {
  constexpr long long kMaxSide = 1 << 16;
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
    throw IoError(path,
                  "a map of " + std::to_string(width) + " x " + std::to_string(height) + " values");
  }
  const size_t wanted = static_cast<size_t>(width) * static_cast<size_t>(height) * bytes_per_value;
  if (num_bytes < wanted) {
    throw IoError(path, "truncated: " + std::to_string(num_bytes) + " of " +
                            std::to_string(wanted) + " bytes of data");
  }
}

RawMap ParsePfm(const std::string& path, const std::string& bytes) {
  std::istringstream stream(bytes.substr(0, 256));
  std::string magic;
  RawMap map;
  double scale = 0;
  stream >> magic;
  if (magic != "Pf") throw IoError(path, "not a .pfm file of one channel");
  if (!(stream >> map.width >> map.height >> scale) || scale == 0) {
    throw IoError(path, "wrong .pfm header");
  }
  if (stream.eof()) throw IoError(path, "wrong .pfm header");
  // One white space ends the header, or two.
  size_t begin = static_cast<size_t>(stream.tellg()) + 1;
  if (bytes.compare(begin - 1, 2, "\r\n") == 0) ++begin;
  CheckMapSize(path, map.width, map.height, 4, bytes.size() - std::min(begin, bytes.size()));
  map.values.resize(static_cast<size_t>(map.width) * map.height);
  for (int y = 0; y < map.height; ++y) {  // The bottom row comes first.
    const char* row = bytes.data() + begin + static_cast<size_t>(y) * map.width * 4;
    for (int x = 0; x < map.width; ++x) {
      uint32_t bits;
      std::memcpy(&bits, row + 4 * x, 4);
      if (scale > 0) bits = __builtin_bswap32(bits);  // Positive: big-endian.
      map.values[static_cast<size_t>(map.height - 1 - y) * map.width + x] =
          std::bit_cast<float>(bits);
    }
  }
  return map;
}

RawMap ParseColmapBin(const std::string& path, const std::string& bytes) {
  std::istringstream stream(bytes.substr(0, 64));
  RawMap map;
  int channels = 0;
  char separator1 = 0, separator2 = 0, separator3 = 0;
  stream >> map.width >> separator1 >> map.height >> separator2 >> channels >> separator3;
  if (!stream || separator1 != '&' || separator2 != '&' || separator3 != '&' || channels != 1) {
    throw IoError(path, "not a depth map of COLMAP");
  }
  const size_t begin = static_cast<size_t>(stream.tellg());
  CheckMapSize(path, map.width, map.height, 4, bytes.size() - begin);
  map.values.resize(static_cast<size_t>(map.width) * map.height);
  std::memcpy(map.values.data(), bytes.data() + begin, map.values.size() * 4);
  return map;
}

DepthMap ReadDepthMap(const std::string& path, const DepthOptions& options) {
  const std::string extension = std::filesystem::path(path).extension().string();
  const std::string bytes = ReadFile(path);
  if (bytes.empty()) throw IoError(path, "empty file");
  RawMap raw;
  if (extension == ".npy") {
    raw = ParseNpy(path, bytes);
  } else if (extension == ".pfm") {
    raw = ParsePfm(path, bytes);
  } else if (extension == ".png") {
    raw = ReadPng(path, bytes);
  } else if (extension == ".bin") {
    raw = ParseColmapBin(path, bytes);
  } else {
    throw IoError(path, "unknown kind of depth map; .npy, .pfm, .png and .bin are read");
  }
  DepthMap map = DepthMapFromValues(raw.width, raw.height, raw.values, options);
  if (map.NumValid() == 0) throw IoError(path, "the depth map has no valid value");
  return map;
}

}  // namespace cairn
