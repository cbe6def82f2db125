#include <algorithm>
#include <functional>

#include "base/text.h"
#include "cairn/math/angles.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

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
  std::ranges::stable_sort(movement.moves, std::greater<>(), &Move::times);
  return movement;
}

// The images that tell the frame: not those whose poses were wrong, and found anew, unless there
// are no two others.
std::vector<image_t> ImagesOfFrame(const Reconstruction& model, const Reconstruction& earlier,
                                   const std::map<image_t, PoseConfidence>& confidences) {
  std::vector<image_t> all, kept;
  for (const auto& [id, image] : earlier.images) {
    if (!model.images.contains(id)) continue;
    all.push_back(id);
    if (confidences.contains(id)) kept.push_back(id);
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
  std::vector<image_t> far;
  for (const Move& move : moves) {
    if (move.times > kFarSigmas) far.push_back(move.image_id);
  }
  if (!far.empty()) {
    const std::string most =
        Formatted("%.1f standard deviations (%.2g degrees, %.2g units)", moves.front().times,
                  moves.front().turn_deg, moves.front().shift);
    warn(std::to_string(far.size()) + " of " + std::to_string(moves.size()) +
             " poses of the input model moved by more than three of their standard deviations, "
             "by up to " +
             most + ": " + Names(context.scene, far),
         "where that is too far, use the command reconstruct, without --input_path");
  }
  return warnings;
}

}  // namespace cairn
