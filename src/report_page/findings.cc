#include <algorithm>
#include <cmath>

#include "base/text.h"
#include "report_page/page_parts.h"

namespace cairn {
namespace {

// A pose whose direction is less sure than this is said to be weak: 1 degree is the finest
// threshold at which poses are scored (see evaluation).
constexpr double kWeakRotationDeg = 1.0;
// EXIF's focal length has a standard deviation of 10 % (see third_party_notes/lensfun.md); beyond
// two of them it is contradicted.
constexpr double kFocalTolerance = 0.2;

std::string Photos(size_t n) { return std::to_string(n) + (n == 1 ? " photo" : " photos"); }

Json Finding(const char* level, const std::string& what, const std::string& advice,
             std::vector<int> images = {}) {
  return {{"level", level}, {"what", what}, {"advice", advice}, {"images", std::move(images)}};
}

// Text of a report that somebody may have changed; "" where there is none.
std::string TextOf(const Json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

void AddRunFindings(const PageScene& scene, Json& findings) {
  const Json& run = scene.run_report;
  if (!run.is_object()) return;
  const std::string failure = TextOf(run, "failure");
  if (!failure.empty()) findings.push_back(Finding("wrong", failure, ""));
  if (!run.contains("warnings") || !run["warnings"].is_array()) return;
  for (const Json& item : run["warnings"]) {
    const std::string what = TextOf(item, "what");
    const bool is_wrong = TextOf(item, "level") == "wrong";
    if (what.empty()) continue;
    findings.push_back(Finding(is_wrong ? "wrong" : "doubtful", what, TextOf(item, "advice")));
  }
}

// The positions of images of which something is true.
template <class Condition>
std::vector<int> ImagesThat(const PageScene& scene, const Condition& condition) {
  std::vector<int> images;
  for (size_t i = 0; i < scene.images.size(); ++i) {
    if (condition(scene.images[i])) images.push_back(static_cast<int>(i));
  }
  return images;
}

// The judgement of models that come without a run's report.
void AddContradictions(const PageScene& scene, Json& findings) {
  if (scene.run_report.is_object()) return;
  const std::vector<int> images =
      ImagesThat(scene, [](const PageImage& image) { return image.support.IsContradicted(); });
  if (images.empty()) return;
  findings.push_back(Finding("doubtful",
                             Photos(images.size()) + " contradict most of their verified matches "
                                                     "and are probably misplaced",
                             kMisplacedAdvice, images));
}

void AddWeakPoses(const PageScene& scene, Json& findings) {
  const std::vector<int> images = ImagesThat(scene, [&](const PageImage& image) {
    return image.model >= 0 && !scene.input.models[image.model].points3D.empty() &&
           !(image.confidence.rotation_sigma_deg <= kWeakRotationDeg);
  });
  if (images.empty()) return;
  const std::string hang = images.size() == 1 ? " hangs" : " hang";
  findings.push_back(
      Finding("doubtful",
              Photos(images.size()) + hang +
                  " on few points: the standard deviation of the direction is more than 1 degree",
              "Add photos that overlap with these.", images));
}

void AddLeftOut(const PageScene& scene, Json& findings) {
  std::map<LeftOutReason, std::vector<int>> groups;
  for (const int i : ImagesThat(scene, [](const PageImage& image) { return image.model < 0; })) {
    groups[WhyLeftOut(scene.images[i], scene.has_features)].push_back(i);
  }
  for (const auto& [reason, images] : groups) {
    findings.push_back(Finding("note",
                               Photos(images.size()) + (images.size() == 1 ? " is" : " are") +
                                   " in no model: " + reason.what,
                               reason.advice, images));
  }
}

void AddSkippedFiles(const PageScene& scene, Json& findings) {
  for (const PhotoRecord& photo : scene.database.ReadPhotos()) {
    if (photo.error.empty()) continue;
    findings.push_back(Finding("note", photo.name + " was skipped: " + photo.error,
                               "Replace the file, and run build_view_graph again."));
  }
}

void AddDoubtfulCameras(const PageScene& scene, Json& findings) {
  std::map<std::string, std::vector<std::string>> groups;
  for (const auto& [id, camera] : scene.cameras) {
    const std::string doubt = DoubtAboutCamera(camera);
    if (!doubt.empty()) groups[doubt].push_back(std::to_string(id));
  }
  for (const auto& [doubt, ids] : groups) {
    findings.push_back(Finding(
        "doubtful", (ids.size() > 1 ? "Cameras " : "Camera ") + FirstNames(ids, 8) + ": " + doubt,
        "Give the calibration, where you have it: --camera_model and --camera_params of "
        "build_view_graph; or take more photos with the same camera and zoom "
        "(--single_camera, --single_camera_per_folder)."));
  }
}

}  // namespace

std::string DoubtAboutCamera(const PageCamera& camera) {
  const bool is_known = !camera.known.camera.params.empty();  // the database may lack it
  if (!camera.refined || !is_known || camera.known.is_given) return "";
  const Camera& before = camera.known.camera;
  if (camera.known.IsRejected()) {
    return Formatted("%d of %d pairs contradict the focal length that came with the photos",
                     camera.known.judgement->num_contradicting, camera.known.judgement->num_pairs);
  }
  const double focal_px = camera.refined->MeanFocal();
  const double ratio = focal_px / before.MeanFocal();
  if (before.has_prior_focal_length && std::abs(std::log(ratio)) > kFocalTolerance) {
    return Formatted("the focal length became %.0f px, where the photos came with %.0f px",
                     focal_px, before.MeanFocal());
  }
  if (!camera.known.IsFocalTrusted() && focal_px == before.MeanFocal()) {
    return "the focal length is a guess that nothing confirmed";
  }
  return "";
}

LeftOutReason WhyLeftOut(const PageImage& image, bool has_features) {
  if (image.num_verified == 0 && !has_features) {
    return {"no relative pose with others is known", "Add pairs that connect them."};
  }
  if (image.num_verified == 0 && image.num_keypoints == 0) {
    return {"no features were found", "They may be blurred, dark or empty; take sharper ones."};
  }
  if (image.num_verified == 0 && image.num_matched == 0) {
    return {"no photo has matches with them", "Add photos that show how this place continues."};
  }
  if (image.num_verified == 0) {
    return {
        "none of their pairs passed verification: they show another place, or too little of the "
        "same",
        "Add photos that overlap with both."};
  }
  if (image.num_pairs == 0) {
    const auto most =
        std::ranges::max_element(image.removals, {}, [](auto& entry) { return entry.second; });
    return {"all their pairs were taken out (mostly: " + most->first + ")",
            "Look at these pairs in the view graph; add photos with more overlap."};
  }
  if (image.num_to_models == 0) {
    return {"they connect with each other only, and no model came of it",
            "Add photos between these and the others, or lower --reconstruct.min_model_images."};
  }
  return {"too few of their matches show points of a model",
          "Add photos that overlap with these and with the model."};
}

Json Findings(const PageScene& scene) {
  Json findings = Json::array();
  AddRunFindings(scene, findings);
  AddContradictions(scene, findings);
  AddDoubtfulCameras(scene, findings);
  AddWeakPoses(scene, findings);
  AddLeftOut(scene, findings);
  AddSkippedFiles(scene, findings);
  const auto rank = [](const Json& finding) {
    return finding["level"] == "wrong" ? 0 : finding["level"] == "doubtful" ? 1 : 2;
  };
  std::stable_sort(findings.begin(), findings.end(),
                   [&](const Json& a, const Json& b) { return rank(a) < rank(b); });
  return findings;
}

}  // namespace cairn
