#pragma once

#include <map>
#include <string>

#include "cairn/database/database.h"
#include "report/stage.h"

namespace cairn {

// The mask of each image that has one, `<mask_path>/<image name>.png`; the stage is told how many
// have none. Throws ConfigError where none has one, or one has not its image's size.
std::map<image_t, std::string> FindMasks(const Database& database, const std::string& mask_path,
                                         Stage& stage);

// Hash of what an image's features are made from; mask_path "": no mask.
uint64_t FeatureInputHash(uint64_t file_hash, const std::string& mask_path);

// Images whose features cairn made with another mask are as if they had just been added.
void ForgetChangedMasks(Database& database, const std::map<image_t, std::string>& masks);

}  // namespace cairn
