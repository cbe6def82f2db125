#pragma once

#include <pybind11/numpy.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <memory>
#include <ranges>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/base/error.h"
#include "cairn/scene/features.h"

namespace cairn::python {

namespace py = pybind11;

// An argument: arrays of this type and layout are taken as they are, others are converted.
template <class Scalar>
using Array = py::array_t<Scalar, py::array::c_style | py::array::forcecast>;

// An array, or what NumPy makes one of. Throws ConfigError.
py::array ToArray(const std::string& name, const py::object& values);

// Throws ConfigError that names the argument and both shapes unless the array has this shape; -1:
// any number. An empty list may stand for no rows.
void CheckShape(const std::string& name, const py::array& array,
                std::initializer_list<py::ssize_t> shape);

// Throws ConfigError unless it is positive and finite.
void CheckPositive(const std::string& name, double value);

// Throws ConfigError unless there are as many as expected.
void CheckSize(const std::string& name, size_t size, size_t expected);

// Whole numbers below `limit`; n rows of `num_columns` (1: a plain row). Throws ConfigError.
std::vector<uint32_t> ToIndices(const std::string& name, const py::object& values, int num_columns,
                                uint64_t limit = std::numeric_limits<uint32_t>::max());

// Throws ConfigError unless `known`, a map or set, has the id of a camera or image (`kind`).
template <class Known>
void CheckIsThere(const std::string& name, const std::string& kind, uint32_t id,
                  const Known& known) {
  if (!known.contains(id)) {
    throw ConfigError(name, "there is no " + kind + " " + std::to_string(id));
  }
}

// A set, list or other collection of ids of `known`. Throws ConfigError.
template <class Known>
std::set<uint32_t> ToIds(const std::string& name, const std::string& kind,
                         const py::iterable& values, const Known& known) {
  std::set<uint32_t> ids;
  for (const uint32_t id : ToIndices(name, py::list(values), 1)) {
    CheckIsThere(name, kind, id, known);
    ids.insert(id);
  }
  return ids;
}

// (n, 2) ids of different images.
std::vector<std::pair<image_t, image_t>> ToPairs(const py::object& values);

// Of (size, 3, 3) matrices. Throws ConfigError.
std::vector<Eigen::Quaterniond> ToRotations(const Array<double>& array, size_t size);

// Three numbers of row i of an (n, 3) array.
inline Eigen::Vector3d Row3(const Array<double>& array, size_t i) {
  return Eigen::Vector3d::Map(array.data() + 3 * i);
}

// (n, 2) numbers as Eigen's vectors; without a copy where their memory is aligned as Eigen needs
// it.
class Points {
 public:
  Points(const std::string& name, const Array<double>& array);
  std::span<const Eigen::Vector2d> span() const { return span_; }
  std::vector<Eigen::Vector2d> vector() const { return {span_.begin(), span_.end()}; }

 private:
  Array<double> array_;  // keeps the memory
  std::vector<Eigen::Vector2d> copy_;
  std::span<const Eigen::Vector2d> span_;
};

// Throws ConfigError for the first that is not finite.
void CheckAllFinite(const std::string& name, std::span<const Eigen::Vector2d> points);

// (n, 3): depth and its gradient per pixel; 0 or not a number where there is none. Throws
// ConfigError for others that are no depth.
std::vector<DepthSample> ToDepthSamples(const std::string& name, const Array<float>& array);
py::array_t<float> FromDepthSamples(const std::vector<DepthSample>& samples);

// (n, 2): positions alone, or (n, 6): with affine frames, COLMAP's columns. Throws ConfigError.
std::vector<Keypoint> ToKeypoints(const Array<float>& array);

FeatureMatches ToMatches(const py::object& values);

// An array that owns the vector; rows are of kNumColumns scalars (1: a plain row).
template <class Scalar, int kNumColumns, class Row>
py::array_t<Scalar> MoveToArray(std::vector<Row> rows) {
  static_assert(sizeof(Row) == kNumColumns * sizeof(Scalar));
  auto owner = std::make_unique<std::vector<Row>>(std::move(rows));
  const auto size = static_cast<py::ssize_t>(owner->size());
  const auto* data = reinterpret_cast<const Scalar*>(owner->data());
  const py::capsule capsule(owner.get(),
                            [](void* vector) { delete static_cast<std::vector<Row>*>(vector); });
  owner.release();
  if constexpr (kNumColumns == 1) return py::array_t<Scalar>({size}, data, capsule);
  return py::array_t<Scalar>({size, static_cast<py::ssize_t>(kNumColumns)}, data, capsule);
}

inline py::array_t<uint32_t> FromMatches(FeatureMatches matches) {
  return MoveToArray<uint32_t, 2>(std::move(matches));
}

// (n, rows, columns), or (n, rows) for vectors: get(value) is a fixed-size matrix of doubles.
template <class Values, class Get>
py::array_t<double> StackMatrices(const Values& values, const Get& get) {
  using Matrix = std::decay_t<decltype(get(*values.begin()))>;
  constexpr int kRows = Matrix::RowsAtCompileTime, kColumns = Matrix::ColsAtCompileTime;
  using Layout =
      Eigen::Matrix<double, kRows, kColumns, kColumns == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
  std::vector<py::ssize_t> shape = {static_cast<py::ssize_t>(values.size()), kRows};
  if (kColumns > 1) shape.push_back(kColumns);
  py::array_t<double> array(shape);
  double* data = array.mutable_data();
  for (const auto& value : values) {
    Layout::Map(data) = get(value);
    data += kRows * kColumns;
  }
  return array;
}

// The values 0 ... size - 1 for StackMatrices.
inline auto Indices(size_t size) { return std::views::iota(size_t{0}, size); }

// A getter of the name of an enum's value.
template <class Class, class Enum>
auto EnumName(Enum Class::*field, std::string_view (*name)(Enum)) {
  return [field, name](const Class& object) { return name(object.*field); };
}

// A file's name as Python has it: of bytes that are no UTF-8, surrogates.
py::str ToName(const std::string& name);
std::string FromName(const py::object& name);

// A message, which may name a file whose name is no UTF-8.
py::str ToText(const std::string& bytes);

// A JSON text as Python's dictionaries and lists.
inline py::object FromJson(const std::string& text) {
  return py::module_::import("json").attr("loads")(text);
}

}  // namespace cairn::python
