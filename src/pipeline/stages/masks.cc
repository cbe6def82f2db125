#include "pipeline/stages/masks.h"

#include <filesystem>
#include <set>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/base/path_in_folder.h"
#include "cairn/image/bitmap.h"
#include "database/stage_names.h"

namespace cairn {
namespace {

void CheckSize(const std::string& path, const ImageSize& photo) {
  const ImageSize mask = ReadImageSize(path);
  if (mask == photo) return;
  throw ConfigError("mask_path",
                    path + " is " + SizeText(mask) + " pixels, its photograph " + SizeText(photo));
}

}  // namespace

std::map<image_t, std::string> FindMasks(const Database& database, const std::string& mask_path,
                                         Stage& stage) {
  std::map<image_t, std::string> masks;
  if (mask_path.empty()) return masks;
  std::map<camera_t, ImageSize> sizes;
  for (const Camera& camera : database.ReadCameras()) {
    sizes[camera.camera_id] = {camera.width, camera.height};
  }
  std::vector<std::string> without;
  for (const Image& image : database.ReadImages()) {
    const std::string path = PathInFolder(mask_path, image.name + ".png");
    if (!std::filesystem::exists(path)) {
      without.push_back(image.name);
      continue;
    }
    const auto size = sizes.find(image.camera_id);
    if (size != sizes.end()) CheckSize(path, size->second);
    masks[image.image_id] = path;
  }
  if (without.empty()) return masks;
  if (masks.empty()) {
    throw ConfigError("mask_path", mask_path + " has no mask of any image: there is no " +
                                       without.front() + ".png");
  }
  stage.Warn("no mask of " + std::to_string(without.size()) + " images, such as " +
             without.front() + "; features are found everywhere in them");
  return masks;
}

uint64_t FeatureInputHash(uint64_t file_hash, const std::string& mask_path) {
  if (mask_path.empty()) return file_hash;
  return Hasher().Add(file_hash).Add(HashFile(mask_path)).Digest();
}

void ForgetChangedMasks(Database& database, const std::map<image_t, std::string>& masks) {
  std::map<image_t, uint64_t> made_from;
  for (const JobRecord& job : database.ReadJobs(kStageFeatures)) {
    made_from[static_cast<image_t>(job.item)] = job.input_hash;
  }
  std::map<std::string, uint64_t> file_hashes;
  for (const PhotoRecord& photo : database.ReadPhotos()) file_hashes[photo.name] = photo.file_hash;
  std::set<image_t> changed;
  for (const Image& image : database.ReadImages()) {
    const auto hash = made_from.find(image.image_id);
    const auto file_hash = file_hashes.find(image.name);
    if (hash == made_from.end() || file_hash == file_hashes.end()) continue;
    const auto mask = masks.find(image.image_id);
    const std::string path = mask == masks.end() ? "" : mask->second;
    if (hash->second != FeatureInputHash(file_hash->second, path)) changed.insert(image.image_id);
  }
  if (changed.empty()) return;
  Database::Transaction transaction(database);
  database.DeleteFeaturesAndPairs(changed);
  transaction.Commit();
}

}  // namespace cairn
