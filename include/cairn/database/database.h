#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/scene/features.h"
#include "cairn/scene/image.h"
#include "cairn/scene/two_view_geometry.h"

namespace cairn {

// A SQLite database with COLMAP's schema (3.8 is written, 3.8 to 4.x are read) and cairn's own
// tables cairn_*. Every method throws IoError that names the file, the row and the reason. One
// Database object belongs to one thread at a time. ":memory:" gives a private database, for tests.
class Database {
 public:
  enum class Mode { kCreateOrOpen, kOpenExisting, kReadOnly };
  explicit Database(const std::string& path, Mode mode = Mode::kCreateOrOpen);
  ~Database();
  Database(Database&&) noexcept;

  const std::string& path() const;

  // Cameras and images, in the order of their ids.
  std::vector<Camera> ReadCameras() const;
  std::vector<Image> ReadImages() const;
  void WriteCamera(const Camera& camera);  // camera_id must be set; replaces
  void WriteImage(const Image& image);     // image_id must be set; replaces

  // Features. A missing row is nullopt; rows with 2, 4 or 6 columns become affine frames.
  std::optional<std::vector<Keypoint>> ReadKeypoints(image_t image_id) const;
  std::optional<Descriptors> ReadDescriptors(image_t image_id) const;
  std::optional<std::vector<DepthSample>> ReadDepthSamples(image_t image_id) const;
  void WriteKeypoints(image_t image_id, const std::vector<Keypoint>& keypoints);
  void WriteDescriptors(image_t image_id, const Descriptors& descriptors);
  void WriteDepthSamples(image_t image_id, const std::vector<DepthSample>& samples);

  // Matches and two-view geometries; always given and returned for the image order image_id1 <
  // image_id2.
  std::vector<image_pair_t> ReadMatchedPairIds() const;  // ascending, rows with > 0 matches
  std::optional<FeatureMatches> ReadMatches(image_pair_t pair_id) const;
  void WriteMatches(image_pair_t pair_id, const FeatureMatches& matches);
  std::vector<image_pair_t> ReadTwoViewGeometryPairIds() const;  // ascending, rows with > 0 inliers
  std::optional<TwoViewGeometry> ReadTwoViewGeometry(image_pair_t pair_id) const;
  void WriteTwoViewGeometry(image_pair_t pair_id, const TwoViewGeometry& geometry);

  // Runs the writes between construction and Commit() as one transaction; rolled back if destroyed
  // before.
  class Transaction {
   public:
    explicit Transaction(Database& database);
    ~Transaction();
    void Commit();

   private:
    Database* database_;
  };

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cairn
