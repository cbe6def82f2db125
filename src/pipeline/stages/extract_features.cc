#include <atomic>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/base/path_in_folder.h"
#include "cairn/image/bitmap.h"
#include "cairn/pipeline/stages.h"
#include "database/database_writer.h"
#include "database/stage_names.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct FeatureItem {
  Image image;
  ImageSize camera_size;
  uint64_t file_hash = 0;
  bool is_ours = false;  // cairn added the image, so cairn may take it out again
  std::string error;
};

// Images without keypoints whose photograph is known.
std::vector<FeatureItem> FindItems(const Database& database) {
  std::map<camera_t, ImageSize> sizes;
  for (const Camera& camera : database.ReadCameras()) {
    sizes[camera.camera_id] = {camera.width, camera.height};
  }
  for (const UnknownCamera& camera : database.ReadUnknownCameras()) {
    sizes[camera.camera_id] = {camera.width, camera.height};
  }
  std::map<std::string, uint64_t> file_hashes;
  for (const PhotoRecord& photo : database.ReadPhotos()) {
    if (photo.error.empty()) file_hashes[photo.name] = photo.file_hash;
  }
  std::set<uint64_t> ours;
  for (const JobRecord& job : database.ReadJobs(kStageCameras)) ours.insert(job.item);
  const std::map<image_t, int> num_keypoints = database.ReadNumKeypoints();
  std::vector<FeatureItem> items;
  for (const Image& image : database.ReadImages()) {
    if (num_keypoints.count(image.image_id) > 0) continue;
    const auto file_hash = file_hashes.find(image.name);
    if (file_hash == file_hashes.end()) continue;
    items.push_back(
        {image, sizes[image.camera_id], file_hash->second, ours.count(image.image_id) > 0, ""});
  }
  return items;
}

Features Extract(const std::string& path, const ImageSize& camera_size,
                 const FeatureOptions& options) {
  const Bitmap bitmap = ReadBitmap(path, BitmapColor::kGray);
  if (ImageSize{bitmap.width, bitmap.height} != camera_size) {
    throw IoError(path, "is " + std::to_string(bitmap.width) + " x " +
                            std::to_string(bitmap.height) + " pixels, its camera " +
                            std::to_string(camera_size.width) + " x " +
                            std::to_string(camera_size.height));
  }
  return ExtractFeatures(bitmap, options);
}

void WriteFeatures(Database& database, const FeatureItem& item, const Features& features) {
  database.WriteKeypoints(item.image.image_id, features.keypoints);
  database.WriteDescriptors(item.image.image_id, features.descriptors);
  database.WriteJob(kStageFeatures, {item.image.image_id, item.file_hash, ""});
}

// The image leaves the database, with the reason in its photograph's record.
void WriteFailure(Database& database, const FeatureItem& item) {
  database.WritePhoto({item.image.name, item.file_hash, item.error});
  if (item.is_ours) database.DeleteImage(item.image.image_id);
}

}  // namespace

StageReport ExtractImageFeatures(Database& database, const std::string& image_path,
                                 const FeatureOptions& options, const RunContext& run) {
  Stage stage(run.monitor, kStageFeatures);
  StageLedger ledger(database, kStageFeatures, DumpQualified("features", options));
  std::vector<FeatureItem> items;
  if (!image_path.empty()) items = FindItems(database);
  std::atomic<int64_t> num_features = 0;
  if (!items.empty()) {
    ledger.Begin(database);
    DatabaseWriter::Options writer_options;
    writer_options.max_queue_size = 8;  // An image's features are megabytes.
    DatabaseWriter writer(database.path(), writer_options);
    run.monitor.BeginStage("extracting features", static_cast<int64_t>(items.size()));
    ParallelFor(run.num_threads, static_cast<int64_t>(items.size()), [&](int64_t i) {
      if (run.monitor.StopRequested()) return;
      FeatureItem& item = items[i];
      try {
        Features features =
            Extract(PathInFolder(image_path, item.image.name), item.camera_size, options);
        num_features += static_cast<int64_t>(features.keypoints.size());
        writer.Push([&item, features = std::make_shared<Features>(std::move(features))](
                        Database& db) { WriteFeatures(db, item, *features); });
      } catch (const IoError& error) {
        item.error = error.reason();
        writer.Push([&item](Database& db) { WriteFailure(db, item); });
      }
      run.monitor.Advance(1);
    });
    writer.Finish();
    run.monitor.EndStage();
  }
  for (const FeatureItem& item : items) {
    if (!item.error.empty()) stage.Warn(item.image.name + ": " + item.error + "; skipped");
  }
  const auto num_failed = static_cast<double>(stage.NumMessages());
  stage.Add("images", database.ReadImages().size());
  stage.Add("images_with_features", database.ReadNumKeypoints().size());
  stage.Add("computed", static_cast<double>(items.size()) - num_failed);
  stage.Add("skipped", num_failed);
  stage.Add("new_features", num_features);
  return EndStage(stage, run, ledger, database);
}

}  // namespace cairn
