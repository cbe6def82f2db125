#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "base/hash.h"
#include "base/text.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/image/bitmap.h"
#include "cairn/image/image_folder.h"
#include "cairn/pipeline/stages.h"
#include "cairn/scene/image.h"
#include "database/stage_names.h"
#include "pipeline/stages/camera_maker.h"
#include "pipeline/stages/given_camera.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

std::vector<Photo> ListPhotos(const PhotoSource& source) {
  std::vector<Photo> photos;
  if (source.image_path.empty()) return photos;
  if (source.selection) {
    for (const PhotoSource::Photo& photo : *source.selection) {
      photos.emplace_back().name = photo.name;
      photos.back().given_focal_px = photo.focal_px;
    }
    std::ranges::sort(photos, {}, &Photo::name);
  } else {
    for (std::string& name : ListImages(source.image_path, source.other_paths)) {
      photos.emplace_back().name = std::move(name);
    }
  }
  for (Photo& photo : photos) {
    if (!IsImageName(photo.name)) photo.error = "no model can hold a name with a line break";
  }
  return photos;
}

// What the user may take for part of the run, and is not.
void RemarkOnUnread(const PhotoSource& source, Stage& stage) {
  const std::vector<std::string> unread = ListUnreadImages(source.image_path, source.other_paths);
  if (unread.empty()) return;
  stage.Warn("not read, since their format is not known: " + FirstNames(unread));
}

// Notices images that were imported and are no longer in the folder; takes them out if told to.
// Returns how many it took out.
size_t HandleMissing(Database& database, const PhotoSource& source,
                     const std::vector<Photo>& photos, Stage& stage) {
  std::set<std::string> present, imported;
  for (const Photo& photo : photos) present.insert(photo.name);
  for (const PhotoRecord& record : database.ReadPhotos()) imported.insert(record.name);
  std::vector<std::string> names, foreign;  // of other programs
  std::set<image_t> missing;
  bool any_is_there = std::ranges::any_of(
      imported, [&](const std::string& name) { return present.count(name) > 0; });
  for (const Image& image : database.ReadImages()) {
    if (present.contains(image.name)) {
      any_is_there = true;
    } else if (source.drop_missing || imported.contains(image.name)) {
      names.push_back(image.name);
      missing.insert(image.image_id);
    } else {
      foreign.push_back(image.name);
    }
  }
  if (!foreign.empty()) {
    stage.Warn(ResultWarning{source.image_path + " has no files of the names of " +
                                 std::to_string(foreign.size()) +
                                 " images of the database: " + FirstNames(foreign, 3),
                             "is it the folder that their names are relative to?"});
  }
  if (missing.empty()) return 0;
  const std::string what = source.image_path + " no longer has " + std::to_string(names.size()) +
                           " photographs of the database: " + FirstNames(names);
  if (!source.drop_missing) {
    stage.Warn(what +
               "; their features and pairs stay in it, and in models (--drop_missing takes them "
               "out)");
    return 0;
  }
  if (!any_is_there) {
    throw ConfigError("drop_missing",
                      source.image_path +
                          " has none of the photographs of the database, which would lose all; is "
                          "it their folder?");
  }
  Database::Transaction transaction(database);
  database.DeleteImagesAndPairs(missing);
  // What they joined may need other pairs: these are chosen for all that stay.
  for (const JobRecord& job : database.ReadJobs(kStagePairs)) {
    database.DeleteJob(kStagePairs, job.item);
  }
  transaction.Commit();
  stage.Warn(what + "; taken out of it, with their pairs");
  return missing.size();
}

// Forgets images whose photographs are no longer those that they were made from.
void ForgetChanged(Database& database, const std::vector<Photo>& photos, Stage& stage) {
  std::map<std::string, uint64_t> hashes;
  for (const Photo& photo : photos) {
    if (photo.error.empty()) hashes[photo.name] = photo.file_hash;
  }
  std::set<std::string> changed;
  for (const PhotoRecord& record : database.ReadPhotos()) {
    const auto hash = hashes.find(record.name);
    if (!record.error.empty() || hash == hashes.end() || hash->second == record.file_hash) continue;
    changed.insert(record.name);
  }
  std::set<image_t> ids;
  for (const Image& image : database.ReadImages()) {
    if (changed.contains(image.name)) ids.insert(image.image_id);
  }
  if (ids.empty()) return;
  Database::Transaction transaction(database);
  database.DeleteImagesAndPairs(ids);
  transaction.Commit();
  stage.Note("changed, and computed again: " +
             FirstNames(std::vector<std::string>(changed.begin(), changed.end())));
}

// Runs fn, which may throw IoError about the photo's file, and keeps the reason.
template <class Fn>
void KeepError(Photo& photo, const Fn& fn) {
  try {
    fn();
  } catch (const IoError& error) {
    photo.error = error.reason();
  }
}

void HashPhotos(const std::string& image_path, const RunContext& run, std::vector<Photo>& photos) {
  ParallelFor(run.num_threads, static_cast<int64_t>(photos.size()), [&](int64_t i) {
    if (run.monitor.StopRequested()) return;
    KeepError(photos[i],
              [&] { photos[i].file_hash = HashFile(PathInFolder(image_path, photos[i].name)); });
    run.monitor.Advance(1);
  });
}

// Of a photo whose size is known.
void ReadExifOf(const std::string& image_path, Photo& photo) {
  const std::string path = fs::path(image_path) / photo.name;
  KeepError(photo, [&] { photo.exif = ReadExif(path, photo.size.width, photo.size.height); });
}

void ReadHeader(const std::string& image_path, Photo& photo) {
  KeepError(photo, [&] { photo.size = ReadImageSize(fs::path(image_path) / photo.name); });
  if (photo.error.empty()) ReadExifOf(image_path, photo);
}

void ReadHeaders(const std::string& image_path, const RunContext& run, std::vector<Photo>& photos) {
  ParallelFor(run.num_threads, static_cast<int64_t>(photos.size()), [&](int64_t i) {
    if (photos[i].error.empty() && !run.monitor.StopRequested()) ReadHeader(image_path, photos[i]);
  });
}

bool IsPending(const StageLedger& ledger, image_t id) {
  const JobRecord* job = ledger.Find(id);
  return job != nullptr && job->note == kPendingCamera;
}

// Did this stage give the image the camera that it has?
bool HasOurCamera(const StageLedger& ledger, image_t id) {
  return ledger.Find(id) != nullptr && !IsPending(ledger, id);
}

// What the database has.
struct StoredImages {
  std::vector<Image> images;
  std::map<std::string, image_t> ids;
  std::map<camera_t, ImageSize> cameras;
  std::vector<camera_t> taken_camera_ids;
  image_t largest_taken_id = 0;
};

StoredImages ReadStored(const Database& database) {
  StoredImages stored = {database.ReadImages(),
                         {},
                         CameraSizes(database),
                         database.ReadTakenCameraIds(),
                         database.ReadLargestTakenImageId()};
  for (const Image& image : stored.images) stored.ids[image.name] = image.image_id;
  return stored;
}

// The cameras that photos which join later share: those of the first image of each sharing folder.
std::map<std::string, SharedCamera> SharedCameras(const CameraOptions& options,
                                                  const StoredImages& stored,
                                                  const StageLedger& ledger) {
  std::map<std::string, SharedCamera> shared;
  for (const Image& image : stored.images) {
    const std::optional<std::string> folder = SharingFolder(options, image.name);
    const auto camera = stored.cameras.find(image.camera_id);
    if (!folder || camera == stored.cameras.end() || !HasOurCamera(ledger, image.image_id))
      continue;
    shared.try_emplace(*folder, SharedCamera{camera->first, camera->second});
  }
  return shared;
}

// After all cameras but those that only images have which get a new one now.
camera_t FirstFreeCameraId(const StoredImages& stored, const StageLedger& ledger,
                           const std::vector<Photo>& photos) {
  std::set<std::string> readable;
  for (const Photo& photo : photos) {
    if (photo.error.empty()) readable.insert(photo.name);
  }
  std::map<camera_t, bool> is_free;
  for (const Image& image : stored.images) {
    is_free.try_emplace(image.camera_id, true).first->second &=
        readable.contains(image.name) && IsPending(ledger, image.image_id);
  }
  camera_t first_free = 1;
  for (const camera_t id : stored.taken_camera_ids) {
    const auto it = is_free.find(id);
    if (it == is_free.end() || !it->second) first_free = id + 1;
  }
  return first_free;
}

// What the user gives of cameras does not reach those of another program.
void RemarkOnForeign(const std::vector<std::string>& names, const CameraOptions& options,
                     Stage& stage) {
  if (names.empty()) return;
  const std::string what = std::to_string(names.size()) +
                           " photographs have features of another program; these, their cameras "
                           "and matches stay as they are: " +
                           FirstNames(names, 3);
  if (DumpOptions(options) == DumpOptions(CameraOptions())) {
    stage.Note(what);
  } else {
    stage.Warn(ResultWarning{what,
                             "options of cameras do not change theirs; give them to that program, "
                             "or start a new database"});
  }
}

// Sorts out which photos are new, and says why others cannot be; throws ConfigError if one changed
// that has results.
std::vector<Photo> SelectNew(const Database& database, std::vector<Photo> photos,
                             const StoredImages& stored, const StageLedger& ledger,
                             const CameraOptions& options, Stage& stage,
                             std::vector<std::string>& skipped) {
  std::map<std::string, PhotoRecord> records;
  for (PhotoRecord& record : database.ReadPhotos()) records[record.name] = record;
  const std::map<image_t, int> num_keypoints = database.ReadNumKeypoints();
  std::vector<Photo> fresh;
  std::vector<std::string> foreign;
  for (Photo& photo : photos) {
    const auto record = records.find(photo.name);
    const auto image = stored.ids.find(photo.name);
    const bool is_stored = image != stored.ids.end();
    if (record == records.end()) {
      if (is_stored && num_keypoints.contains(image->second)) {
        foreign.push_back(photo.name);
        continue;
      }
    } else if (!record->second.error.empty()) {
      if (record->second.file_hash == photo.file_hash) {
        skipped.push_back(photo.name + ": " + record->second.error + "; still skipped");
        continue;
      }
    } else if (!photo.error.empty()) {
      skipped.push_back(photo.name + ": " + photo.error + "; what the database has of it stays");
      continue;
    } else if (record->second.file_hash != photo.file_hash) {
      throw ConfigError("image_path", photo.name +
                                          " changed since its features were computed; --recompute "
                                          "changed computes such photographs again, and no others");
    } else if (!is_stored || !IsPending(ledger, image->second)) {
      continue;
    }
    fresh.push_back(std::move(photo));
  }
  RemarkOnForeign(foreign, options, stage);
  return fresh;
}

// A photograph, with its header, of each camera that we made: for later ones to share.
using KnownPhotos = std::map<camera_t, Photo>;

KnownPhotos FindKnownPhotos(const StoredImages& stored, const StageLedger& ledger,
                            const std::string& image_path, const std::vector<Photo>& photos,
                            const RunContext& run) {
  std::map<std::string, const Photo*> by_name;
  for (const Photo& photo : photos) by_name[photo.name] = &photo;
  KnownPhotos known;
  for (const Image& image : stored.images) {
    const auto photo = by_name.find(image.name);
    const auto size = stored.cameras.find(image.camera_id);
    if (photo == by_name.end() || size == stored.cameras.end() || known.contains(size->first) ||
        !HasOurCamera(ledger, image.image_id) || !photo->second->error.empty()) {
      continue;
    }
    known.emplace(size->first, *photo->second).first->second.size = size->second;
  }
  std::vector<Photo*> read;
  for (auto& [id, photo] : known) read.push_back(&photo);
  ParallelFor(run.num_threads, std::ssize(read), [&](int64_t i) {
    if (!run.monitor.StopRequested()) ReadExifOf(image_path, *read[i]);
  });
  std::erase_if(known, [](const auto& entry) { return !entry.second.error.empty(); });
  return known;
}

// Gives new images their ids and cameras, in the order of the photos. Returns the new cameras.
std::vector<Camera> AssignCameras(const StoredImages& stored, const CameraOptions& options,
                                  const StageLedger& ledger, const KnownPhotos& known_photos,
                                  std::vector<Photo>& photos) {
  CameraMaker maker(options, FirstFreeCameraId(stored, ledger, photos),
                    SharedCameras(options, stored, ledger), photos);
  for (const auto& [camera_id, photo] : known_photos) maker.AddKnown(photo, camera_id);
  image_t next_id = stored.largest_taken_id + 1;
  for (Photo& photo : photos) {
    if (!photo.error.empty()) continue;
    const auto old = stored.ids.find(photo.name);
    const bool is_stored = old != stored.ids.end();
    if (is_stored && !IsPending(ledger, old->second)) continue;
    const std::optional<camera_t> camera_id = maker.CameraOf(photo);
    if (!camera_id && is_stored) {
      throw ConfigError(
          options.single_camera ? "single_camera" : "single_camera_per_folder",
          photo.name + " " + photo.error + "; use --recompute features to leave it out");
    }
    if (camera_id) photo.image = {is_stored ? old->second : next_id++, photo.name, *camera_id};
  }
  return maker.cameras();
}

// What is doubtful of the parameters that the user gives; throws ConfigError where no camera has
// them.
std::vector<ResultWarning> CheckGivenParams(const CameraOptions& options,
                                            const std::vector<Camera>& cameras,
                                            const KnownPhotos& known_photos,
                                            const std::vector<Photo>& photos) {
  std::vector<ResultWarning> doubts;
  if (options.camera_params.empty() || cameras.empty()) return doubts;
  std::map<camera_t, const Photo*> first;
  for (const Photo& photo : photos) {
    if (photo.image) first.emplace(photo.image->camera_id, &photo);
  }
  std::set<std::string> sizes, told;
  for (const auto& [id, photo] : known_photos) sizes.insert(SizeText(photo.size));
  for (const Camera& camera : cameras) {
    const auto photo = first.find(camera.camera_id);
    sizes.insert(SizeText({camera.width, camera.height}));
    if (const auto fault = FindFault(camera)) {
      throw ConfigError("camera_params", photo->second->name + ": " + WarningText(*fault));
    }
    for (const ResultWarning& doubt : FindDoubts(camera, photo->second->exif.focal_px)) {
      if (told.insert(doubt.what).second) doubts.push_back(doubt);
    }
  }
  if (sizes.size() > 1) {
    doubts.push_back({"the given camera parameters are used for photographs of " +
                          std::to_string(sizes.size()) + " sizes, and cannot be right for all: " +
                          FirstNames(std::vector<std::string>(sizes.begin(), sizes.end())),
                      "give photographs of one size, or leave camera_params out"});
  }
  return doubts;
}

// Photographs twice in the database tell nothing new, and yet agree with each other. `names` are
// those in the folder, if there is one: of a file that was renamed the other name is gone.
std::optional<ResultWarning> WarnOfCopies(const Database& database,
                                          const std::set<std::string>& names) {
  std::map<uint64_t, std::string> first;  // name by hash
  std::vector<std::string> copies;
  const auto is_gone = [&](const std::string& name) {
    return !names.empty() && !names.contains(name);
  };
  bool has_renamed = false;
  for (const PhotoRecord& photo : database.ReadPhotos()) {
    if (!photo.error.empty()) continue;
    const auto [entry, is_new] = first.try_emplace(photo.file_hash, photo.name);
    if (is_new) continue;
    copies.push_back(photo.name + " (of " + entry->second + ")");
    has_renamed |= is_gone(photo.name) || is_gone(entry->second);
  }
  if (copies.empty()) return std::nullopt;
  return ResultWarning{"photographs that are copies of others (" + std::to_string(copies.size()) +
                           "): " + FirstNames(copies),
                       std::string("keep one of each") +
                           (has_renamed ? " (--drop_missing, where one was renamed)" : "") +
                           ": what copies agree on counts as evidence"};
}

int64_t NumNewImages(const std::vector<Photo>& photos) {
  return std::ranges::count_if(photos, [](const Photo& photo) { return photo.image.has_value(); });
}

void WriteImages(Database& database, const std::vector<Camera>& cameras,
                 const std::string& image_path, const std::vector<Photo>& photos,
                 StageLedger& ledger) {
  Database::Transaction transaction(database);
  if (NumNewImages(photos) > 0) ledger.Begin(database);
  bool has_reassigned = false;  // old images with new cameras
  for (const Camera& camera : cameras) database.WriteCamera(camera);
  for (const Photo& photo : photos) {
    const PhotoRecord record = {photo.name, photo.file_hash, photo.error};
    database.WritePhoto(photo.error.empty() ? record : FailedPhoto(image_path, record));
    if (!photo.image) continue;
    database.WriteImage(*photo.image);
    if (photo.exif.gps) database.WriteGpsPrior(photo.image->image_id, *photo.exif.gps);
    database.WriteJob(kStageCameras, {photo.image->image_id, photo.file_hash, ""});
    has_reassigned |= IsPending(ledger, photo.image->image_id);
  }
  if (has_reassigned) database.DeleteUnusedCameras();
  ledger.Complete(database);
  transaction.Commit();
}

}  // namespace

StageReport ImportPhotos(Database& database, const PhotoSource& source,
                         const CameraOptions& options, const RunContext& run) {
  const std::string& image_path = source.image_path;
  Stage stage(run.monitor, kStageCameras);
  CheckCameraOptions(options);
  StageLedger ledger(database, kStageCameras, DumpOptions(options));
  std::vector<Photo> photos = ListPhotos(source);
  std::set<std::string> names;
  for (const Photo& photo : photos) names.insert(photo.name);
  size_t num_dropped = 0;
  if (!image_path.empty() && !source.selection) {
    RemarkOnUnread(source, stage);
    num_dropped = HandleMissing(database, source, photos, stage);
  }
  if (photos.empty() && database.ReadImages().empty()) {
    const bool has_undistorted =
        !image_path.empty() && fs::exists(fs::path(image_path) / kUndistortedImages);
    throw IoError(image_path.empty() ? database.path() : image_path,
                  has_undistorted ? "has no photographs: images/ holds undistorted ones, whose "
                                    "photographs are elsewhere"
                                  : "has no photographs");
  }
  const size_t num_photos = photos.size();
  run.monitor.BeginStage("reading photographs", static_cast<int64_t>(num_photos));
  HashPhotos(image_path, run, photos);
  if (source.recompute_changed && !run.monitor.StopRequested()) {
    ForgetChanged(database, photos, stage);
  }
  std::vector<std::string> skipped;
  const StoredImages stored = ReadStored(database);
  KnownPhotos known_photos;
  if (!run.monitor.StopRequested()) {
    const std::vector<Photo> all = photos;
    photos = SelectNew(database, std::move(photos), stored, ledger, options, stage, skipped);
    ReadHeaders(image_path, run, photos);
    if (!photos.empty()) known_photos = FindKnownPhotos(stored, ledger, image_path, all, run);
  }
  run.monitor.EndStage();
  if (run.monitor.StopRequested()) {
    stage.MarkStopped();
    return stage.Finish();
  }

  const std::vector<Camera> cameras = AssignCameras(stored, options, ledger, known_photos, photos);
  const std::vector<ResultWarning> doubts =
      CheckGivenParams(options, cameras, known_photos, photos);
  if (!photos.empty()) WriteImages(database, cameras, image_path, photos, ledger);
  for (const Photo& photo : photos) {
    if (!photo.error.empty()) skipped.push_back(photo.name + ": " + photo.error + "; skipped");
  }
  stage.WarnEach(skipped);
  stage.Add("photographs", num_photos);
  stage.Add("new_images", NumNewImages(photos));
  stage.Add("new_cameras", cameras.size());
  stage.Add("skipped", skipped.size());
  stage.Add("dropped", num_dropped);
  for (const ResultWarning& doubt : doubts) stage.Warn(doubt);
  if (const auto copies = WarnOfCopies(database, names)) stage.Warn(*copies);
  return EndStage(stage, database);
}

}  // namespace cairn
