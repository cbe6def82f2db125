#include "global_sfm/one_dsfm_export.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/image/bitmap.h"
#include "cairn/image/exif.h"
#include "cairn/image/resample.h"
#include "cairn/io/bundler.h"
#include "cairn/io/one_dsfm_writer.h"
#include "cairn/mapper/view_edges.h"

namespace cairn {
namespace {

constexpr int kJpegQuality = 98;  // features are detected again
constexpr double kDiagonal35Mm = 43.27;

// An image of the list: index = position in it.
struct Entry {
  Image image;            // of the database
  Camera source, target;  // the photograph's camera, and the one it is resampled to
  const RegisteredImage* registered = nullptr;         // in the model
  std::vector<Eigen::Vector2d> source_pixels;          // by key
  std::vector<std::optional<Eigen::Vector2d>> pixels;  // the same after resampling
  std::vector<std::array<uint8_t, 3>> colors;          // by key; empty without a photograph
};

std::vector<Entry> MakeEntries(const Reconstruction& model, const Database& database,
                               const std::string& output_path) {
  std::map<std::string, const RegisteredImage*> registered;
  for (const auto& [id, image] : model.images) registered[image.image.name] = &image;
  std::map<camera_t, Camera> cameras;
  for (const Camera& camera : database.ReadCameras()) cameras[camera.camera_id] = camera;
  std::vector<Entry> entries;
  for (const Image& image : database.ReadImages()) {
    if (!cameras.contains(image.camera_id)) {
      throw IoError(database.path(), "camera " + std::to_string(image.camera_id) + " of '" +
                                         image.name + "' is missing or of an unknown model");
    }
    Entry& entry = entries.emplace_back();
    entry.image = image;
    entry.source = cameras.at(image.camera_id);
    if (const auto it = registered.find(image.name); it != registered.end()) {
      entry.registered = it->second;
      entry.source = model.CameraOf(*it->second);
      entry.source.has_prior_focal_length = true;
      registered.erase(it);
    }
    entry.target = CenteredPinhole(entry.source);
    entry.target.camera_id = image.image_id;
  }
  if (!registered.empty()) {
    throw IoError(output_path,
                  "the model's image '" + registered.begin()->first + "' is not in the database");
  }
  return entries;
}

void PlaceKeys(const Database& database, Entry* entry) {
  if (entry->registered) {
    entry->source_pixels = entry->registered->points2D;
  } else {
    for (const Keypoint& keypoint :
         database.ReadKeypoints(entry->image.image_id).value_or(std::vector<Keypoint>())) {
      entry->source_pixels.push_back(keypoint.Position());
    }
  }
  for (const Eigen::Vector2d& pixel : entry->source_pixels) {
    entry->pixels.push_back(ResamplePixel(pixel, entry->source, entry->target));
  }
}

// Photographs of one camera have equal make and model, as build_view_graph expects: those of
// the source where it has them.
void WriteCameraTags(const Entry& entry, const std::string& source_path, bool is_copy,
                     const std::string& path) {
  const std::string extension = LowerCaseExtension(path);
  if (extension != ".jpg" && extension != ".jpeg" && extension != ".png") return;
  if (!entry.target.has_prior_focal_length) return;
  const ExifInfo exif = ReadExif(source_path, entry.source.width, entry.source.height);
  const bool is_known = !exif.camera_make.empty() && !exif.camera_model.empty();
  if (is_copy && is_known) return;
  ExifTags tags;
  tags.focal_length_35mm = static_cast<int>(
      std::lround(entry.target.MeanFocal() / entry.target.DiagonalPx() * kDiagonal35Mm));
  tags.camera_make = is_known ? exif.camera_make : "cairn";
  tags.camera_model =
      is_known ? exif.camera_model : "camera " + std::to_string(entry.source.camera_id);
  WriteExif(path, tags);
}

enum class PhotoOutcome { kMissing, kCopied, kResampled };

PhotoOutcome WritePhotograph(const std::string& source_path, const std::string& target_path,
                             Entry* entry) {
  const Bitmap bitmap = ReadBitmap(source_path, BitmapColor::kRgb);
  if (bitmap.width != entry->source.width || bitmap.height != entry->source.height) {
    throw IoError(source_path, "its size is not that of its camera");
  }
  for (const Eigen::Vector2d& pixel : entry->source_pixels) {
    const int x = std::clamp(static_cast<int>(pixel.x()), 0, bitmap.width - 1);
    const int y = std::clamp(static_cast<int>(pixel.y()), 0, bitmap.height - 1);
    const uint8_t* rgb = bitmap.Pixel(x, y);
    entry->colors.push_back({rgb[0], rgb[1], rgb[2]});
  }
  const Bitmap resampled = ResampleBitmap(bitmap, entry->source, entry->target, Resampling::kCubic);
  CreateFolders(std::filesystem::path(target_path).parent_path().string());
  if (resampled.data == bitmap.data) {
    WriteFileAtomically(target_path, ReadFile(source_path));
    WriteCameraTags(*entry, source_path, true, target_path);
    return PhotoOutcome::kCopied;
  }
  WriteBitmap(target_path, resampled, kJpegQuality);
  WriteCameraTags(*entry, source_path, false, target_path);
  return PhotoOutcome::kResampled;
}

// Photographs are independent of each other; a broken one is named and skipped.
void WritePhotographs(const std::string& image_path, const std::string& output_path,
                      const RunContext& run, std::vector<Entry>* entries,
                      OneDsfmExportReport* report) {
  const auto n = static_cast<int64_t>(entries->size());
  std::vector<PhotoOutcome> outcomes(n, PhotoOutcome::kMissing);
  std::vector<std::string> errors(n);
  CreateFolders(output_path + "/images");
  run.monitor.BeginStage("photographs", n);
  ParallelFor(run.num_threads, n, [&](int64_t i) {
    Entry& entry = (*entries)[i];
    const std::string source = PathInFolder(image_path, entry.image.name);
    try {
      outcomes[i] =
          WritePhotograph(source, PathInFolder(output_path + "/images", entry.image.name), &entry);
    } catch (const IoError& error) {
      if (error.path() != source) throw;
      errors[i] = error.what();
    }
    run.monitor.Advance(1);
  });
  run.monitor.EndStage();
  for (int64_t i = 0; i < n; ++i) {
    if (!errors[i].empty()) run.monitor.Warning(errors[i] + "; the photograph is left out");
    report->num_without_photo += outcomes[i] == PhotoOutcome::kMissing;
    report->num_copied += outcomes[i] == PhotoOutcome::kCopied;
    report->num_resampled += outcomes[i] == PhotoOutcome::kResampled;
  }
}

std::string ListName(const Entry& entry) { return "images/" + entry.image.name; }

OneDsfmImageKeys KeysOf(const Entry& entry, int index) {
  OneDsfmImageKeys keys;
  keys.index = index;
  keys.name = ListName(entry);
  keys.principal_point = entry.target.PrincipalPoint();
  keys.focal_px = entry.target.has_prior_focal_length ? entry.target.MeanFocal() : 0.0;
  for (size_t k = 0; k < entry.pixels.size(); ++k) {
    if (!entry.pixels[k]) continue;
    OneDsfmKey key;
    key.key = static_cast<int>(k);
    key.pixel = *entry.pixels[k];
    if (!entry.colors.empty()) key.color = entry.colors[k];
    keys.keys.push_back(key);
  }
  return keys;
}

// Pairs without a direction, which EGs.txt needs, are left out.
std::vector<OneDsfmEdge> EdgesOf(const Database& database, const std::map<image_t, int>& index,
                                 ProgressMonitor& monitor) {
  std::vector<OneDsfmEdge> edges;
  const auto warn = [&](const std::string& message) { monitor.Warning(message); };
  for (const ViewEdge& edge : ReadViewEdges(database, warn)) {
    if (!edge.IsActive() || !edge.HasTranslation()) continue;
    edges.push_back({index.at(edge.image_id1), index.at(edge.image_id2), edge.cam2_from_cam1});
  }
  return edges;
}

// The model as seen by the resampled photographs: image and camera ids are those of the database,
// names those of the list; observations that have no place are removed.
Reconstruction ResampledModel(const Reconstruction& model, const std::vector<Entry>& entries) {
  Reconstruction out;
  std::map<image_t, const Entry*> entry_of;  // by the model's image id
  for (const Entry& entry : entries) {
    if (!entry.registered) continue;
    const image_t id = entry.image.image_id;
    entry_of[entry.registered->image.image_id] = &entry;
    out.cameras[id] = entry.target;
    RegisteredImage& image = out.images[id];
    image.image = {id, ListName(entry), id};
    image.cam_from_world = entry.registered->cam_from_world;
    for (const auto& pixel : entry.pixels) {
      image.points2D.push_back(pixel.value_or(Eigen::Vector2d::Zero()));
    }
    image.point3D_ids.assign(image.points2D.size(), kInvalidPoint3DId);
  }
  for (const auto& [id, point] : model.points3D) {
    Point3D moved = point;
    moved.track.clear();
    for (const TrackElement& element : point.track) {
      const Entry* entry = entry_of.at(element.image_id);
      if (entry->pixels[element.point2D]) {
        moved.track.push_back({entry->image.image_id, element.point2D});
      }
    }
    std::sort(moved.track.begin(), moved.track.end());
    if (moved.track.size() >= 2) out.AddPoint3D(moved);
  }
  return out;
}

OneDsfmFiles MakeFiles(const Database& database, const std::vector<Entry>& entries,
                       const Reconstruction& resampled, ProgressMonitor& monitor) {
  OneDsfmFiles files;
  std::map<image_t, int> index;
  for (const Entry& entry : entries) {
    const int i = static_cast<int>(files.images.size());
    index[entry.image.image_id] = i;
    files.images.push_back({ListName(entry), {}});
    if (entry.target.has_prior_focal_length) {
      files.images.back().focal_px = entry.target.MeanFocal();
    }
    if (entry.registered) files.component.push_back(i);
    files.coords.push_back(KeysOf(entry, i));
  }
  files.edges = EdgesOf(database, index, monitor);
  for (const auto& [id, point] : resampled.points3D) {
    auto& track = files.tracks.emplace_back();
    for (const TrackElement& element : point.track) {
      track.push_back({index.at(element.image_id), static_cast<int>(element.point2D)});
    }
  }
  return files;
}

}  // namespace

OneDsfmExportReport ExportOneDsfm(const Reconstruction& model, const Database& database,
                                  const std::string& image_path, const std::string& output_path,
                                  const RunContext& run) {
  if (!image_path.empty() && IsInFolder(image_path, output_path + "/images")) {
    throw ConfigError("output_path", "photographs would be replaced in " + output_path +
                                         "/images; give another --output_path");
  }
  OneDsfmExportReport report;
  std::vector<Entry> entries = MakeEntries(model, database, output_path);
  // Before photographs are resampled for long.
  for (const Entry& entry : entries) CheckOneDsfmName(ListName(entry), output_path + "/list.txt");
  for (Entry& entry : entries) PlaceKeys(database, &entry);
  WritePhotographs(image_path, output_path, run, &entries, &report);

  const Reconstruction resampled = ResampledModel(model, entries);
  std::vector<Image> listed;
  for (const Entry& entry : entries) {
    listed.push_back({entry.image.image_id, ListName(entry), entry.image.image_id});
  }
  // Writes a list of names alone as well, which the next call replaces by the one with focals.
  for (const std::string& warning :
       WriteBundler(resampled, output_path + "/gt_bundle.out", output_path + "/list.txt", listed)) {
    run.monitor.Warning(warning);
  }
  const OneDsfmFiles files = MakeFiles(database, entries, resampled, run.monitor);
  WriteOneDsfmFiles(output_path, files);

  report.num_images = static_cast<int>(files.images.size());
  report.num_registered = static_cast<int>(files.component.size());
  report.num_edges = static_cast<int>(files.edges.size());
  report.num_tracks = static_cast<int>(files.tracks.size());
  return report;
}

}  // namespace cairn
