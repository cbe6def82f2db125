#include "cairn/database/database.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <filesystem>
#include <thread>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/depth/sample_depth.h"
#include "options.h"
#include "run.h"

namespace cairn::python {
namespace {

// A database that `with` closes, and a transaction that is open, both of one thread: writes of
// another would be part of the transaction. Calls wait for locks of the file without the
// interpreter's, which the thread that holds one may need.
struct OpenDatabase {
  std::optional<Database> database;
  std::unique_ptr<Database::Transaction> transaction;
  std::thread::id thread = std::this_thread::get_id();
};

void CheckThread(const OpenDatabase& self) {
  if (self.thread == std::this_thread::get_id()) return;
  throw ConfigError("database", "was opened by another thread; each opens the file for itself");
}

Database& In(OpenDatabase& self) {
  CheckThread(self);
  if (!self.database) throw ConfigError("database", "is closed");
  return *self.database;
}

void Close(OpenDatabase& self) {
  CheckThread(self);
  self.transaction.reset();
  self.database.reset();
}

// What a function reads.
template <class Read>
auto ReadFrom(OpenDatabase& self, const Read& read) {
  Database& database = In(self);
  const UnlockedUnlessEnding unlocked;
  return read(database);
}

// The writes within `with database.transaction():`.
struct TransactionScope {
  OpenDatabase& self;
};

void Begin(TransactionScope& scope) {
  Database& database = In(scope.self);
  if (scope.self.transaction) throw ConfigError("transaction", "one is open already");
  const UnlockedUnlessEnding unlocked;
  scope.self.transaction = std::make_unique<Database::Transaction>(database);
}

void End(TransactionScope& scope, const py::object& type, const py::object&, const py::object&) {
  CheckThread(scope.self);
  const bool is_complete = type.is_none();
  const UnlockedUnlessEnding unlocked;
  const auto transaction = std::move(scope.self.transaction);
  if (transaction && is_complete) transaction->Commit();
}

// A transaction, unless one is open: the largest id that is read is the largest one until the end.
std::unique_ptr<Database::Transaction> OwnTransaction(OpenDatabase& self) {
  if (self.transaction) return nullptr;
  return std::make_unique<Database::Transaction>(In(self));
}

camera_t WriteCamera(OpenDatabase& self, Camera camera) {
  Database& database = In(self);
  const UnlockedUnlessEnding unlocked;
  const auto transaction = OwnTransaction(self);
  if (camera.camera_id == kInvalidCameraId) {
    const std::vector<camera_t> taken = database.ReadTakenCameraIds();
    camera.camera_id = taken.empty() ? 1 : taken.back() + 1;
  }
  database.WriteCamera(camera);
  if (transaction) transaction->Commit();
  return camera.camera_id;
}

image_t WriteImage(OpenDatabase& self, const py::object& name, camera_t camera_id,
                   std::optional<image_t> image_id) {
  Database& database = In(self);
  const std::string text = FromName(name);
  const UnlockedUnlessEnding unlocked;
  const auto transaction = OwnTransaction(self);
  if (!image_id) image_id = database.ReadLargestTakenImageId() + 1;
  database.WriteImage({*image_id, text, camera_id});
  if (transaction) transaction->Commit();
  return *image_id;
}

image_pair_t PairId(image_t image_id1, image_t image_id2) {
  if (image_id1 == image_id2) throw ConfigError("image_id2", "is that of the first image");
  if (std::max(image_id1, image_id2) >= kMaxNumImages) {
    throw ConfigError("image_id1, image_id2", "ids are below " + std::to_string(kMaxNumImages));
  }
  return ImagePairToPairId(image_id1, image_id2);
}

// Throws ConfigError unless there is the image, and `index`, where its keypoints are there, is
// below their number.
void CheckKeypoint(const Database& database, const std::string& name, image_t image_id,
                   std::optional<point2D_t> index) {
  if (!database.HasImage(image_id)) {
    throw ConfigError(name, "there is no image " + std::to_string(image_id));
  }
  const std::optional<int> size = database.ReadNumKeypoints(image_id);
  if (!size || !index || static_cast<int64_t>(*index) < *size) return;
  throw ConfigError(name, std::to_string(*index) + " is no index of the " + std::to_string(*size) +
                              " keypoints of image " + std::to_string(image_id));
}

// The same of both images of a pair.
void CheckPair(const Database& database, const std::string& name, image_t image_id1,
               image_t image_id2, const FeatureMatches& matches) {
  const auto largest = [&](point2D_t FeatureMatch::*point) -> std::optional<point2D_t> {
    if (matches.empty()) return std::nullopt;
    return std::ranges::max(matches, {}, point).*point;
  };
  CheckKeypoint(database, name, image_id1, largest(&FeatureMatch::point1));
  CheckKeypoint(database, name, image_id2, largest(&FeatureMatch::point2));
}

// Throws ConfigError unless an image whose keypoints are there has so many.
void CheckNumRows(const Database& database, const std::string& name, image_t image_id,
                  size_t num_rows) {
  if (const auto num_keypoints = database.ReadNumKeypoints(image_id)) {
    CheckSize(name, num_rows, static_cast<size_t>(*num_keypoints));
  }
}

// Matches are kept for ascending ids; Python has them in the order in which it names the images.
void Swap(FeatureMatches& matches) {
  for (FeatureMatch& match : matches) std::swap(match.point1, match.point2);
}

void WriteMatches(OpenDatabase& self, image_t image_id1, image_t image_id2,
                  const py::object& array) {
  const image_pair_t pair_id = PairId(image_id1, image_id2);
  FeatureMatches matches = ToMatches(array);
  Database& database = In(self);
  const UnlockedUnlessEnding unlocked;
  CheckPair(database, "matches", image_id1, image_id2, matches);
  if (image_id1 > image_id2) Swap(matches);
  database.WriteMatches(pair_id, matches);
}

std::optional<py::array_t<uint32_t>> ReadMatches(OpenDatabase& self, image_t image_id1,
                                                 image_t image_id2) {
  const image_pair_t pair_id = PairId(image_id1, image_id2);
  auto matches = ReadFrom(self, [&](Database& database) { return database.ReadMatches(pair_id); });
  if (!matches) return std::nullopt;
  if (image_id1 > image_id2) Swap(*matches);
  return FromMatches(std::move(*matches));
}

std::optional<TwoViewGeometry> ReadGeometry(OpenDatabase& self, image_t image_id1,
                                            image_t image_id2) {
  const image_pair_t pair_id = PairId(image_id1, image_id2);
  auto geometry =
      ReadFrom(self, [&](Database& database) { return database.ReadTwoViewGeometry(pair_id); });
  if (geometry && image_id1 > image_id2) geometry = Inverted(*geometry);
  return geometry;
}

void WriteGeometry(OpenDatabase& self, image_t image_id1, image_t image_id2,
                   const TwoViewGeometry& geometry) {
  const image_pair_t pair_id = PairId(image_id1, image_id2);
  Database& database = In(self);
  const UnlockedUnlessEnding unlocked;
  CheckPair(database, "geometry", image_id1, image_id2, geometry.inlier_matches);
  database.WriteTwoViewGeometry(pair_id, image_id1 > image_id2 ? Inverted(geometry) : geometry);
}

py::array_t<uint32_t> PairsOf(const std::vector<image_pair_t>& ids) {
  FeatureMatches pairs;
  for (const image_pair_t id : ids) {
    const auto [image_id1, image_id2] = PairIdToImagePair(id);
    pairs.push_back({image_id1, image_id2});
  }
  return FromMatches(std::move(pairs));
}

std::optional<py::array_t<float>> ReadKeypoints(OpenDatabase& self, image_t image_id) {
  auto keypoints =
      ReadFrom(self, [&](Database& database) { return database.ReadKeypoints(image_id); });
  if (!keypoints) return std::nullopt;
  return MoveToArray<float, 6>(std::move(*keypoints));
}

void WriteDescriptors(OpenDatabase& self, image_t image_id, const py::object& values) {
  const py::array array = ToArray("descriptors", values);
  CheckShape("descriptors", array, {-1, kDescriptorSize});
  if (array.size() > 0 && !py::isinstance<py::array_t<uint8_t>>(array)) {
    throw ConfigError("descriptors", "these are " + std::string(py::str(array.dtype())) +
                                         ", not uint8; those of unit length become so by "
                                         "np.rint(512 * d).clip(0, 255).astype(np.uint8)");
  }
  const Array<uint8_t> rows(array);
  const auto num_rows = static_cast<size_t>(rows.shape(0));
  Database& database = In(self);
  const UnlockedUnlessEnding unlocked;
  CheckNumRows(database, "descriptors", image_id, num_rows);
  database.WriteDescriptors(image_id, Descriptors::Map(rows.data(), num_rows, kDescriptorSize));
}

void WriteDepth(OpenDatabase& self, image_t image_id, const Array<float>& array) {
  const std::vector<DepthSample> samples = ToDepthSamples("samples", array);
  Database& database = In(self);
  const UnlockedUnlessEnding unlocked;
  CheckNumRows(database, "samples", image_id, samples.size());
  database.WriteDepthSamples(image_id, samples);
}

std::optional<py::array_t<float>> ReadDepth(OpenDatabase& self, image_t image_id) {
  const auto samples =
      ReadFrom(self, [&](Database& database) { return database.ReadDepthSamples(image_id); });
  if (!samples) return std::nullopt;
  return FromDepthSamples(*samples);
}

py::array_t<float> Sample(const Array<float>& depth_map, int width, int height,
                          const Array<float>& keypoints, const py::object& given) {
  CheckShape("depth_map", depth_map, {-1, -1});
  if (depth_map.size() == 0) throw ConfigError("depth_map", "is empty");
  const ImageSize size = {static_cast<int>(depth_map.shape(1)),
                          static_cast<int>(depth_map.shape(0))};
  if (width <= 0 || height <= 0) throw ConfigError("width, height", "must be positive");
  const std::string fault = FaultOfMapSize(size, {width, height});
  if (!fault.empty()) throw ConfigError("depth_map", fault);
  const auto options = ToOptions<DepthOptions>(given);
  const std::vector<float> values(depth_map.data(), depth_map.data() + depth_map.size());
  const DepthMap map = DepthMapFromValues(size.width, size.height, values, options);
  return FromDepthSamples(SampleDepth(map, width, height, ToKeypoints(keypoints), options));
}

using DatabaseClass = py::class_<OpenDatabase>;

OpenDatabase Open(const std::filesystem::path& path, bool read_only) {
  if (path.empty()) throw ConfigError("path", "is empty; ':memory:' is a private database");
  OpenDatabase self;
  const UnlockedUnlessEnding unlocked;
  self.database.emplace(path.string(),
                        read_only ? Database::Mode::kReadOnly : Database::Mode::kCreateOrOpen);
  return self;
}

void BindOpening(DatabaseClass& c) {
  c.def(py::init(&Open), py::arg("path"), py::arg("read_only") = false,
        "Opens the file, or makes it; ':memory:' is a private database. It belongs to the thread "
        "that opened it.")
      .def("close",
           [](OpenDatabase& self) {
             if (self.transaction) throw ConfigError("database", "has a transaction that is open");
             Close(self);
           })
      .def("__enter__", [](const py::object& self) { return self; })
      .def("__exit__", [](OpenDatabase& self, const py::object&, const py::object&,
                          const py::object&) { Close(self); })
      .def_property_readonly("path", [](OpenDatabase& self) { return ToName(In(self).path()); })
      .def(
          "transaction", [](OpenDatabase& self) { return TransactionScope{self}; },
          py::keep_alive<0, 1>(),
          "`with database.transaction():` many writes at once, all of them or (exception) none.");
}

void BindImages(DatabaseClass& c) {
  c.def("write_camera", &WriteCamera, py::arg("camera"),
        "Adds or replaces it; one without an id gets the next. Returns the id.")
      .def("read_cameras",
           [](OpenDatabase& self) { return ReadFrom(self, std::mem_fn(&Database::ReadCameras)); })
      .def("write_image", &WriteImage, py::arg("name"), py::arg("camera_id"),
           py::arg("image_id") = py::none(),
           "`name`: the path relative to the folder of photographs. Returns the id.")
      .def("read_images",
           [](OpenDatabase& self) { return ReadFrom(self, std::mem_fn(&Database::ReadImages)); });
}

void BindFeatures(DatabaseClass& c) {
  c.def(
       "write_keypoints",
       [](OpenDatabase& self, image_t image_id, const Array<float>& keypoints) {
         const std::vector<Keypoint> rows = ToKeypoints(keypoints);
         Database& database = In(self);
         const UnlockedUnlessEnding unlocked;
         database.WriteKeypoints(image_id, rows);
       },
       py::arg("image_id"), py::arg("keypoints"),
       "(n, 2): x, y in pixels, where the center of the top-left pixel is (0.5, 0.5); or (n, 6): "
       "with affine shapes, x, y, a11, a12, a21, a22.")
      .def("read_keypoints", &ReadKeypoints, py::arg("image_id"), "(n, 6), or None.")
      .def("write_descriptors", &WriteDescriptors, py::arg("image_id"), py::arg("descriptors"),
           "(n, 128) uint8, a row a keypoint, such as RootSIFT times 512.")
      .def(
          "read_descriptors",
          [](OpenDatabase& self, image_t image_id) {
            return ReadFrom(self,
                            [&](Database& database) { return database.ReadDescriptors(image_id); });
          },
          py::arg("image_id"))
      .def("write_depth_samples", &WriteDepth, py::arg("image_id"), py::arg("samples"),
           "(n, 3), a row a keypoint: z-depth and its gradient per pixel, NaN where there is none.")
      .def("read_depth_samples", &ReadDepth, py::arg("image_id"), "(n, 3), or None.");
}

void BindPairRows(DatabaseClass& c) {
  c.def("write_matches", &WriteMatches, py::arg("image_id1"), py::arg("image_id2"),
        py::arg("matches"), "(n, 2) indices of keypoints of the first and the second image.")
      .def("read_matches", &ReadMatches, py::arg("image_id1"), py::arg("image_id2"))
      .def(
          "matched_pairs",
          [](OpenDatabase& self) {
            return PairsOf(ReadFrom(self, std::mem_fn(&Database::ReadMatchedPairIds)));
          },
          "(n, 2) image ids.")
      .def("write_two_view_geometry", &WriteGeometry, py::arg("image_id1"), py::arg("image_id2"),
           py::arg("geometry"))
      .def("read_two_view_geometry", &ReadGeometry, py::arg("image_id1"), py::arg("image_id2"))
      .def(
          "verified_pairs",
          [](OpenDatabase& self) {
            return PairsOf(ReadFrom(self, std::mem_fn(&Database::ReadTwoViewGeometryPairIds)));
          },
          "(n, 2) image ids.");
}

}  // namespace

void BindDatabase(py::module_& m) {
  py::class_<Image>(m, "DatabaseImage", "A photograph in a database.")
      .def_readonly("image_id", &Image::image_id)
      .def_property_readonly("name", [](const Image& image) { return ToName(image.name); })
      .def_readonly("camera_id", &Image::camera_id);
  py::class_<TransactionScope>(m, "Transaction", "See Database.transaction.")
      .def("__enter__", &Begin)
      .def("__exit__", &End);
  DatabaseClass c(m, "Database", "A SQLite file in COLMAP's schema, with tables of our own.");
  BindOpening(c);
  BindImages(c);
  BindFeatures(c);
  BindPairRows(c);
  m.def("sample_depth", &Sample, py::arg("depth_map"), py::arg("width"), py::arg("height"),
        py::arg("keypoints"), py::kw_only(), py::arg("options") = py::none(),
        "(n, 3) depth and its gradient per pixel at keypoints of an image of this size, over which "
        "the map (rows, columns) is stretched; NaN where there is none. For write_depth_samples "
        "and verify_pair.");
}

}  // namespace cairn::python
