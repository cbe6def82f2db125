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
#include "pipeline/stages/masks.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct FeatureItem {
  Image image;
  ImageSize camera_size;
  uint64_t file_hash = 0;
  std::string mask_path;    // "": none
  uint64_t input_hash = 0;  // of what its features are made from
  bool is_ours = false;     // cairn added the image, so cairn may take it out again
  std::string error;
};

// Images without keypoints whose photograph is known.
std::vector<FeatureItem> FindItems(const Database& database,
                                   const std::map<image_t, std::string>& masks) {
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
    const auto mask = masks.find(image.image_id);
    const std::string mask_path = mask == masks.end() ? "" : mask->second;
    items.push_back({image, sizes[image.camera_id], file_hash->second, mask_path,
                     FeatureInputHash(file_hash->second, mask_path), ours.count(image.image_id) > 0,
                     ""});
  }
  return items;
}

std::string Text(const ImageSize& size) {
  return std::to_string(size.width) + " x " + std::to_string(size.height);
}

Features Extract(const std::string& path, const FeatureItem& item, const FeatureOptions& options) {
  const Bitmap bitmap = ReadBitmap(path, BitmapColor::kGray);
  const ImageSize size{bitmap.width, bitmap.height};
  if (size != item.camera_size) {
    throw IoError(path, "is " + Text(size) + " pixels, its camera " + Text(item.camera_size));
  }
  if (item.mask_path.empty()) return ExtractFeatures(bitmap, options);
  const Bitmap mask = ReadBitmap(item.mask_path, BitmapColor::kGray);
  return ExtractFeatures(bitmap, options, &mask);
}

void WriteFeatures(Database& database, const FeatureItem& item, const Features& features) {
  database.WriteKeypoints(item.image.image_id, features.keypoints);
  database.WriteDescriptors(item.image.image_id, features.descriptors);
  database.WriteJob(kStageFeatures, {item.image.image_id, item.input_hash, ""});
}

// The image leaves the database, with the reason in its photograph's record.
void WriteFailure(Database& database, const FeatureItem& item) {
  database.WritePhoto({item.image.name, item.file_hash, item.error});
  if (item.is_ours) database.DeleteImage(item.image.image_id);
}

}  // namespace

StageReport ExtractImageFeatures(Database& database, const FeatureSource& source,
                                 const FeatureOptions& options, const RunContext& run) {
  Stage stage(run.monitor, kStageFeatures);
  StageLedger ledger(database, kStageFeatures, DumpQualified("features", options));
  std::vector<FeatureItem> items;
  if (!source.mask_path.empty() && source.image_path.empty()) {
    throw ConfigError("mask_path", "needs --image_path");
  }
  if (!source.image_path.empty()) {
    const std::map<image_t, std::string> masks = FindMasks(database, source.mask_path, stage);
    if (!masks.empty()) ForgetChangedMasks(database, masks);
    items = FindItems(database, masks);
  }
  const size_t num_remarks = stage.NumMessages();
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
            Extract(PathInFolder(source.image_path, item.image.name), item, options);
        num_features += static_cast<int64_t>(features.keypoints.size());
        writer.Push([&item, features = std::make_shared<Features>(std::move(features))](
                        Database& db) { WriteFeatures(db, item, *features); });
      } catch (const IoError& error) {
        if (error.path() == item.mask_path) throw;
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
  const auto num_failed = static_cast<double>(stage.NumMessages() - num_remarks);
  stage.Add("images", database.ReadImages().size());
  stage.Add("images_with_features", database.ReadNumKeypoints().size());
  stage.Add("computed", static_cast<double>(items.size()) - num_failed);
  stage.Add("skipped", num_failed);
  stage.Add("new_features", num_features);
  return EndStage(stage, run, ledger, database);
}

}  // namespace cairn
