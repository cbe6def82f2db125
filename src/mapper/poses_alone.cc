#include <algorithm>

#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Median and shares below two limits, as values "<name>_median_deg", "<name>_within_5_deg" ...
void AddDistribution(const std::string& name, std::vector<double> errors_deg, Stage& stage) {
  if (errors_deg.empty()) return;
  std::sort(errors_deg.begin(), errors_deg.end());
  stage.Add(name + "_median_deg", errors_deg[errors_deg.size() / 2]);
  for (const int limit : {5, 20}) {
    const auto end = std::upper_bound(errors_deg.begin(), errors_deg.end(), limit);
    stage.Add(name + "_within_" + std::to_string(limit) + "_deg",
              static_cast<double>(end - errors_deg.begin()) / errors_deg.size());
  }
}

}  // namespace

void ReportAgreement(StageContext& context, const Reconstruction& model) {
  ModelStage stage(context, "agreement");
  std::vector<double> rotation_deg, direction_deg;
  for (const ViewEdge& edge : context.scene.edges) {
    const auto image1 = model.images.find(edge.image_id1);
    const auto image2 = model.images.find(edge.image_id2);
    if (image1 == model.images.end() || image2 == model.images.end()) continue;
    const Rigid3d pose = image2->second.cam_from_world * Inverse(image1->second.cam_from_world);
    rotation_deg.push_back(RadToDeg(AngleBetween(pose.rotation, edge.cam2_from_cam1.rotation)));
    direction_deg.push_back(
        RadToDeg(AngleBetween(pose.translation, edge.cam2_from_cam1.translation)));
  }
  stage.Add("images", model.images.size());
  stage.Add("pairs", rotation_deg.size());
  AddDistribution("rotation", std::move(rotation_deg), stage);
  AddDistribution("direction", std::move(direction_deg), stage);
}

}  // namespace cairn
