#include <algorithm>
#include <map>
#include <set>

#include "base/memory.h"
#include "base/text.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/image/bitmap.h"
#include "cairn/pipeline/stages.h"
#include "database/database_writer.h"
#include "database/stage_names.h"
#include "features/plane_memory.h"
#include "pipeline/machines/helpers.h"
#include "pipeline/stages/camera_maker.h"
#include "pipeline/stages/foreign_features.h"
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
  std::optional<int64_t> num_features = {};  // nullopt: the run was stopped before
};

struct FeatureWork {
  std::string image_path;  // the folder
  std::vector<FeatureItem> items;
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
    if (num_keypoints.contains(image.image_id)) continue;
    const auto input = inputs.find(image.image_id);
    if (input == inputs.end()) continue;
    items.push_back(
        {image, sizes[image.camera_id], input->second, ours.contains(image.image_id), ""});
  }
  return items;
}

void WriteFeatures(Database& database, const FeatureItem& item, const Features& features) {
  database.WriteKeypoints(item.image.image_id, features.keypoints);
  database.WriteDescriptors(item.image.image_id, features.descriptors, features.polarities);
  database.WriteJob(kStageFeatures, {item.image.image_id, item.input.input_hash, ""});
}

// The image leaves the database, with the reason in its photograph's record.
void WriteFailure(Database& database, const std::string& folder, const FeatureItem& item) {
  database.WritePhoto(FailedPhoto(folder, {item.image.name, item.input.file_hash, item.error}));
  if (!item.is_ours) return;
  database.DeleteJob(kStageCameras, item.image.image_id);
  database.DeleteImage(item.image.image_id);
}

// Threads for whose photographs there is memory: the largest ones side by side, and those of the
// other ranks on this machine.
int NumExtractingThreads(const FeatureOptions& options, const std::vector<FeatureItem>& items,
                         const Helpers* helpers, const RunContext& run) {
  int64_t most_bytes = 1;
  for (const FeatureItem& item : items) {
    most_bytes = std::max(most_bytes, ExtractionBytes(item.camera_size, options));
  }
  const int num_threads = EffectiveNumThreads(run.num_threads);
  int64_t available = ReadMemoryUse().available;
  if (available < 0) return num_threads;
  if (helpers != nullptr) available /= helpers->NumOnThisMachine();
  const auto num = static_cast<int>(std::clamp<int64_t>(available / most_bytes, 1, num_threads));
  if (num < num_threads) {
    run.monitor.Info(
        Formatted("features by %d of %d threads: there is no memory for more", num, num_threads));
  }
  return num;
}

// Extracts the features of all items, here and by helpers.
void ExtractAll(const std::string& database_path, const FeatureOptions& options, RunContext run,
                Helpers* helpers, FeatureWork& work) {
  const std::string& image_path = work.image_path;
  std::vector<FeatureItem>& items = work.items;
  run.num_threads = NumExtractingThreads(options, items, helpers, run);
  const PlaneReuse reuse;
  DatabaseWriter writer(database_path, {.max_queue_size = 8});  // an image's features are megabytes
  const auto finish = [&](FeatureItem& item, Features features) {
    item.num_features = std::ssize(features.keypoints);
    writer.Push([&, features = std::make_shared<Features>(std::move(features))](Database& db) {
      item.error.empty() ? WriteFeatures(db, item, *features) : WriteFailure(db, image_path, item);
    });
    run.monitor.Advance(1);
  };
  const auto extract = [&](const PhotoTask& task) {
    PhotoResult result{task.item, "", {}};
    try {
      result.features = ExtractPhoto(task.photo, task.camera_size, options);
    } catch (const IoError& error) {
      if (error.path() == task.photo.mask_path) throw;
      result.error = error.reason();
    }
    return result;
  };
  std::vector<PhotoTask> tasks(items.size());
  WorkQueue<PhotoTask> queue;
  for (size_t i = 0; i < items.size(); ++i) {
    const FeatureInput& input = items[i].input;
    try {
      tasks[i] = {i,
                  {PathInFolder(image_path, items[i].image.name), input.mask_path},
                  items[i].camera_size,
                  input.input_hash};
      queue.Push(tasks[i]);
    } catch (const IoError& error) {
      items[i].error = error.reason();
      finish(items[i], {});
    }
  }
  queue.Finish();
  ForEachTask<PhotoResult>(
      TaskKind::kExtract, queue, helpers, run,
      [&](int, const PhotoTask& task) { return extract(task); },
      [&](PhotoResult result, const std::string& helper) {
        // A photograph that a helper cannot read may be damaged; but then this process cannot
        // either.
        if (!result.error.empty() && !helper.empty()) {
          const std::string error = std::exchange(result, extract(tasks[result.item])).error;
          if (result.error.empty()) {
            throw IoError(helper, "cannot use " + tasks[result.item].photo.path +
                                      ", which rank 0 can (" + error +
                                      "); all machines need the same photographs at the same path");
          }
        }
        items[result.item].error = result.error;
        finish(items[result.item], std::move(result.features));
      });
  writer.Finish();
}

void RemarkOnImagesWithoutFeatures(const std::vector<FeatureItem>& items, bool has_masks,
                                   Stage& stage) {
  std::vector<std::string> names;
  for (const FeatureItem& item : items) {
    if (item.error.empty() && item.num_features == 0) names.push_back(item.image.name);
  }
  if (names.empty()) return;
  stage.Warn(ResultWarning{
      "no features in " + std::to_string(names.size()) + " photographs: " + FirstNames(names),
      has_masks ? "look at their masks: black is left out"
                : "look at them: have they any detail?"});
}

void RemarkOnForeignSift(const FeatureOptions& options, Stage& stage) {
  const std::string what = "the database has another program's SIFT features; ";
  if (options.type == FeatureType::kSift) {
    stage.Note(what + "new photographs get such features, too (features.type sift)");
  } else {
    stage.Warn(ResultWarning{what + "those of new photographs match them less",
                             "use --features.type sift"});
  }
}

}  // namespace

StageReport ExtractImageFeatures(Database& database, const FeatureSource& source,
                                 const FeatureOptions& options, const RunContext& run,
                                 Helpers* helpers) {
  Stage stage(run.monitor, kStageFeatures);
  StageLedger ledger(database, kStageFeatures, DumpQualified("features", options));
  FeatureWork work{source.image_path, {}};
  if (!source.image_path.empty()) {
    const auto inputs = FindFeatureInputs(database, source.mask_path, stage);
    if (!source.mask_path.empty()) ForgetChangedFeatures(database, inputs);
    work.items = FindItems(database, inputs);
  }
  if (!work.items.empty()) {
    if (HasForeignSift(database)) RemarkOnForeignSift(options, stage);
    ledger.Begin(database);
    run.monitor.BeginStage("extracting features", std::ssize(work.items));
    ExtractAll(database.path(), options, run, helpers, work);
    run.monitor.EndStage();
  }
  std::vector<std::string> skipped;
  int64_t num_computed = 0, num_features = 0;
  for (const FeatureItem& item : work.items) {
    if (!item.error.empty()) {
      skipped.push_back(item.image.name + ": " + item.error + "; skipped");
    } else if (item.num_features) {
      ++num_computed;
      num_features += *item.num_features;
    }
  }
  stage.WarnEach(skipped);
  stage.Add("images", database.ReadImages().size());
  stage.Add("images_with_features",
            std::ranges::count_if(database.ReadNumKeypoints(),
                                  [](const auto& of) { return of.second > 0; }));
  stage.Add("computed", num_computed);
  stage.Add("skipped", skipped.size());
  stage.Add("new_features", num_features);
  RemarkOnImagesWithoutFeatures(work.items, !source.mask_path.empty(), stage);
  return EndStage(stage, run, ledger, database);
}

}  // namespace cairn
