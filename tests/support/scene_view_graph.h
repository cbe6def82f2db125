#pragma once

#include <utility>
#include <vector>

#include "cairn/geometry/epipolar.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "cairn/scene/view_graph.h"
#include "cairn/synthetic/scene.h"
#include "synthetic/visible_points.h"

namespace cairn {

// The edge of two images with these matches, all of them right.
inline ViewEdge ExactEdge(const SyntheticScene& scene, const RegisteredImage& image1,
                          const RegisteredImage& image2, const FeatureMatches& matches) {
  std::vector<double> angles;
  for (const FeatureMatch& match : matches) {
    const Eigen::Vector3d& xyz = scene.truth.points3D.at(image1.point3D_ids[match.point1]).xyz;
    angles.push_back(AngleBetween(Eigen::Vector3d(image1.cam_from_world.Center() - xyz),
                                  Eigen::Vector3d(image2.cam_from_world.Center() - xyz)));
  }
  ViewEdge edge;
  edge.image_id1 = image1.image.image_id;
  edge.image_id2 = image2.image.image_id;
  edge.cam2_from_cam1 = image2.cam_from_world * Inverse(image1.cam_from_world);
  edge.cam2_from_cam1.translation.normalize();
  edge.num_inliers = static_cast<int>(matches.size());
  edge.residual_px = scene.options.image_noise_px;
  edge.triangulation_angle_deg = RadToDeg(UpperMedian(std::move(angles)));
  return edge;
}

// The exact view graph of a scene: an edge for every pair with so many common points.
inline ViewGraph MakeViewGraph(const SyntheticScene& scene, size_t min_num_matches = 20) {
  ViewGraph graph;
  std::vector<VisiblePoints> visible;
  for (const auto& [id, image] : scene.truth.images) {
    graph.image_ids.push_back(id);
    visible.push_back(FindVisiblePoints(scene, id));
  }
  for (size_t i = 0; i < visible.size(); ++i) {
    for (size_t j = i + 1; j < visible.size(); ++j) {
      const FeatureMatches common = CommonPoints(visible[i], visible[j]);
      if (common.size() < min_num_matches) continue;
      graph.edges.push_back(ExactEdge(scene, scene.truth.images.at(graph.image_ids[i]),
                                      scene.truth.images.at(graph.image_ids[j]), common));
    }
  }
  graph.Normalize();
  return graph;
}

}  // namespace cairn
