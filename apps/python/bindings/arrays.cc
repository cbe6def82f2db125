#include "arrays.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "cairn/math/so3.h"

namespace cairn::python {
namespace {

std::string ShapeText(std::span<const py::ssize_t> shape) {
  std::string text;
  for (const py::ssize_t size : shape) {
    text += (text.empty() ? "(" : ", ") + (size < 0 ? std::string("n") : std::to_string(size));
  }
  return text + (shape.size() == 1 ? ",)" : ")");
}

}  // namespace

py::array ToArray(const std::string& name, const py::object& values) {
  py::array array = py::array::ensure(values);
  if (!array) throw ConfigError(name, "is no array");
  return array;
}

void CheckShape(const std::string& name, const py::array& array,
                std::initializer_list<py::ssize_t> shape) {
  const std::span<const py::ssize_t> given(array.shape(), static_cast<size_t>(array.ndim()));
  const auto agrees = [](py::ssize_t size, py::ssize_t expected) {
    return expected < 0 || size == expected;
  };
  if (std::equal(given.begin(), given.end(), shape.begin(), shape.end(), agrees)) return;
  if (given.size() == 1 && given[0] == 0 && *shape.begin() <= 0) return;
  throw ConfigError(name, "its shape is " + (given.empty() ? std::string("()") : ShapeText(given)) +
                              ", not " + ShapeText({shape.begin(), shape.size()}));
}

void CheckPositive(const std::string& name, double value) {
  if (!(value > 0) || !std::isfinite(value)) throw ConfigError(name, "is not positive and finite");
}

void CheckSize(const std::string& name, size_t size, size_t expected) {
  if (size == expected) return;
  throw ConfigError(name,
                    "there are " + std::to_string(size) + ", not " + std::to_string(expected));
}

std::vector<uint32_t> ToIndices(const std::string& name, const py::object& values, int num_columns,
                                uint64_t limit) {
  const py::array array = ToArray(name, values);
  if (num_columns == 1) {
    CheckShape(name, array, {-1});
  } else {
    CheckShape(name, array, {-1, num_columns});
  }
  const char kind = array.dtype().kind();
  if (array.size() > 0 && kind != 'i' && kind != 'u') {
    throw ConfigError(name, "these are not whole numbers");
  }
  const Array<int64_t> wide(array);
  std::vector<uint32_t> indices(static_cast<size_t>(wide.size()));
  for (size_t i = 0; i < indices.size(); ++i) {
    const int64_t value = wide.data()[i];
    if (value < 0 || static_cast<uint64_t>(value) >= limit) {
      throw ConfigError(name,
                        std::to_string(value) + " is not from 0 to " + std::to_string(limit - 1));
    }
    indices[i] = static_cast<uint32_t>(value);
  }
  return indices;
}

std::vector<std::pair<image_t, image_t>> ToPairs(const py::object& values) {
  const std::vector<uint32_t> ids = ToIndices("pairs", values, 2, kMaxNumImages);
  std::vector<std::pair<image_t, image_t>> pairs(ids.size() / 2);
  for (size_t i = 0; i < pairs.size(); ++i) {
    pairs[i] = {ids[2 * i], ids[2 * i + 1]};
    if (pairs[i].first == pairs[i].second) {
      throw ConfigError("pairs[" + std::to_string(i) + "]", "an edge from an image to itself");
    }
  }
  return pairs;
}

std::vector<Eigen::Quaterniond> ToRotations(const Array<double>& array, size_t size) {
  CheckShape("rotations", array, {static_cast<py::ssize_t>(size), 3, 3});
  std::vector<Eigen::Quaterniond> rotations;
  for (size_t i = 0; i < size; ++i) {
    using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    const auto rotation = ToRotation(RowMajor::Map(array.data() + 9 * i));
    if (!rotation) {
      throw ConfigError("rotations[" + std::to_string(i) + "]", "not a rotation matrix");
    }
    rotations.push_back(*rotation);
  }
  return rotations;
}

Points::Points(const std::string& name, const Array<double>& array) : array_(array) {
  CheckShape(name, array, {-1, 2});
  const auto size = static_cast<size_t>(array.shape(0));
  if (reinterpret_cast<uintptr_t>(array.data()) % alignof(Eigen::Vector2d) == 0) {
    span_ = {reinterpret_cast<const Eigen::Vector2d*>(array.data()), size};
    return;
  }
  for (size_t i = 0; i < size; ++i) {
    copy_.emplace_back(array.data()[2 * i], array.data()[2 * i + 1]);
  }
  span_ = copy_;
}

void CheckAllFinite(const std::string& name, std::span<const Eigen::Vector2d> points) {
  const auto wrong = std::ranges::find_if_not(points, [](const auto& p) { return p.allFinite(); });
  if (wrong == points.end()) return;
  throw ConfigError(name + "[" + std::to_string(wrong - points.begin()) + "]", "is not finite");
}

std::vector<DepthSample> ToDepthSamples(const std::string& name, const Array<float>& array) {
  CheckShape(name, array, {-1, 3});
  std::vector<DepthSample> samples(static_cast<size_t>(array.shape(0)));
  for (size_t i = 0; i < samples.size(); ++i) {
    const float* row = array.data() + 3 * i;
    if (row[0] == 0 || std::isnan(row[0]) || std::isnan(row[1]) || std::isnan(row[2])) continue;
    if (row[0] < 0 || std::isinf(row[0]) || std::isinf(row[1]) || std::isinf(row[2])) {
      throw ConfigError(name + "[" + std::to_string(i) + "]", "is negative or not finite");
    }
    samples[i] = {row[0], row[1], row[2], true};
  }
  return samples;
}

py::array_t<float> FromDepthSamples(const std::vector<DepthSample>& samples) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  std::vector<std::array<float, 3>> rows(samples.size(), {kNone, kNone, kNone});
  for (size_t i = 0; i < rows.size(); ++i) {
    const DepthSample& sample = samples[i];
    if (sample.is_valid) rows[i] = {sample.depth, sample.ddepth_dx, sample.ddepth_dy};
  }
  return MoveToArray<float, 3>(std::move(rows));
}

std::vector<Keypoint> ToKeypoints(const Array<float>& array) {
  const bool has_frames = array.ndim() == 2 && array.shape(1) == 6;
  const size_t num_columns = has_frames ? 6 : 2;
  CheckShape("keypoints", array, {-1, static_cast<py::ssize_t>(num_columns)});
  std::vector<Keypoint> keypoints(static_cast<size_t>(array.shape(0)));
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const std::span<const float> row(array.data() + i * num_columns, num_columns);
    if (!std::ranges::all_of(row, [](float value) { return std::isfinite(value); })) {
      throw ConfigError("keypoints[" + std::to_string(i) + "]", "is not finite");
    }
    keypoints[i].x = row[0];
    keypoints[i].y = row[1];
    if (has_frames) keypoints[i] = {row[0], row[1], row[2], row[3], row[4], row[5]};
  }
  return keypoints;
}

FeatureMatches ToMatches(const py::object& values) {
  const std::vector<uint32_t> indices = ToIndices("matches", values, 2);
  FeatureMatches matches(indices.size() / 2);
  for (size_t i = 0; i < matches.size(); ++i) matches[i] = {indices[2 * i], indices[2 * i + 1]};
  return matches;
}

py::str ToName(const std::string& name) {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeFSDefaultAndSize(name.data(), static_cast<py::ssize_t>(name.size())));
}

py::str ToText(const std::string& bytes) {
  const auto size = static_cast<py::ssize_t>(bytes.size());
  return py::reinterpret_steal<py::str>(PyUnicode_DecodeUTF8(bytes.data(), size, "replace"));
}

std::string FromName(const py::object& name) {
  return py::bytes(py::module_::import("os").attr("fsencode")(name));
}

}  // namespace cairn::python
