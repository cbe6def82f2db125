#include <algorithm>
#include <functional>
#include <tuple>

#include "base/text.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Keypoints that lie farther from those of a model are others, pixels.
constexpr double kMaxShiftPx = 0.01;

// What of the models cannot be used: names by reason.
using LeftOut = std::map<std::string, std::vector<std::string>>;

// "" or why the scene cannot have the image with its camera.
std::string ReasonAgainst(const SceneData& scene, image_t id, const Camera& camera) {
  const auto pixels = scene.pixels.find(id);
  if (pixels == scene.pixels.end() || pixels->second.empty()) {
    return "without keypoints in the database";
  }
  if (camera.width <= 0 || camera.height <= 0)
    return "whose size the model does not tell (global_sfm export --image_path adds it)";
  if (const std::string reason = camera.Validate(); !reason.empty()) {
    return "whose camera in the model cannot be used (" + reason + ")";
  }
  const Camera& stored = scene.CameraOf(id);
  if (camera.width != stored.width || camera.height != stored.height) {
    return "of another size than in the database";
  }
  return "";
}

bool HasOtherKeypoints(const RegisteredImage& image, const std::vector<Eigen::Vector2d>& pixels) {
  if (image.points2D.size() != pixels.size()) return true;
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (!((image.points2D[i] - pixels[i]).norm() <= kMaxShiftPx)) return true;
  }
  return false;
}

// Images of the models that the scene has, and those of them with other keypoints there.
struct KnownImages {
  std::set<image_t> all, changed;
};

KnownImages FindKnown(std::span<const Reconstruction> models,
                      const std::map<std::string, image_t>& ids, const SceneData& scene) {
  KnownImages known;
  for (const Reconstruction& model : models) {
    for (const auto& [model_id, image] : model.images) {
      const auto id = ids.find(image.image.name);
      if (id == ids.end() || !scene.pixels.contains(id->second)) continue;
      known.all.insert(id->second);
      if (HasOtherKeypoints(image, scene.pixels.at(id->second))) known.changed.insert(id->second);
    }
  }
  return known;
}

// The images of a model that the scene has and no model before, under their ids in the scene.
std::map<image_t, const RegisteredImage*> FindImages(const Reconstruction& model,
                                                     const std::map<std::string, image_t>& ids,
                                                     const SceneData& scene,
                                                     std::set<image_t>& taken, LeftOut& left_out) {
  std::map<image_t, const RegisteredImage*> found;
  for (const auto& [model_id, image] : model.images) {
    const auto id = ids.find(image.image.name);
    std::string reason;
    if (id == ids.end()) {
      reason = "that are not in the database";
    } else {
      reason = ReasonAgainst(scene, id->second, model.CameraOf(image));
      if (reason.empty() && !taken.insert(id->second).second) reason = "that a larger model has";
    }
    if (reason.empty()) {
      found[id->second] = &image;
    } else {
      left_out[reason].push_back(image.image.name);
    }
  }
  return found;
}

// Gives the scene's images the cameras that they share in the models, under ids of the database
// where these are free.
class CameraAdopter {
 public:
  explicit CameraAdopter(SceneData& scene) : scene_(scene), stored_(scene.images) {}

  // The model with the scene's ids and keypoints, and no points.
  Reconstruction Adopt(const Reconstruction& model,
                       const std::map<image_t, const RegisteredImage*>& images) {
    const std::map<camera_t, camera_t> new_ids = ChooseIds(model, images);
    std::map<image_t, Rigid3d> poses;
    for (const auto& [id, image] : images) {
      poses[id] = image->cam_from_world;
      const camera_t camera_id = new_ids.at(image->image.camera_id);
      ++num_images_[stored_.at(id).camera_id][camera_id];
      scene_.images.at(id).camera_id = camera_id;
    }
    Reconstruction adopted = MakeReconstruction(scene_, poses);
    for (const auto& [model_id, id] : new_ids) {
      adopted.cameras[id] = model.cameras.at(model_id);
      adopted.cameras[id].camera_id = id;
      adopted.cameras[id].has_prior_focal_length = scene_.cameras.at(id).has_prior_focal_length;
    }
    return adopted;
  }

  // Images that are in no model have the camera that most images with theirs in the database got.
  void AdoptOthers(const std::set<image_t>& taken) {
    for (auto& [id, image] : scene_.images) {
      const auto heirs = num_images_.find(image.camera_id);
      if (taken.contains(id) || heirs == num_images_.end()) continue;
      const auto& num_images = heirs->second;
      image.camera_id =
          std::ranges::max_element(num_images, {}, [](auto& heir) { return heir.second; })->first;
    }
  }

 private:
  // Cameras of the model that are equal, and one in the database, are one.
  std::map<camera_t, camera_t> ChooseIds(const Reconstruction& model,
                                         const std::map<image_t, const RegisteredImage*>& images) {
    std::map<camera_t, std::set<camera_t>> stored_ids;  // by camera of the model
    for (const auto& [id, image] : images) {
      stored_ids[image->image.camera_id].insert(stored_.at(id).camera_id);
    }
    std::map<std::tuple<camera_t, CameraModel, std::vector<double>>, camera_t> equal;
    std::map<camera_t, camera_t> new_ids;
    std::set<camera_t> used;
    for (const auto& [model_id, candidates] : stored_ids) {
      const Camera& camera = model.cameras.at(model_id);
      const auto [entry, is_first] = equal.try_emplace(
          {*candidates.begin(), camera.model, camera.params}, scene_.cameras.rbegin()->first + 1);
      if (is_first) {
        const auto is_free = [&](camera_t id) { return !used.contains(id); };
        const auto free = std::find_if(candidates.begin(), candidates.end(), is_free);
        if (free != candidates.end()) entry->second = *free;
        Store(camera, *candidates.begin(), entry->second);
        used.insert(entry->second);
      }
      new_ids[model_id] = entry->second;
    }
    return new_ids;
  }

  // What the database knows of a camera holds, by the model's lens.
  void Store(const Camera& camera, camera_t stored_id, camera_t id) {
    const auto [entry, is_new] = scene_.cameras.try_emplace(id, scene_.cameras.at(stored_id));
    if (is_new && scene_.constant_cameras.contains(stored_id)) scene_.constant_cameras.insert(id);
    entry->second = ByLens(entry->second, camera.model);
    entry->second.camera_id = id;
  }

  SceneData& scene_;
  const std::map<image_t, Image> stored_;
  // By camera in the database: the images that got each other one.
  std::map<camera_t, std::map<camera_t, int>> num_images_;
};

}  // namespace

std::vector<Reconstruction> AdoptModels(std::span<const Reconstruction> models, SceneData& scene,
                                        const ReconstructOptions& options, const RunContext& run,
                                        RunReport& report) {
  RunStage stage(report, run.monitor, "input");
  std::vector<const Reconstruction*> by_size;
  for (const Reconstruction& model : models) by_size.push_back(&model);
  std::ranges::stable_sort(by_size, std::greater<>(),
                           [](const Reconstruction* model) { return model->images.size(); });
  std::map<std::string, image_t> ids;
  for (const auto& [id, image] : scene.images) ids[image.name] = id;
  LeftOut left_out;
  std::set<image_t> taken;
  const auto [known, changed] = FindKnown(models, ids, scene);
  // Of few, the photographs were replaced; of most, features were found anew.
  const bool places_changed = options.register_left_out && 2 * changed.size() < known.size();
  CameraAdopter adopter(scene);
  std::vector<Reconstruction> adopted;
  for (const Reconstruction* model : by_size) {
    auto images = FindImages(*model, ids, scene, taken, left_out);
    if (places_changed) {
      std::erase_if(images, [&](const auto& entry) {
        return changed.contains(entry.first) && taken.erase(entry.first) > 0;
      });
    }
    if (images.size() >= 2) {
      adopted.push_back(adopter.Adopt(*model, images));
      continue;
    }
    for (const auto& [id, image] : images) {
      taken.erase(id);
      left_out["that are alone in their model"].push_back(image->image.name);
    }
  }
  adopter.AdoptOthers(taken);
  for (const auto& [reason, names] : left_out) {
    stage.RecordWarning(ResultWarning{std::to_string(names.size()) + " images of the input model " +
                                          reason + ": " + FirstNames(names),
                                      ""});
  }
  if (!changed.empty()) {
    stage.Note("keypoints of " + std::to_string(changed.size()) +
               " images changed since the model was made; " +
               (places_changed ? "their poses" : "its points") + " are found anew");
  }
  stage.Add("models", adopted.size());
  stage.Add("images", taken.size());
  stage.Add("images_other_keypoints", changed.size());
  stage.Add("images_to_register", scene.pixels.size() - taken.size());
  if (adopted.empty()) {
    stage.Fail("fewer than two images of the input model can be used",
               "is it a model of the photographs of this database?");
  } else if (scene.poses_alone) {
    stage.Fail("the pairs of the database have no matches to register images by",
               "reconstruct without --input_path");
  }
  return adopted;
}

}  // namespace cairn
