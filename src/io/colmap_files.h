#pragma once

#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// The two formats of a COLMAP model. The readers check each file by itself; colmap_model.cc checks
// what the files say about each other.
Reconstruction ReadColmapBinary(const std::string& folder);
Reconstruction ReadColmapText(const std::string& folder);
void WriteColmapBinary(const Reconstruction& reconstruction, const std::string& folder);
void WriteColmapText(const Reconstruction& reconstruction, const std::string& folder);

// As stored if of unit length to rounding, else normalized; zero if it cannot be.
Eigen::Quaterniond UnitQuaternion(const Eigen::Vector4d& wxyz);

// Adds what a reader (ByteReader, TextReader) has read; a repeated id is its error.
template <class Reader, class Id, class Value>
Value& AddNew(const Reader& reader, const char* kind, Id id, Value value,
              std::map<Id, Value>& values) {
  const auto [entry, is_new] = values.emplace(id, std::move(value));
  if (!is_new) reader.Fail(std::string(kind) + " " + std::to_string(id) + " appears twice");
  return entry->second;
}

// error_px, or -1 ("not computed") where it is not finite: a point behind a camera.
inline double StoredError(const Point3D& point) {
  return std::isfinite(point.error_px) ? point.error_px : -1.0;
}

}  // namespace cairn
