#include "cairn/depth/sample_depth.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/base/path_in_folder.h"
#include "cairn/base/timer.h"
#include "cairn/database/stage_names.h"
#include "cairn/depth/depth_map.h"
#include "cairn/depth/depth_network.h"
#include "cairn/image/bitmap.h"
#include "cairn/pipeline/stages.h"
#include "database/database_writer.h"
#include "pipeline/stages/content_hash.h"
#include "pipeline/stages/stage_ledger.h"
#include "pipeline/stages/stage_options.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct DepthItem {
  Image image;
  ImageSize size;
  std::string path;   // of the map, or of the photograph
  std::string error;  // why the image has no depth
};

void CheckSource(const Database& database, const std::string& image_path, const DepthSource& source,
                 const DepthOptions& options) {
  ValidateOptions(options, "depth");
  if (!source.depth_path.empty() && !source.depth_model.empty()) {
    throw ConfigError("depth_path", "and depth_model cannot be given together");
  }
  const char* key = source.depth_path.empty() ? "depth_model" : "depth_path";
  if (!source.depth_path.empty() && !fs::is_directory(source.depth_path)) {
    throw IoError(source.depth_path, "no such folder");
  }
  if (!source.depth_model.empty() && image_path.empty()) {
    throw ConfigError(key, "needs --image_path");
  }
  if (!database.ReadStage(kStageDepth) && !database.ReadJobs(kStageVerification).empty()) {
    throw ConfigError(key,
                      "the pairs in the database were verified without depth; use "
                      "--recompute verification");
  }
}

// Hash of what the image's depth samples are made from.
uint64_t InputHash(const Database& database, const DepthItem& item, uint64_t source_hash) {
  Hasher hasher;
  hasher.Add(source_hash);
  hasher.Add(item.path.empty() ? uint64_t{0} : HashFile(item.path));
  hasher.Add(HashKeypoints(*database.ReadKeypoints(item.image.image_id)));
  return hasher.Add(item.size.width).Add(item.size.height).Digest();
}

// The map, or the photograph for the network; or why there is none.
void FindFile(const std::string& image_path, const DepthSource& source, DepthItem& item) {
  try {
    if (!source.depth_path.empty()) {
      item.path = FindDepthMap(source.depth_path, item.image.name).value_or("");
      if (item.path.empty()) item.error = "no depth map";
    } else {
      item.path = PathInFolder(image_path, item.image.name);
      if (fs::exists(item.path)) return;
      item.path.clear();
      item.error = "no photograph";
    }
  } catch (const IoError& error) {
    item.error = error.reason();
  }
}

std::vector<DepthItem> ListImagesWithKeypoints(const Database& database,
                                               const std::string& image_path,
                                               const DepthSource& source) {
  std::map<camera_t, ImageSize> sizes;
  for (const Camera& camera : database.ReadCameras()) {
    sizes[camera.camera_id] = {camera.width, camera.height};
  }
  for (const UnknownCamera& camera : database.ReadUnknownCameras()) {
    sizes[camera.camera_id] = {camera.width, camera.height};
  }
  const std::map<image_t, int> num_keypoints = database.ReadNumKeypoints();
  std::vector<DepthItem> items;
  for (const Image& image : database.ReadImages()) {
    if (num_keypoints.count(image.image_id) == 0) continue;
    DepthItem item;
    item.image = image;
    item.size = sizes[image.camera_id];
    FindFile(image_path, source, item);
    items.push_back(std::move(item));
  }
  return items;
}

// The items that are to be computed, with the hashes of their inputs.
struct Work {
  std::vector<DepthItem> items;
  std::vector<uint64_t> hashes;
  std::vector<std::string> damaged;  // rows and files that cannot be read
};

Work FindWork(const Database& database, std::vector<DepthItem> items, const StageLedger& ledger,
              uint64_t source_hash) {
  const std::map<image_t, int> num_samples = database.ReadNumDepthSamples();
  Work work;
  for (DepthItem& item : items) {
    const JobRecord* job = ledger.Find(item.image.image_id);
    if (job == nullptr && num_samples.count(item.image.image_id) > 0) continue;  // Given.
    uint64_t hash = 0;
    try {
      hash = InputHash(database, item, source_hash);
    } catch (const IoError& error) {  // Keypoints or a map that cannot be read.
      work.damaged.push_back(error.what());
      continue;
    }
    if (job != nullptr && job->input_hash == hash) continue;
    // An image that had no depth may get it; depth that was there must not change.
    if (job != nullptr && job->note.empty()) {
      ledger.ThrowChanged("the depth source or the keypoints of " + item.image.name);
    }
    work.items.push_back(std::move(item));
    work.hashes.push_back(hash);
  }
  return work;
}

// Computes depth maps; the networks belong to a worker each.
class MapMaker {
 public:
  MapMaker(const DepthSource& source, const DepthOptions& options, int num_workers)
      : source_(source), options_(options), networks_(num_workers) {
    if (!source.depth_model.empty()) Network(0);  // A file that is no network ends the stage here.
  }

  DepthMap Make(int worker, const DepthItem& item) {
    if (source_.depth_model.empty()) return ReadDepthMap(item.path, options_);
    const Bitmap bitmap = ReadBitmap(item.path, BitmapColor::kRgb);
    return Network(worker).Compute(bitmap);
  }

 private:
  DepthNetwork& Network(int worker) {
    if (!networks_[worker]) {
      networks_[worker] = std::make_unique<DepthNetwork>(source_.depth_model, options_);
    }
    return *networks_[worker];
  }

  const DepthSource& source_;
  const DepthOptions& options_;
  std::vector<std::unique_ptr<DepthNetwork>> networks_;
};

// Throws IoError for a map that cannot be the image's. Maps may be smaller, or stretched, but
// turned by a right angle they are of another image, or in the wrong order.
void CheckShape(const DepthItem& item, const DepthMap& map) {
  constexpr double kMaxStretch = 1.1;  // of networks whose sides are multiples of 32
  const std::string text = std::to_string(map.width) + " x " + std::to_string(map.height);
  if (std::min(map.width, map.height) < 2) {
    throw IoError(item.path, "a map of " + text + " values has no gradient");
  }
  const double image_shape = static_cast<double>(item.size.width) / item.size.height;
  const double map_shape = static_cast<double>(map.width) / map.height;
  const auto is_like = [&](double shape) {
    return std::abs(std::log(shape / image_shape)) < std::log(kMaxStretch);
  };
  if (!is_like(map_shape) && is_like(1 / map_shape)) {
    throw IoError(item.path, "a map of " + text + " values for an image of " +
                                 std::to_string(item.size.width) + " x " +
                                 std::to_string(item.size.height) + " pixels: it is transposed");
  }
}

// One item, from its map to rows for the writer.
void ComputeItem(int worker, DepthItem& item, uint64_t hash, const DepthOptions& options,
                 const std::vector<Keypoint>& keypoints, MapMaker& maps, DatabaseWriter& writer) {
  std::vector<DepthSample> samples;
  if (item.error.empty()) {
    try {
      const DepthMap map = maps.Make(worker, item);
      CheckShape(item, map);
      samples = SampleDepth(map, item.size.width, item.size.height, keypoints, options.Windows());
    } catch (const IoError& error) {
      item.error = error.reason();
    }
  }
  const bool has_depth = item.error.empty();
  writer.Push([&item, hash, has_depth, samples = std::move(samples)](Database& db) {
    if (has_depth) db.WriteDepthSamples(item.image.image_id, samples);
    db.WriteJob(kStageDepth, {item.image.image_id, hash, item.error});
  });
}

}  // namespace

std::string DepthStageOptions(const DepthSource& source, const DepthOptions& options) {
  return DumpQualified("depth", options) + "depth_source = \"" +
         (source.depth_model.empty() ? "maps" : "network") + "\"\n";
}

StageReport SampleImageDepth(Database& database, const std::string& image_path,
                             const DepthSource& source, const DepthOptions& options,
                             const RunContext& run) {
  const Timer timer;
  StageReport report;
  report.name = kStageDepth;
  const bool has_source = !source.depth_path.empty() || !source.depth_model.empty();
  Work work;
  if (has_source) {
    CheckSource(database, image_path, source, options);
    StageLedger ledger(database, kStageDepth, DepthStageOptions(source, options));
    const uint64_t source_hash = source.depth_model.empty() ? 0 : HashFile(source.depth_model);
    work = FindWork(database, ListImagesWithKeypoints(database, image_path, source), ledger,
                    source_hash);
    if (!work.items.empty()) {
      ledger.Begin(database);
      DatabaseWriter writer(database.path());
      const int num_workers = EffectiveNumThreads(run.num_threads);
      MapMaker maps(source, options, num_workers);
      std::mutex read_mutex;
      run.monitor.BeginStage("sampling depth", static_cast<int64_t>(work.items.size()));
      ParallelForWorker(
          num_workers, static_cast<int64_t>(work.items.size()), [&](int worker, int64_t i) {
            if (run.monitor.StopRequested()) return;
            DepthItem& item = work.items[i];
            std::vector<Keypoint> keypoints;
            {
              const std::lock_guard<std::mutex> lock(read_mutex);
              keypoints = *database.ReadKeypoints(item.image.image_id);
            }
            ComputeItem(worker, item, work.hashes[i], options, keypoints, maps, writer);
            run.monitor.Advance(1);
          });
      writer.Finish();
      run.monitor.EndStage();
    }
    if (!run.monitor.StopRequested()) ledger.Complete(database);
  } else {
    report.status = StageStatus::kSkipped;
  }
  for (const DepthItem& item : work.items) {
    if (item.error.empty()) continue;
    report.messages.push_back(item.image.name + ": " + item.error + "; it has no depth");
    run.monitor.Warning(report.messages.back());
    report.status = StageStatus::kWarning;
  }
  for (const std::string& reason : work.damaged) {
    report.messages.push_back(reason + "; the image has no depth");
    run.monitor.Warning(report.messages.back());
    report.status = StageStatus::kWarning;
  }
  const size_t num_failed = report.messages.size() - work.damaged.size();
  if (has_source && run.monitor.StopRequested()) report.MarkStopped();
  report.Add("images_with_depth", static_cast<double>(database.ReadNumDepthSamples().size()));
  report.Add("computed", static_cast<double>(work.items.size() - num_failed));
  report.seconds = timer.Seconds();
  database.AddTiming(kStageDepth, 0, "", report.seconds);
  return report;
}

}  // namespace cairn
