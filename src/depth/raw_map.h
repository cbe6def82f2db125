#pragma once

#include <string>
#include <vector>

namespace cairn {

// Values as they stand in a file, row-major, top row first.
struct RawMap {
  int width = 0;
  int height = 0;
  std::vector<float> values;
};

// `bytes` is the whole file, `path` is for error messages. Throw IoError.
RawMap ParseNpy(const std::string& path, const std::string& bytes);
RawMap ParsePfm(const std::string& path, const std::string& bytes);
RawMap ParseColmapBin(const std::string& path, const std::string& bytes);

// Checks that a map has a sane size and that `num_bytes` of data follow the header.
void CheckMapSize(const std::string& path, long long width, long long height,
                  size_t bytes_per_value, size_t num_bytes);

}  // namespace cairn
