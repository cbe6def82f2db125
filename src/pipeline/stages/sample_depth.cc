#include "cairn/depth/sample_depth.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/depth/depth_network.h"
#include "cairn/image/bitmap.h"
#include "cairn/pipeline/stages.h"
#include "database/database_writer.h"
#include "database/stage_names.h"
#include "pipeline/stages/camera_maker.h"
#include "pipeline/stages/depth_source.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct DepthItem {
  Image image;
  ImageSize size;
  std::string path;                               // of the map, or of the photograph
  std::string error;                              // why the image has no depth
  uint64_t input_hash = 0;                        // of what its samples are made from
  std::vector<image_pair_t> verified_pairs = {};  // without its depth
  bool is_sampled = false;
};

// Hash of what the image's depth samples are made from.
uint64_t InputHash(const Database& database, const DepthItem& item, uint64_t source_hash) {
  Hasher hasher;
  hasher.Add(source_hash);
  hasher.Add(item.path.empty() ? uint64_t{0} : HashFile(item.path));
  hasher.Add(HashValues(*database.ReadKeypoints(item.image.image_id)));
  return hasher.Add(item.size.width).Add(item.size.height).Digest();
}

// The map, or the photograph for the network; or why there is none.
void FindFile(const std::string& image_path, const DepthSource& source, DepthItem& item) {
  try {
    if (!source.depth_path.empty()) {
      item.path = FindDepthMap(source.depth_path, item.image.name).value_or("");
      if (item.path.empty()) {
        item.error = "no depth map in " + source.depth_path + " (" + item.image.name + ".npy, ...)";
      }
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

// The images that are to be computed. Rows and files that cannot be read are reported.
std::vector<DepthItem> FindWork(const Database& database, const std::string& image_path,
                                const DepthSource& source, const StageLedger& ledger,
                                Stage& stage) {
  const uint64_t source_hash = source.depth_model.empty() ? 0 : HashFile(source.depth_model);
  const std::map<camera_t, ImageSize> sizes = CameraSizes(database);
  const std::map<image_t, int> num_keypoints = database.ReadNumKeypoints();
  const std::map<image_t, int> num_samples = database.ReadNumDepthSamples();
  std::vector<DepthItem> work;
  for (const Image& image : database.ReadImages()) {
    if (!num_keypoints.contains(image.image_id)) continue;
    const JobRecord* job = ledger.Find(image.image_id);
    if (job == nullptr && num_samples.contains(image.image_id)) continue;  // Given.
    const auto size = sizes.find(image.camera_id);
    if (size == sizes.end()) {
      stage.Warn(image.name + ": the database has no usable camera " +
                 std::to_string(image.camera_id) + "; it has no depth");
      continue;
    }
    DepthItem item;
    item.image = image;
    item.size = size->second;
    FindFile(image_path, source, item);
    if (!item.error.empty() && num_samples.contains(image.image_id)) continue;  // They stay.
    try {
      item.input_hash = InputHash(database, item, source_hash);
    } catch (const IoError& error) {  // Keypoints or a map that cannot be read.
      stage.Warn(std::string(error.what()) + "; " + image.name + " has no depth");
      continue;
    }
    if (job != nullptr && job->input_hash == item.input_hash) continue;
    // An image that had no depth may get it; depth that was there must not change.
    if (job != nullptr && job->note.empty()) {
      ledger.ThrowChanged("the depth source or the keypoints of " + image.name);
    }
    work.push_back(std::move(item));
  }
  return work;
}

// Pairs that we verified without the depth that an image gets only now.
void FindVerifiedPairs(const Database& database, std::vector<DepthItem>& items) {
  std::map<image_t, DepthItem*> late;
  for (DepthItem& item : items) late[item.image.image_id] = &item;
  for (const JobRecord& job : database.ReadJobs(kStageVerification)) {
    const auto [id1, id2] = PairIdToImagePair(job.item);
    for (const image_t id : {id1, id2}) {
      if (const auto item = late.find(id); item != late.end()) {
        item->second->verified_pairs.push_back(job.item);
      }
    }
  }
}

// With the pairs of an image that was without depth: they are verified again, with it.
void WriteSamples(Database& database, const DepthItem& item,
                  const std::vector<DepthSample>& samples) {
  database.WriteDepthSamples(item.image.image_id, samples);
  for (const image_pair_t pair : item.verified_pairs) {
    database.DeletePairResults(pair);
    database.DeleteFocalEvidence(pair);
    database.DeleteJob(kStageVerification, pair);
  }
}

// Computes depth maps and samples them; the networks belong to a worker each.
class DepthSampler {
 public:
  DepthSampler(const DepthSource& source, const DepthOptions& options, int num_workers)
      : source_(source), options_(options), networks_(num_workers) {}

  // None, with item.error set, where the map cannot be had.
  std::vector<DepthSample> Sample(int worker, const std::vector<Keypoint>& keypoints,
                                  DepthItem& item) {
    if (!item.error.empty()) return {};
    try {
      const DepthMap map = Map(worker, item.path);
      const std::string fault = FaultOfMapSize({map.width, map.height}, item.size);
      if (!fault.empty()) throw IoError(item.path, fault);
      return SampleDepth(map, item.size.width, item.size.height, keypoints, options_);
    } catch (const IoError& error) {
      if (error.path() == source_.depth_model) throw;  // It runs on no photograph.
      item.error = error.what();
      return {};
    }
  }

 private:
  DepthMap Map(int worker, const std::string& path) {
    if (source_.depth_model.empty()) return ReadDepthMap(path, options_);
    return Network(worker).Compute(ReadBitmap(path, BitmapColor::kRgb));
  }

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

bool CanBeRead(const std::string& path) {
  try {
    HashFile(path);
    return true;
  } catch (const IoError&) {
    return false;
  }
}

void SampleItems(Database& database, const RunContext& run, DepthSampler& sampler,
                 std::vector<DepthItem>& items) {
  DatabaseWriter writer(database.path());
  std::mutex read_mutex;
  run.monitor.BeginStage("sampling depth", std::ssize(items));
  const auto compute = [&](int worker, int64_t i) {
    if (run.monitor.StopRequested()) return;
    DepthItem& item = items[i];
    std::vector<Keypoint> keypoints;
    {
      const std::lock_guard<std::mutex> lock(read_mutex);
      keypoints = *database.ReadKeypoints(item.image.image_id);
    }
    std::vector<DepthSample> samples = sampler.Sample(worker, keypoints, item);
    item.is_sampled = item.error.empty();
    writer.Push([&item, samples = std::move(samples)](Database& db) {
      if (item.is_sampled) WriteSamples(db, item, samples);
      // What cannot be read may be there again the next time.
      const bool is_gone = !item.path.empty() && !item.is_sampled && !CanBeRead(item.path);
      if (!is_gone) db.WriteJob(kStageDepth, {item.image.image_id, item.input_hash, item.error});
    });
    run.monitor.Advance(1);
  };
  ParallelForWorker(run.num_threads, std::ssize(items), compute);
  writer.Finish();
  run.monitor.EndStage();
}

void AddCounts(const Database& database, const std::vector<DepthItem>& items, Stage& stage) {
  stage.Add("images_with_depth", database.ReadNumDepthSamples().size());
  stage.Add("computed", std::ranges::count(items, true, &DepthItem::is_sampled));
}

void TellOfEach(const std::vector<DepthItem>& items, Stage& stage) {
  std::vector<std::string> failures, late;
  for (const DepthItem& item : items) {
    if (!item.error.empty()) {
      failures.push_back(item.image.name + ": " + item.error + "; it has no depth");
    } else if (item.is_sampled && !item.verified_pairs.empty()) {
      late.push_back(item.image.name + " has depth now; its pairs are verified again");
    }
  }
  stage.NoteEach(late);
  stage.WarnEach(failures);
  if (!failures.empty()) {
    stage.Warn(ResultWarning{"no depth for " + std::to_string(failures.size()) + " photos", ""});
  }
}

}  // namespace

std::string DepthStageOptions(const DepthSource& source, const DepthOptions& options) {
  return DumpQualified("depth", options) + "depth_source = \"" +
         (source.depth_model.empty() ? "maps" : "network") + "\"\n";
}

void CheckDepthSource(const std::string& image_path, const DepthSource& source,
                      const DepthOptions& options) {
  ValidateOptions(options, "depth");
  if (!source.depth_path.empty() && !source.depth_model.empty()) {
    throw ConfigError("depth_path", "and depth_model cannot be given together");
  }
  if (!source.depth_path.empty() && !fs::is_directory(source.depth_path)) {
    throw IoError(source.depth_path, "no such folder");
  }
  if (source.depth_model.empty()) return;
  if (image_path.empty()) throw ConfigError("depth_model", "needs --image_path");
  // (Only a run tells whether it takes this size.)
  DepthNetwork(source.depth_model, options).Compute({32, 32, 3, std::vector<uint8_t>(32 * 32 * 3)});
}

void CheckDepthIsInTime(const Database& database, const DepthSource& source) {
  if (source.depth_path.empty() && source.depth_model.empty()) return;
  if (database.ReadStage(kStageDepth) || database.ReadJobs(kStageVerification).empty()) return;
  throw ConfigError(source.depth_path.empty() ? "depth_model" : "depth_path",
                    "the pairs in the database were verified without depth; use "
                    "--recompute verification");
}

void CheckDepthMaps(const Database& database, const std::string& depth_path) {
  const std::vector<Image> images = database.ReadImages();
  if (depth_path.empty() || images.empty() || !database.ReadNumDepthSamples().empty()) return;
  const bool has_any = std::ranges::any_of(images, [&](const Image& image) {
    return StaysInFolder(image.name) && FindDepthMap(depth_path, image.name);
  });
  if (has_any) return;
  throw ConfigError("depth_path", depth_path + " has no depth map of any image: there is no " +
                                      images.front().name + ".npy, .pfm, .png or .bin");
}

StageReport SampleImageDepth(Database& database, const std::string& image_path,
                             const DepthSource& source, const DepthOptions& options,
                             const RunContext& run) {
  Stage stage(run.monitor, kStageDepth);
  if (source.depth_path.empty() && source.depth_model.empty()) {
    stage.MarkSkipped();
    AddCounts(database, {}, stage);
    return EndStage(stage, database);
  }
  StageLedger ledger(database, kStageDepth, DepthStageOptions(source, options));
  std::vector<DepthItem> items = FindWork(database, image_path, source, ledger, stage);
  if (!items.empty()) {
    FindVerifiedPairs(database, items);
    ledger.Begin(database);
    DepthSampler sampler(source, options, EffectiveNumThreads(run.num_threads));
    SampleItems(database, run, sampler, items);
  }
  TellOfEach(items, stage);
  AddCounts(database, items, stage);
  return EndStage(stage, run, ledger, database);
}

}  // namespace cairn
