#include "pipeline/stages/masks.h"

#include <filesystem>
#include <set>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/image/bitmap.h"
#include "database/stage_names.h"
#include "pipeline/stages/camera_maker.h"

namespace cairn {
namespace {

void CheckSize(const std::string& path, const ImageSize& photo) {
  const ImageSize mask = ReadImageSize(path);
  if (mask == photo) return;
  throw ConfigError("mask_path",
                    path + " is " + SizeText(mask) + " pixels, its photograph " + SizeText(photo));
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
  if (photo.mask_path.empty()) return ExtractFeatures(bitmap, options);
  const Bitmap mask = ReadBitmap(photo.mask_path, BitmapColor::kGray);
  return ExtractFeatures(bitmap, options, &mask);
}

uint64_t FeatureInputHash(uint64_t file_hash, const std::string& mask_path) {
  if (mask_path.empty()) return file_hash;
  return Hasher().Add(file_hash).Add(HashFile(mask_path)).Digest();
}

std::map<image_t, FeatureInput> FindFeatureInputs(const Database& database,
                                                  const std::string& mask_path, Stage& stage) {
  std::map<std::string, uint64_t> file_hashes;
  for (const PhotoRecord& photo : database.ReadPhotos()) {
    if (photo.error.empty()) file_hashes[photo.name] = photo.file_hash;
  }
  std::map<camera_t, ImageSize> sizes = CameraSizes(database);
  const std::vector<Image> images = database.ReadImages();
  std::map<image_t, FeatureInput> inputs;
  std::vector<std::string> without;
  for (const Image& image : images) {
    std::string mask;
    if (!mask_path.empty()) mask = PathInFolder(mask_path, image.name + ".png");
    if (!mask.empty() && !std::filesystem::exists(mask)) {
      without.push_back(image.name);
      mask.clear();
    }
    if (!mask.empty() && sizes.count(image.camera_id) > 0) CheckSize(mask, sizes[image.camera_id]);
    const auto file_hash = file_hashes.find(image.name);
    if (file_hash == file_hashes.end()) continue;
    inputs[image.image_id] = {file_hash->second, mask, FeatureInputHash(file_hash->second, mask)};
  }
  if (without.empty()) return inputs;
  if (without.size() == images.size()) {
    throw ConfigError("mask_path", mask_path + " has no mask of any image: there is no " +
                                       without.front() + ".png");
  }
  stage.Warn("no mask of " + std::to_string(without.size()) + " images, such as " +
             without.front() + "; features are found everywhere in them");
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
