#include "global_sfm/image_ids.h"

#include <algorithm>
#include <string>

#include "cairn/base/error.h"

namespace cairn {

Reconstruction WithImageIdsOf(std::span<const Image> images, Reconstruction model) {
  std::map<std::string, image_t> by_name;
  for (const Image& image : images) by_name[image.name] = image.image_id;
  std::map<image_t, image_t> new_ids;
  std::map<image_t, RegisteredImage> registered;
  for (auto& [id, image] : model.images) {
    const auto found = by_name.find(image.image.name);
    if (found == by_name.end()) {
      throw ConfigError("model_path", image.image.name + " is not in the database");
    }
    new_ids[id] = image.image.image_id = found->second;
    if (!registered.emplace(found->second, std::move(image)).second) {
      throw ConfigError("model_path", found->first + " is in the model twice");
    }
  }
  model.images = std::move(registered);
  for (auto& [id, point] : model.points3D) {
    for (TrackElement& element : point.track) element.image_id = new_ids.at(element.image_id);
    std::ranges::sort(point.track);
  }
  return model;
}

}  // namespace cairn
