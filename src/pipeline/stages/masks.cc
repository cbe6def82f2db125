#include "pipeline/stages/masks.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "database/stage_names.h"
#include "pipeline/stages/camera_maker.h"

namespace cairn {
namespace {

void CheckSize(const std::string& path, const ImageSize& mask, const ImageSize& photo) {
  if (mask == photo) return;
  throw ConfigError("mask_path",
                    path + " is " + SizeText(mask) + " pixels, its photograph " + SizeText(photo));
}

// Black where either is, if they have one size; else the other one.
void Intersect(Bitmap other, std::optional<Bitmap>& mask) {
  if (mask && mask->data.size() == other.data.size()) {
    std::ranges::transform(other.data, mask->data, other.data.begin(),
                           [](uint8_t a, uint8_t b) { return std::min(a, b); });
  }
  mask = std::move(other);
}

std::map<std::string, uint64_t> HashesOfPhotos(const Database& database) {
  std::map<std::string, uint64_t> hashes;
  for (const PhotoRecord& photo : database.ReadPhotos()) {
    if (photo.error.empty()) hashes[photo.name] = photo.file_hash;
  }
  return hashes;
}

// "": it has none.
std::string MaskOf(const std::string& mask_path, const Image& image) {
  if (mask_path.empty() || !StaysInFolder(image.name)) return "";
  const std::string mask = PathInFolder(mask_path, image.name + ".png");
  return std::filesystem::exists(mask) ? mask : "";
}

}  // namespace

Features ExtractPhoto(const PhotoPaths& photo, const ImageSize& camera_size,
                      const FeatureOptions& options) {
  const Bitmap bitmap = ReadBitmap(photo.path, BitmapColor::kGray);
  const ImageSize size{bitmap.width, bitmap.height};
  if (size != camera_size) {
    throw IoError(photo.path,
                  "is " + SizeText(size) + " pixels, its camera " + SizeText(camera_size));
  }
  std::optional<Bitmap> mask = ReadOpacity(photo.path);
  if (!photo.mask_path.empty()) {
    Intersect(ReadMask(photo.mask_path), mask);
    CheckSize(photo.mask_path, {mask->width, mask->height}, size);
    if (const auto opacity = ReadOpacity(photo.mask_path)) Intersect(*opacity, mask);
  }
  return ExtractFeatures(bitmap, options, mask ? &*mask : nullptr);
}

int64_t ExtractionBytes(const ImageSize& camera_size, const FeatureOptions& options) {
  // Most of it is the doubled octave, of four times as many pixels.
  const double bytes_per_px = options.first_octave < 0 ? 120 : 40;
  const double width = camera_size.width, height = camera_size.height;
  const double scale = std::min(1.0, options.max_image_size / std::max({1.0, width, height}));
  const double decoded = 2 * width * height;  // the decoder's pixels, and a copy
  return static_cast<int64_t>(decoded + bytes_per_px * width * height * scale * scale);
}

uint64_t FeatureInputHash(uint64_t file_hash, const std::string& mask_path) {
  if (mask_path.empty()) return file_hash;
  return Hasher().Add(file_hash).Add(HashFile(mask_path)).Digest();
}

void CheckMasks(const Database& database, const std::string& mask_path) {
  if (mask_path.empty()) return;
  const std::map<camera_t, ImageSize> sizes = CameraSizes(database);
  const std::vector<Image> images = database.ReadImages();
  bool has_any = images.empty();
  for (const Image& image : images) {
    const std::string mask = MaskOf(mask_path, image);
    if (mask.empty()) continue;
    has_any = true;
    const auto size = sizes.find(image.camera_id);
    if (size != sizes.end()) CheckSize(mask, ReadImageSize(mask), size->second);
  }
  if (has_any) return;
  throw ConfigError("mask_path", mask_path + " has no mask of any image: there is no " +
                                     images.front().name + ".png");
}

bool HasMasks(const Database& database) {
  const std::map<std::string, uint64_t> file_hashes = HashesOfPhotos(database);
  std::map<image_t, uint64_t> input_hashes;
  for (const JobRecord& job : database.ReadJobs(kStageFeatures)) {
    input_hashes[static_cast<image_t>(job.item)] = job.input_hash;
  }
  return std::ranges::any_of(database.ReadImages(), [&](const Image& image) {
    const auto input = input_hashes.find(image.image_id);
    const auto file = file_hashes.find(image.name);
    return input != input_hashes.end() && file != file_hashes.end() &&
           input->second != file->second;
  });
}

std::map<image_t, FeatureInput> FindFeatureInputs(const Database& database,
                                                  const std::string& mask_path, Stage& stage) {
  const std::map<std::string, uint64_t> file_hashes = HashesOfPhotos(database);
  std::map<image_t, FeatureInput> inputs;
  std::vector<std::string> without, unused;
  for (const Image& image : database.ReadImages()) {
    const std::string mask = MaskOf(mask_path, image);
    if (mask.empty() && !mask_path.empty()) without.push_back(image.name);
    const auto file_hash = file_hashes.find(image.name);
    if (file_hash == file_hashes.end()) {
      if (!mask.empty()) unused.push_back(image.name);
      continue;
    }
    inputs[image.image_id] = {file_hash->second, mask, FeatureInputHash(file_hash->second, mask)};
  }
  if (!without.empty()) {
    stage.Warn("no mask of " + std::to_string(without.size()) + " images, such as " +
               without.front() + "; features are found everywhere in them");
  }
  if (!unused.empty()) {
    stage.Warn("masks of " + std::to_string(unused.size()) + " images, such as " + unused.front() +
               ", are not used: their features are another program's");
  }
  return inputs;
}

void ForgetChangedFeatures(Database& database, const std::map<image_t, FeatureInput>& inputs) {
  std::set<image_t> changed;
  for (const JobRecord& job : database.ReadJobs(kStageFeatures)) {
    const auto input = inputs.find(static_cast<image_t>(job.item));
    if (input == inputs.end() || input->second.input_hash == job.input_hash) continue;
    changed.insert(input->first);
  }
  if (changed.empty()) return;
  Database::Transaction transaction(database);
  database.DeleteFeaturesAndPairs(changed);
  transaction.Commit();
}

}  // namespace cairn
