#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "cairn/database/database.h"
#include "cairn/features/features.h"
#include "cairn/image/bitmap.h"
#include "report/stage.h"

namespace cairn {

// A photograph, and its mask ("": none).
struct PhotoPaths {
  std::string path;
  std::string mask_path;
};
// Features of a photograph. Throws IoError where it cannot be read, or has not its camera's size,
// ConfigError where its mask has not.
Features ExtractPhoto(const PhotoPaths& photo, const ImageSize& camera_size,
                      const FeatureOptions& options);
// Memory that this takes, about.
int64_t ExtractionBytes(const ImageSize& camera_size, const FeatureOptions& options);

// What the features of an image are made from.
struct FeatureInput {
  uint64_t file_hash = 0;   // of the photograph
  std::string mask_path;    // "": none
  uint64_t input_hash = 0;  // of the photograph and the mask
};
// Hash of both; mask_path "": no mask.
uint64_t FeatureInputHash(uint64_t file_hash, const std::string& mask_path);

// Masks are `<mask_path>/<image name>.png`. Throws ConfigError where no image has one, or one has
// not its image's size.
void CheckMasks(const Database& database, const std::string& mask_path);

// Whether features were found with a mask.
bool HasMasks(const Database& database);

// Of every image whose photograph is known. The stage warns of images that have no mask.
std::map<image_t, FeatureInput> FindFeatureInputs(const Database& database,
                                                  const std::string& mask_path, Stage& stage);

// Images whose features cairn made from something else (another mask) are as if they had just been
// added.
void ForgetChangedFeatures(Database& database, const std::map<image_t, FeatureInput>& inputs);

}  // namespace cairn
