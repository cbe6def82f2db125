#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/database/records.h"
#include "cairn/geometry/gps.h"
#include "cairn/scene/features.h"
#include "cairn/scene/image.h"
#include "cairn/scene/two_view_geometry.h"

namespace cairn {

// A SQLite database with COLMAP's schema (3.8 is written, 3.8 to 4.x are read and extended) and
// cairn's own tables cairn_*. Every method throws IoError that names the file, the row and the
// reason. One Database object belongs to one thread at a time; several objects may have the same
// file open, one of them writing (write-ahead log). ":memory:" gives a private database, for tests.
//
// Rows have keys that do not depend on the order of writing, so equal contents give equal dumps
// (`sqlite3 scene.db .dump`); measured times are in cairn_timings alone.
class Database {
 public:
  // kReadOnly also opens files in folders that cannot be written to, and never changes the file.
  // kSnapshot sees it as it is at the first look, too, whatever others write meanwhile.
  enum class Mode { kCreateOrOpen, kOpenExisting, kReadOnly, kSnapshot };
  explicit Database(const std::string& path, Mode mode = Mode::kCreateOrOpen);
  ~Database();
  Database(Database&&) noexcept;
  Database& operator=(Database&&) noexcept;

  const std::string& path() const;
  // How long a write waits for another program's lock, before IoError; 10 s at first.
  void SetBusyTimeout(int milliseconds);

  // Rows that cannot be used: cameras that are not valid, images whose name no model can hold, rows
  // of images that are not there, and pairs of such images, of an image with itself, or with the
  // larger id first. All other methods that read many rows leave them out. Each is named with the
  // reason. (What is in blobs is checked when they are read.)
  std::vector<std::string> FindBadRows() const;

  // Cameras and images, in the order of their ids. Cameras of unknown models are left out;
  // ReadUnknownCameras returns them.
  std::vector<Camera> ReadCameras() const;
  std::vector<UnknownCamera> ReadUnknownCameras() const;
  std::vector<Image> ReadImages() const;
  // Ids that new rows must not have: those of rows that cannot be used, too, and of images that are
  // gone, which models may still have. 0: there is no image.
  std::vector<camera_t> ReadTakenCameraIds() const;
  image_t ReadLargestTakenImageId() const;
  bool HasImage(image_t image_id) const;
  // Replaces. Throws IoError unless camera_id is set.
  void WriteCamera(const Camera& camera);
  // Replaces. Throws IoError for ids and names that cannot be used, a name that another image has,
  // and a camera that is not there.
  void WriteImage(const Image& image);
  // COLMAP's prior positions of images, those that are on Earth (WGS84).
  std::map<image_t, GpsPosition> ReadGpsPriors() const;
  // For COLMAP's spatial matcher and model aligner: in the schema of COLMAP up to 3.9, which new
  // databases have. Without an altitude COLMAP has no position.
  void WriteGpsPrior(image_t image_id, const GpsPosition& position);
  // Removes the image with its features, and its camera if neither another image nor a rig with
  // images has it.
  void DeleteImage(image_t image_id);
  // Removes what was made from images: features, depth, pairs. The images and their cameras stay.
  void DeleteFeaturesAndPairs(const std::set<image_t>& images);
  // Removes images with all that was made from them, their pairs and photographs included.
  void DeleteImagesAndPairs(const std::set<image_t>& images);
  // Removes cameras that neither an image nor a rig with images has.
  void DeleteUnusedCameras();

  // Features, of images that are there. A missing row is nullopt; rows with 2, 4 or 6 columns
  // become affine frames. Descriptors have 128 columns.
  std::optional<std::vector<Keypoint>> ReadKeypoints(image_t image_id) const;
  std::optional<Descriptors> ReadDescriptors(image_t image_id) const;
  // Empty unless they were written with these descriptors: another program may have replaced those.
  Polarities ReadPolarities(image_t image_id, const Descriptors& descriptors) const;
  std::optional<std::vector<DepthSample>> ReadDepthSamples(image_t image_id) const;
  std::optional<uint64_t> ReadDepthHash(image_t image_id) const;
  void WriteKeypoints(image_t image_id, const std::vector<Keypoint>& keypoints);
  void WriteDescriptors(image_t image_id, const Descriptors& descriptors,
                        const Polarities& polarities = {});
  void WriteDepthSamples(image_t image_id, const std::vector<DepthSample>& samples);
  // Number of rows of an image, or of every image that has the row, without reading the data.
  std::optional<int> ReadNumKeypoints(image_t image_id) const;
  std::map<image_t, int> ReadNumKeypoints() const;
  std::map<image_t, int> ReadNumDescriptors() const;
  std::map<image_t, int> ReadNumDepthSamples() const;

  // Matches and two-view geometries; always given and returned for the image order image_id1 <
  // image_id2. A pair that was tried without success has a row with 0 matches, as in COLMAP.
  std::vector<image_pair_t> ReadMatchedPairIds() const;  // ascending, rows with > 0 matches
  std::optional<FeatureMatches> ReadMatches(image_pair_t pair_id) const;
  void WriteMatches(image_pair_t pair_id, const FeatureMatches& matches);
  std::vector<image_pair_t> ReadTwoViewGeometryPairIds() const;  // ascending, rows with > 0 inliers
  // Does its row have a matrix or a pose? Those of COLMAP of 2017 have inliers alone.
  bool HasGeometry(image_pair_t pair_id) const;
  std::optional<TwoViewGeometry> ReadTwoViewGeometry(image_pair_t pair_id) const;
  void WriteTwoViewGeometry(image_pair_t pair_id, const TwoViewGeometry& geometry);
  // Number of (inlier) matches of every pair that has the row, 0 included, ascending by pair.
  std::vector<std::pair<image_pair_t, int>> ReadNumMatches() const;
  std::vector<std::pair<image_pair_t, int>> ReadNumInliers() const;
  // Pairs that build_view_graph matched, or chose to match, and did not try to verify; ascending.
  std::vector<image_pair_t> ReadPairsToVerify() const;

  // Why pairs were chosen; ascending by pair. A pair keeps the reason that it had first.
  std::vector<PairChoiceRecord> ReadPairChoices() const;
  void WritePairChoice(const PairChoiceRecord& choice);

  // What each verifier found, ascending by (pair, verifier).
  std::vector<PairMetrics> ReadPairMetrics() const;
  void WritePairMetrics(const PairMetrics& metrics);
  // Evidence about prior focal lengths, ascending by pair, and the conclusions from it.
  std::vector<PairFocalEvidence> ReadFocalEvidence() const;
  void WriteFocalEvidence(const PairFocalEvidence& evidence);
  void DeleteFocalEvidence(image_pair_t pair_id);
  std::map<camera_t, CameraFocal> ReadCameraFocals() const;
  // In place of all that are there.
  void WriteCameraFocals(const std::map<camera_t, CameraFocal>& focals);
  std::map<camera_t, CameraLens> ReadCameraLenses() const;
  void WriteCameraLens(camera_t camera_id, const CameraLens& lens);
  // Removes what verification found for a pair; its job and its focal evidence stay.
  void DeletePairResults(image_pair_t pair_id);
  // Pairs won by each verifier, and pairs rejected for each reason.
  std::map<std::string, int64_t> CountWinners() const;
  std::map<std::string, int64_t> CountRejections() const;
  // For each step of verifiers: the pairs that it decided, accepted or not, and their time in all.
  // The most frequent step first.
  struct StepTimes {
    std::string step;
    int64_t num_pairs = 0;
    double seconds = 0;
  };
  std::vector<StepTimes> ReadStepTimes() const;

  // Measured times: of a pair and verifier (stage "verification"), or of a whole stage (item 0,
  // label ""), which is added to what is there, since a stage may have been interrupted.
  void WriteTiming(const std::string& stage, uint64_t item, const std::string& label,
                   double seconds);
  void AddStageTime(const std::string& stage, double seconds);
  std::optional<double> ReadTiming(const std::string& stage, uint64_t item,
                                   const std::string& label) const;

  // State of the stages, to continue them and to detect changed inputs
  // (pipeline/stages/stage_ledger.h).
  std::vector<PhotoRecord> ReadPhotos() const;  // in the order of the names
  void WritePhoto(const PhotoRecord& photo);
  void ClearPhotos();
  std::vector<JobRecord> ReadJobs(const std::string& stage) const;  // ascending by item
  void WriteJob(const std::string& stage, const JobRecord& job);
  void DeleteJob(const std::string& stage, uint64_t item);
  std::optional<StageRecord> ReadStage(const std::string& stage) const;
  void WriteStage(const StageRecord& record);

  // Removes cairn's records of pairs whose rows another program deleted, and, where photographs can
  // be read again, of images, with what else was made from these: they are to be computed again.
  struct LostRows {
    int64_t num_images = 0, num_pairs = 0;
  };
  LostRows ForgetLostRows(bool has_photographs);

  // Removes the results of a stage, whichever program wrote them, with its jobs, timings and
  // record. (Photographs, images and cameras stay.)
  void ClearStage(const std::string& stage);

  // Runs the writes between construction and Commit() as one transaction; rolled back if destroyed
  // before. One within another is a part of it.
  class Transaction {
   public:
    explicit Transaction(Database& database);
    ~Transaction();
    Transaction(const Transaction&) = delete;
    Transaction& operator=(const Transaction&) = delete;
    void Commit();

   private:
    Database* database_;  // nullptr: committed, or part of another
  };

  struct Impl;  // defined in src/database/query.h

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace cairn
