#pragma once

#include <iterator>
#include <unordered_map>

#include "cairn/base/check.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// The images of a model and their cameras by image id, for loops over observations: a search in
// trees of ten thousand images takes longer than a projection. It refers to the model.
class ViewTable {
 public:
  struct View {
    const RegisteredImage* image = nullptr;
    const Camera* camera = nullptr;
    int index = 0;  // of the image, in the order of ids

    const Eigen::Vector2d& Pixel(point2D_t k) const { return image->points2D[k]; }
    double SigmaPx(point2D_t k) const {
      return image->sigmas_px.empty() ? 1.0 : image->sigmas_px[k];
    }
    double ErrorPx(const Eigen::Vector3d& xyz, point2D_t k) const {
      return ReprojectionErrorPx(*camera, image->cam_from_world, xyz, Pixel(k));
    }
  };

  explicit ViewTable(const Reconstruction& model) {
    views_.reserve(model.images.size());
    int index = 0;
    for (const auto& [id, image] : model.images) {
      const Camera& camera = model.CameraOf(image);
      CAIRN_CHECK_EQ(std::ssize(camera.params), CameraModelNumParams(camera.model));
      views_[id] = {&image, &camera, index++};
    }
  }

  const View* Find(image_t id) const {
    const auto found = views_.find(id);
    return found == views_.end() ? nullptr : &found->second;
  }
  const View& Of(image_t id) const {
    const View* view = Find(id);
    CAIRN_CHECK(view != nullptr);
    return *view;
  }
  size_t size() const { return views_.size(); }

 private:
  std::unordered_map<image_t, View> views_;
};

}  // namespace cairn
