#include <algorithm>
#include <filesystem>
#include <mutex>
#include <optional>

#include "base/hash.h"
#include "base/output_folder.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/image/image_folder.h"
#include "cairn/image/resample.h"
#include "cairn/io/colmap_model.h"
#include "cairn/undistortion/undistort.h"
#include "image/codecs.h"
#include "undistortion/image_ledger.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr char kWriter[] = "undistort";
// Changes with every change of what an image's pixels are.
constexpr int kPixelsVersion = 3;
constexpr int kJpegQuality = 95;
// All that a run writes but images. What dense stereo writes into stereo/ later is its own.
const std::vector<std::string> kResultNames = {"sparse", "stereo/patch-match.cfg",
                                               "stereo/fusion.cfg", "effective.toml"};

// An image of the model on its way.
struct Item {
  image_t image_id = kInvalidImageId;
  std::string name;       // of the photograph
  std::string file_name;  // of the image in images/ and in the model
  const Camera* source = nullptr;
  const Camera* target = nullptr;
  std::string photo_path, file_path;
  std::string present_hash;  // of the file that is there; "": none
  ImageLedger::Entry entry;  // once it is done
  bool is_kept = false;      // it was done before
  std::string error;         // why there is none
};

std::string HashInputs(const Item& item, DenseLayout layout) {
  Hasher hasher;
  hasher.Add(HashFile(item.photo_path)).Add(kPixelsVersion).Add(kJpegQuality);
  hasher.Add(static_cast<int>(layout));
  for (const Camera* camera : {item.source, item.target}) {
    hasher.Add(static_cast<int>(camera->model)).Add(camera->width).Add(camera->height);
    for (const double param : camera->params) hasher.Add(param);
  }
  return HashToHex(hasher.Digest());
}

// The bytes of the undistorted image's file. Opacity, where the photograph has it, is for trainers
// of Gaussian splatting, which leave out what is transparent.
std::string Undistort(const Item& item, DenseLayout layout) {
  const Bitmap photo = ReadBitmap(item.photo_path, BitmapColor::kRgb);
  const Camera& camera = *item.source;
  const ImageSize size{photo.width, photo.height}, camera_size{camera.width, camera.height};
  if (size != camera_size) {
    throw IoError(item.photo_path,
                  "is " + SizeText(size) + " pixels, its camera " + SizeText(camera_size));
  }
  if (std::max(photo.width, photo.height) > kMaxResampledSide) {
    throw IoError(item.photo_path,
                  "has more than " + std::to_string(kMaxResampledSide) + " pixels on a side");
  }
  std::optional<Bitmap> opacity;
  if (layout == DenseLayout::kGaussianSplatting) opacity = ReadOpacity(item.photo_path);
  if (opacity) opacity = ResampleBitmap(*opacity, camera, *item.target);
  const std::vector<uint8_t> bytes = EncodeImage(item.photo_path, LowerCaseExtension(item.name),
                                                 ResampleBitmap(photo, camera, *item.target),
                                                 kJpegQuality, opacity ? &*opacity : nullptr);
  return {bytes.begin(), bytes.end()};
}

// Throws ConfigError where the model that is undistorted would be replaced by its result.
void CheckModelStays(const UndistortJob& job) {
  if (job.model_path.empty()) return;
  if (!IsInFolder(job.model_path, job.output_path + "/sparse")) return;
  throw ConfigError("output_path", job.output_path +
                                       " holds the model that is undistorted, which would be lost; "
                                       "give another --output_path");
}

// Throws ConfigError where the photograph is in the folder of the undistorted images: each of these
// would be taken for another photograph, or replace one.
void CheckPhotographsStay(const UndistortJob& job, const Item& item) {
  const std::string images = job.output_path + "/images";
  if (!IsInFolder(fs::path(item.photo_path).parent_path().string(), images)) return;
  throw ConfigError("output_path", "undistorted images would be among the photographs in " +
                                       images + "; give another --output_path");
}

// One run: the images, and the folder they are written to.
class DenseFolder {
 public:
  DenseFolder(const UndistortJob& job)
      : job_(job),
        results_(std::in_place, job.output_path, kWriter, kResultNames, job.overwrites),
        ledger_((fs::path(job.output_path) / kUndistortedImages).string()) {}

  // Throws ConfigError where the item's file is somebody else's.
  void Check(Item& item) const;
  // Fills the item's entry, and writes the image unless it is there.
  void Write(Item& item);
  // Puts the model in place, and removes images that are not the result any more.
  void Finish(const std::vector<Item>& items, const Reconstruction& model);

 private:
  void RemoveModel();
  void WriteStereo(const Reconstruction& model) const;

  const UndistortJob& job_;
  std::optional<OutputFolder> results_;
  ImageLedger ledger_;
  std::once_flag model_is_removed_;
};

void DenseFolder::Check(Item& item) const {
  CheckPhotographsStay(job_, item);
  std::error_code ignored;
  if (!fs::exists(fs::symlink_status(item.file_path, ignored))) return;
  item.present_hash = HashToHex(HashFile(item.file_path));
  if (job_.overwrites || ledger_.IsOurs(item.file_name, item.present_hash)) return;
  throw ConfigError("output_path", item.file_path +
                                       " is not as cairn wrote it and would be replaced; give "
                                       "another folder, or --overwrite");
}

void DenseFolder::Write(Item& item) {
  item.entry = {HashInputs(item, job_.layout), item.present_hash};
  item.is_kept = !item.present_hash.empty() && ledger_.Has(item.file_name, item.entry);
  if (item.is_kept) return;
  const std::string bytes = Undistort(item, job_.layout);
  item.entry.file_hash = HashToHex(Hasher().AddBytes(bytes.data(), bytes.size()).Digest());
  std::call_once(model_is_removed_, [this] { RemoveModel(); });
  CreateFolders(fs::path(item.file_path).parent_path().string());
  ledger_.Add(item.file_name, item.entry);
  WriteFileAtomically(item.file_path, bytes);
}

// While images change, no model is there that would not fit them.
void DenseFolder::RemoveModel() {
  if (results_) results_->Commit();  // (Not where a thread before this one ended here.)
  results_.reset();
  results_.emplace(job_.output_path, kWriter, kResultNames, job_.overwrites);
}

void DenseFolder::WriteStereo(const Reconstruction& model) const {
  std::string patch_match, fusion;
  for (const auto& [id, image] : model.images) {
    patch_match += image.image.name + "\n__auto__, 20\n";
    fusion += image.image.name + "\n";
    for (const char* folder : {"depth_maps", "normal_maps", "consistency_graphs"}) {
      const fs::path file = fs::path(job_.output_path) / "stereo" / folder / image.image.name;
      CreateFolders(file.parent_path().string());
    }
  }
  const std::string folder = results_->staging() + "/stereo";
  CreateFolders(folder);
  WriteFileAtomically(folder + "/patch-match.cfg", patch_match);
  WriteFileAtomically(folder + "/fusion.cfg", fusion);
}

void DenseFolder::Finish(const std::vector<Item>& items, const Reconstruction& model) {
  const std::string staging = results_->staging();
  const bool is_colmap = job_.layout == DenseLayout::kColmap;
  WriteColmapModel(model, staging + (is_colmap ? "/sparse" : "/sparse/0"));
  if (is_colmap) WriteStereo(model);
  if (!job_.effective_toml.empty()) {
    WriteFileAtomically(staging + "/effective.toml", job_.effective_toml);
  }
  results_->Commit();
  std::map<std::string, ImageLedger::Entry> entries;
  for (const Item& item : items) {
    if (item.error.empty()) entries[item.file_name] = item.entry;
  }
  for (const std::string& name : ledger_.Names()) {
    const fs::path file = PathInFolder((fs::path(job_.output_path) / "images").string(), name);
    if (entries.contains(name) || !fs::is_regular_file(file)) continue;
    if (ledger_.IsOurs(name, HashToHex(HashFile(file.string())))) fs::remove(file);
  }
  ledger_.Keep(entries);
}

// Trainers of Gaussian splatting take the last part of a name alone, so that images of folders of
// their own would not be found, or taken for each other.
std::map<image_t, std::string> FileNames(const Reconstruction& model, DenseLayout layout) {
  std::map<image_t, std::string> names;
  std::set<std::string> taken;
  for (const auto& [id, image] : model.images) {
    std::string name = image.image.name;
    if (layout == DenseLayout::kGaussianSplatting) std::replace(name.begin(), name.end(), '/', '_');
    while (!taken.insert(name).second) name = std::to_string(id) + "_" + name;
    names[id] = name;
  }
  return names;
}

std::vector<Item> MakeItems(const Reconstruction& model, const UndistortJob& job,
                            const std::map<camera_t, Camera>& targets) {
  std::vector<Item> items;
  const std::map<image_t, std::string> file_names = FileNames(model, job.layout);
  for (const auto& [id, image] : model.images) {
    Item& item = items.emplace_back();
    item.image_id = id;
    item.name = image.image.name;
    item.file_name = file_names.at(id);
    item.source = &model.CameraOf(image);
    item.target = &targets.at(item.source->camera_id);
    item.photo_path = PathInFolder(job.image_path, item.name);
    item.file_path = PathInFolder((fs::path(job.output_path) / "images").string(), item.file_name);
  }
  return items;
}

UndistortReport MakeReport(const std::vector<Item>& items, bool was_stopped) {
  UndistortReport report;
  report.was_stopped = was_stopped;
  for (const Item& item : items) {
    if (!item.error.empty()) {
      report.failed[item.name] = item.error;
    } else if (!item.entry.input_hash.empty()) {
      ++(item.is_kept ? report.num_kept : report.num_written);
    }
  }
  return report;
}

}  // namespace

UndistortReport UndistortImages(const Reconstruction& model, const UndistortJob& job,
                                const UndistortOptions& given, const RunContext& run) {
  ValidateOptions(given, "");
  UndistortOptions options = given;
  if (job.layout == DenseLayout::kGaussianSplatting) options.center_principal_point = true;
  CheckModelStays(job);
  CheckImageFolder(job.image_path);
  std::map<camera_t, Camera> targets;
  for (const auto& [id, image] : model.images) {
    const Camera& camera = model.CameraOf(image);
    if (targets.contains(camera.camera_id)) continue;
    // (Of a larger one, Undistort says so.)
    const bool is_too_large = std::max(camera.width, camera.height) > kMaxResampledSide;
    targets[camera.camera_id] = is_too_large ? camera : UndistortedCamera(camera, options);
  }
  std::vector<Item> items = MakeItems(model, job, targets);
  const auto num_items = static_cast<int64_t>(items.size());
  DenseFolder folder(job);
  ParallelFor(run.num_threads, num_items, [&](int64_t i) { folder.Check(items[i]); });
  run.monitor.BeginStage("undistorting", num_items);
  ParallelFor(run.num_threads, num_items, [&](int64_t i) {
    if (run.monitor.StopRequested()) return;
    try {
      folder.Write(items[i]);
    } catch (const IoError& error) {
      if (error.path() != items[i].photo_path) throw;
      items[i].error = error.reason();
      items[i].entry = {};
    }
    run.monitor.Advance(1);
  });
  run.monitor.EndStage();
  UndistortReport report = MakeReport(items, run.monitor.StopRequested());
  if (report.was_stopped || report.num_written + report.num_kept == 0) return report;
  std::set<std::string> names;
  for (const Item& item : items) {
    if (item.error.empty()) names.insert(item.name);
  }
  Reconstruction undistorted = UndistortedModel(model, names, options, run);
  for (const Item& item : items) {
    const auto image = undistorted.images.find(item.image_id);
    if (image != undistorted.images.end()) image->second.image.name = item.file_name;
  }
  folder.Finish(items, undistorted);
  return report;
}

}  // namespace cairn
