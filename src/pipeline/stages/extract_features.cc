#include <atomic>
#include <map>
#include <mutex>
#include <set>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/image/bitmap.h"
#include "cairn/pipeline/stages.h"
#include "database/database_writer.h"
#include "database/stage_names.h"
#include "pipeline/machines/helpers.h"
#include "pipeline/stages/camera_sizes.h"
#include "pipeline/stages/extract_photo.h"
#include "pipeline/stages/failed_photo.h"
#include "pipeline/stages/masks.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

struct FeatureItem {
  Image image;
  ImageSize camera_size;
  FeatureInput input;
  bool is_ours = false;  // cairn added the image, so cairn may take it out again
  std::string error;
};

// Images without keypoints whose photograph is known.
std::vector<FeatureItem> FindItems(const Database& database,
                                   const std::map<image_t, FeatureInput>& inputs) {
  std::map<camera_t, ImageSize> sizes = CameraSizes(database);
  std::set<uint64_t> ours;
  for (const JobRecord& job : database.ReadJobs(kStageCameras)) ours.insert(job.item);
  const std::map<image_t, int> num_keypoints = database.ReadNumKeypoints();
  std::vector<FeatureItem> items;
  for (const Image& image : database.ReadImages()) {
    if (num_keypoints.count(image.image_id) > 0) continue;
    const auto input = inputs.find(image.image_id);
    if (input == inputs.end()) continue;
    items.push_back(
        {image, sizes[image.camera_id], input->second, ours.count(image.image_id) > 0, ""});
  }
  return items;
}

void WriteFeatures(Database& database, const FeatureItem& item, const Features& features) {
  database.WriteKeypoints(item.image.image_id, features.keypoints);
  database.WriteDescriptors(item.image.image_id, features.descriptors);
  database.WriteJob(kStageFeatures, {item.image.image_id, item.input.input_hash, ""});
}

// The image leaves the database, with the reason in its photograph's record.
void WriteFailure(Database& database, const std::string& folder, const FeatureItem& item) {
  database.WritePhoto(FailedPhoto(folder, {item.image.name, item.input.file_hash, item.error}));
  if (item.is_ours) database.DeleteImage(item.image.image_id);
}

// Extracts the features of all items, in the threads of this process and with helpers.
class FeatureWork {
 public:
  FeatureWork(const std::string& database_path, const std::string& image_path,
              const FeatureOptions& options, const RunContext& run, std::vector<FeatureItem>& items)
      : image_path_(image_path),
        options_(options),
        run_(run),
        items_(items),
        // An image's features are megabytes.
        writer_(database_path, DatabaseWriter::Options{.max_queue_size = 8}) {}

  // Returns the number of features.
  int64_t Run(Helpers* helpers) {
    HelperLoop loop(helpers, Work(), run_);
    ParallelFor(run_.num_threads, std::ssize(items_), [this](int64_t) {
      if (run_.monitor.StopRequested()) return;
      FeatureItem* const item = Next();
      if (item != nullptr) Compute(*item);
    });
    loop.Finish();
    writer_.Finish();
    return num_features_;
  }

 private:
  HelperWork Work() {
    HelperWork work;
    work.kind = TaskKind::kExtract;
    work.num_left = [this] { return std::ssize(items_) - next_; };
    work.add_next = [this](TaskBatch& batch) {
      FeatureItem* const item = Next();
      if (item == nullptr) return false;
      batch.Add(PhotoTask{static_cast<uint64_t>(item - items_.data()), PathsOf(*item),
                          item->camera_size, item->input.input_hash});
      return true;
    };
    work.accept = [this](ByteSource& result, const std::string& helper) {
      Accept(result.Get<PhotoResult>(), helper);
    };
    work.stop = [this] { next_ = std::ssize(items_); };
    return work;
  }

  PhotoPaths PathsOf(const FeatureItem& item) const {
    return {PathInFolder(image_path_, item.image.name), item.input.mask_path};
  }

  // nullptr: there are no more.
  FeatureItem* Next() {
    const int64_t i = next_++;
    return i < std::ssize(items_) ? &items_[i] : nullptr;
  }

  void Compute(FeatureItem& item) {
    try {
      Keep(item, ExtractPhoto(PathsOf(item), item.camera_size, options_));
    } catch (const IoError& error) {
      if (error.path() == item.input.mask_path) throw;
      item.error = error.reason();
      writer_.Push([this, &item](Database& db) { WriteFailure(db, image_path_, item); });
      run_.monitor.Advance(1);
    }
  }

  void Keep(FeatureItem& item, Features features) {
    num_features_ += std::ssize(features.keypoints);
    writer_.Push([&item, features = std::make_shared<Features>(std::move(features))](Database& db) {
      WriteFeatures(db, item, *features);
    });
    run_.monitor.Advance(1);
  }

  // A photograph that a helper cannot read may be damaged; but then this process cannot either.
  void Accept(PhotoResult result, const std::string& helper) {
    FeatureItem& item = items_[result.item];
    if (result.error.empty()) {
      Keep(item, std::move(result.features));
      return;
    }
    Compute(item);
    if (item.error.empty()) {
      throw IoError(helper, "cannot use " + PathInFolder(image_path_, item.image.name) +
                                ", which rank 0 can (" + result.error +
                                "); all machines need the same photographs at the same path");
    }
  }

  const std::string& image_path_;
  const FeatureOptions& options_;
  const RunContext& run_;
  std::vector<FeatureItem>& items_;
  DatabaseWriter writer_;
  std::atomic<int64_t> next_ = 0;
  std::atomic<int64_t> num_features_ = 0;
};

}  // namespace

Features ExtractPhoto(const PhotoPaths& photo, const ImageSize& camera_size,
                      const FeatureOptions& options) {
  const Bitmap bitmap = ReadBitmap(photo.path, BitmapColor::kGray);
  const ImageSize size{bitmap.width, bitmap.height};
  if (size != camera_size) {
    throw IoError(photo.path,
                  "is " + SizeText(size) + " pixels, its camera " + SizeText(camera_size));
  }
  if (photo.mask_path.empty()) return ExtractFeatures(bitmap, options);
  const Bitmap mask = ReadBitmap(photo.mask_path, BitmapColor::kGray);
  return ExtractFeatures(bitmap, options, &mask);
}

StageReport ExtractImageFeatures(Database& database, const FeatureSource& source,
                                 const FeatureOptions& options, const RunContext& run,
                                 Helpers* helpers) {
  Stage stage(run.monitor, kStageFeatures);
  StageLedger ledger(database, kStageFeatures, DumpQualified("features", options));
  std::vector<FeatureItem> items;
  if (!source.mask_path.empty() && source.image_path.empty()) {
    throw ConfigError("mask_path", "needs --image_path");
  }
  if (!source.image_path.empty()) {
    const auto inputs = FindFeatureInputs(database, source.mask_path, stage);
    if (!source.mask_path.empty()) ForgetChangedFeatures(database, inputs);
    items = FindItems(database, inputs);
  }
  const size_t num_remarks = stage.NumMessages();
  int64_t num_features = 0;
  if (!items.empty()) {
    ledger.Begin(database);
    run.monitor.BeginStage("extracting features", std::ssize(items));
    num_features =
        FeatureWork(database.path(), source.image_path, options, run, items).Run(helpers);
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
