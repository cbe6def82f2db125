#include <algorithm>

#include "base/text.h"
#include "cairn/math/angles.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// The largest angle by which rays of pixels differ, degrees.
double RayChangeDeg(const Camera& before, const Camera& after) {
  double change = 0;
  for (const double u : {0.0, 0.5, 1.0}) {
    for (const double v : {0.0, 0.5, 1.0}) {
      const Eigen::Vector2d pixel(u * before.width, v * before.height);
      const auto ray_before = before.RayFromImg(pixel);
      const auto ray_after = after.RayFromImg(pixel);
      if (ray_before && ray_after) {
        change = std::max(change, RadToDeg(AngleBetween(*ray_before, *ray_after)));
      }
    }
  }
  return change;
}

bool SharesPointsWithNew(const Reconstruction& model, const Reconstruction& earlier, image_t id) {
  for (const point3D_t point_id : model.images.at(id).point3D_ids) {
    if (point_id == kInvalidPoint3DId) continue;
    for (const TrackElement& element : model.points3D.at(point_id).track) {
      if (earlier.images.count(element.image_id) == 0) return true;
    }
  }
  return false;
}

// An image of the earlier model, and how many times its confidence it moved.
struct Move {
  image_t image_id;
  double turn_deg, shift, times;
};

Move MoveOf(image_t id, const RegisteredImage& before, const RegisteredImage& after,
            const PoseConfidence& confidence) {
  Move move{id, 0, 0, 0};
  move.turn_deg =
      RadToDeg(AngleBetween(before.cam_from_world.rotation, after.cam_from_world.rotation));
  move.shift = (before.cam_from_world.Center() - after.cam_from_world.Center()).norm();
  move.times = std::max(move.turn_deg / confidence.rotation_sigma_deg,
                        move.shift / confidence.position_sigma);
  return move;
}

// Why images moved, with the number of those to which each reason applies.
std::string Reasons(const Reconstruction& model, const Reconstruction& earlier,
                    const std::map<image_t, PoseConfidence>& confidences,
                    std::span<const Move> moves) {
  int num_cameras = 0, num_shared = 0, num_others = 0;
  double largest_change_deg = 0;
  for (const Move& move : moves) {
    const camera_t camera_id = model.images.at(move.image_id).image.camera_id;
    const double change_deg =
        RayChangeDeg(earlier.cameras.at(camera_id), model.cameras.at(camera_id));
    const bool has_other_rays = change_deg > confidences.at(move.image_id).rotation_sigma_deg;
    largest_change_deg = std::max(largest_change_deg, change_deg);
    const bool is_shared = SharesPointsWithNew(model, earlier, move.image_id);
    num_cameras += has_other_rays;
    num_shared += is_shared;
    num_others += !has_other_rays && !is_shared;
  }
  std::string text;
  const auto add = [&](int num, const std::string& what) {
    if (num > 0) text += (text.empty() ? "" : ", ") + std::to_string(num) + " " + what;
  };
  add(num_shared, "see points with new images");
  add(num_cameras,
      Formatted("have a camera whose rays changed (by up to %.2g degrees)", largest_change_deg));
  add(num_others, "were refined further, or follow their neighbors");
  return text;
}

struct Movement {
  std::vector<Move> moves;  // the largest first
  size_t num_far = 0;       // of these, by more than the confidence
  std::vector<image_t> lost, replaced;
};

Movement Measure(const Reconstruction& model, const Reconstruction& earlier,
                 const std::map<image_t, PoseConfidence>& confidences) {
  Movement movement;
  for (const auto& [id, image] : earlier.images) {
    const auto after = model.images.find(id);
    const auto confidence = confidences.find(id);
    if (after == model.images.end()) {
      movement.lost.push_back(id);
    } else if (confidence == confidences.end()) {
      movement.replaced.push_back(id);
    } else {
      movement.moves.push_back(MoveOf(id, image, after->second, confidence->second));
      movement.num_far += movement.moves.back().times > 1;
    }
  }
  std::stable_sort(movement.moves.begin(), movement.moves.end(),
                   [](const Move& a, const Move& b) { return a.times > b.times; });
  return movement;
}

// The images that tell the frame: not those whose poses were wrong, and found anew, unless there
// are no two others.
std::vector<image_t> ImagesOfFrame(const Reconstruction& model, const Reconstruction& earlier,
                                   const std::map<image_t, PoseConfidence>& confidences) {
  std::vector<image_t> all, kept;
  for (const auto& [id, image] : earlier.images) {
    if (model.images.count(id) == 0) continue;
    all.push_back(id);
    if (confidences.count(id) > 0) kept.push_back(id);
  }
  return kept.size() > 1 ? kept : all;
}

}  // namespace

std::vector<ResultWarning> KeepFrame(StageContext& context, const Reconstruction& earlier,
                                     const std::map<image_t, PoseConfidence>& confidences,
                                     Reconstruction& model) {
  ModelStage stage(context, "movement");
  model.Transform(FrameOf(earlier, model, ImagesOfFrame(model, earlier, confidences)));
  const auto& [moves, num_far, lost, replaced] = Measure(model, earlier, confidences);
  stage.Add("images", moves.size());
  stage.Add("images_lost", lost.size());
  stage.Add("images_replaced", replaced.size());
  stage.Add("images_beyond_confidence", num_far);
  if (!moves.empty()) {
    stage.Add("median_sigmas", moves[moves.size() / 2].times);
    stage.Add("largest_sigmas", moves.front().times);
  }
  std::vector<ResultWarning> warnings;
  const auto warn = [&](const std::string& what, const std::string& advice) {
    stage.RecordWarning(what);
    warnings.push_back({what, advice});
  };
  if (!lost.empty()) {
    warn(std::to_string(lost.size()) +
             " images of the input model see too few points and are left out: " +
             Names(context.scene, lost),
         "add photos that overlap with them");
  }
  if (!replaced.empty()) {
    warn(std::to_string(replaced.size()) +
             " poses of the input model did not fit the matches, and were found anew: " +
             Names(context.scene, replaced),
         "");
  }
  if (num_far > 0) {
    const std::span<const Move> far(moves.data(), num_far);
    std::vector<image_t> named;
    for (const Move& move : far) named.push_back(move.image_id);
    const std::string most = Formatted("%.1f times (%.2g degrees, %.2g units)", far[0].times,
                                       far[0].turn_deg, far[0].shift);
    warn(std::to_string(num_far) + " of " + std::to_string(moves.size()) +
             " poses of the input model moved by more than their confidence, by up to " + most +
             ": " + Reasons(model, earlier, confidences, far) + "; these are " +
             Names(context.scene, named),
         "where that is too far, reconstruct without --input_path");
  }
  return warnings;
}

}  // namespace cairn
