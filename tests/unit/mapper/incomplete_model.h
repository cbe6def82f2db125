#pragma once

#include <set>

#include "cairn/math/angles.h"
#include "mapper/stages.h"
#include "support/scene_view_graph.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {

// A scene with all of its pairs, and its true model without some images. Every image has a camera
// of its own.
struct IncompleteModel {
  explicit IncompleteModel(const std::set<image_t>& left_out, uint64_t seed = 1,
                           SceneOptions options = SmallScene()) {
    options.num_cameras = options.num_images;
    const SyntheticScene synthetic = MakeScene(options, seed);
    truth = model = synthetic.truth;
    graph = MakeViewGraph(synthetic);
    scene.cameras = synthetic.cameras;
    for (auto& [id, camera] : scene.cameras) camera.has_prior_focal_length = true;
    for (const auto& [id, image] : truth.images) {
      scene.images[id] = image.image;
      scene.pixels[id] = image.points2D;
      scene.scales[id].assign(image.points2D.size(), 2.0f);
    }
    for (const ViewEdge& edge : graph.edges) {
      scene.matches[edge.PairId()] =
          TrueTwoViewGeometry(synthetic, edge.image_id1, edge.image_id2,
                              MakeMatches(synthetic, edge.image_id1, edge.image_id2))
              .inlier_matches;
    }
    for (const image_t id : left_out) {
      RemoveImage(id, model);
      model.cameras.erase(truth.images.at(id).image.camera_id);
    }
  }

  BuiltModel Built() const { return {model, graph, EvidenceFor(context, model, graph), {}}; }
  int Register() { return RegisterLeftOut(context, graph, model); }

  double RotationErrorDeg(image_t id) const {
    return RadToDeg(AngleBetween(model.images.at(id).cam_from_world.rotation,
                                 truth.images.at(id).cam_from_world.rotation));
  }
  double CenterError(image_t id) const {
    return (model.images.at(id).cam_from_world.Center() -
            truth.images.at(id).cam_from_world.Center())
        .norm();
  }

  Reconstruction truth, model;
  ViewGraph graph;
  SceneData scene;
  ReconstructSettings settings;
  RunReport report;
  StageContext context{scene, settings, kOneThread, report};
};

}  // namespace cairn
