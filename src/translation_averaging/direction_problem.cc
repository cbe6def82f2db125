#include "translation_averaging/direction_problem.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "cairn/base/check.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

Eigen::Vector3d Normalized(const Eigen::Vector3d& direction) {
  CAIRN_CHECK(direction.allFinite());
  const double norm = direction.norm();
  CAIRN_CHECK_GT(norm, 0.0);
  return direction / norm;
}

DirectionEdge Canonical(const DirectionEdge& edge) {
  CAIRN_CHECK_NE(edge.image_id1, edge.image_id2);
  DirectionEdge result = edge;
  result.direction = Normalized(edge.direction);
  if (result.image_id1 > result.image_id2) {
    std::swap(result.image_id1, result.image_id2);
    result.direction = -result.direction;
  }
  return result;
}

// Rays as numbers that can be compared.
using RayKey = std::tuple<image_t, double, double, double>;
std::vector<RayKey> TrackKey(const PointDirections& track) {
  std::vector<RayKey> key;
  for (const PointRay& ray : track.rays) {
    const Eigen::Vector3d d = Normalized(ray.direction);
    key.emplace_back(ray.image_id, d.x(), d.y(), d.z());
  }
  std::sort(key.begin(), key.end());
  for (size_t k = 1; k < key.size(); ++k) {
    CAIRN_CHECK_NE(std::get<0>(key[k - 1]), std::get<0>(key[k]));
  }
  return key;
}

void AddTracks(std::span<const PointDirections> tracks, DirectionProblem& problem) {
  std::vector<std::vector<RayKey>> keys;
  for (const PointDirections& track : tracks) keys.push_back(TrackKey(track));
  const auto key = [&](int k) -> const std::vector<RayKey>& { return keys[k]; };
  for (const int k : SortedOrder(keys.size(), key)) {
    if (keys[k].size() < 2) continue;
    for (const auto& [image_id, x, y, z] : keys[k]) {
      problem.rays.push_back({IndexIn(problem.image_ids, image_id), Eigen::Vector3d(x, y, z)});
    }
    problem.track_begin.push_back(static_cast<int>(problem.rays.size()));
  }
}

}  // namespace

DirectionProblem MakeDirectionProblem(std::span<const DirectionEdge> input,
                                      std::span<const PointDirections> tracks) {
  std::vector<DirectionEdge> edges;
  for (const DirectionEdge& edge : input) edges.push_back(Canonical(edge));
  DirectionProblem problem;
  std::vector<image_t>& ids = problem.image_ids;
  for (const DirectionEdge& edge : edges) ids.insert(ids.end(), {edge.image_id1, edge.image_id2});
  for (const PointDirections& track : tracks) {
    if (track.rays.size() < 2) continue;
    for (const PointRay& ray : track.rays) ids.push_back(ray.image_id);
  }
  ids = Unique(std::move(ids));

  const auto key = [&](int e) {
    const DirectionEdge& edge = edges[e];
    return std::make_tuple(edge.image_id1, edge.image_id2, edge.direction.x(), edge.direction.y(),
                           edge.direction.z(), edge.length);
  };
  problem.edge_of_input.resize(edges.size());
  for (const int e : SortedOrder(edges.size(), key)) {
    problem.edge_of_input[e] = static_cast<int>(problem.edges.size());
    problem.edges.push_back({IndexIn(ids, edges[e].image_id1), IndexIn(ids, edges[e].image_id2),
                             edges[e].direction, edges[e].length, edges[e].num_points});
  }
  AddTracks(tracks, problem);
  return problem;
}

DirectionProblem Restrict(const DirectionProblem& problem, const std::vector<int>& cameras,
                          const std::vector<char>& edge_is_out) {
  DirectionProblem part;
  std::vector<int> new_camera(problem.NumCameras(), -1);
  for (const int camera : cameras) {
    new_camera[camera] = part.NumCameras();
    part.image_ids.push_back(problem.image_ids[camera]);
  }
  for (size_t e = 0; e < problem.edges.size(); ++e) {
    DirectionProblem::Edge edge = problem.edges[e];
    edge.camera1 = new_camera[edge.camera1];
    edge.camera2 = new_camera[edge.camera2];
    if (edge_is_out[e] || edge.camera1 < 0 || edge.camera2 < 0) continue;
    part.edges.push_back(edge);
  }
  for (int k = 0; k < problem.NumTracks(); ++k) {
    const size_t begin = part.rays.size();
    for (const DirectionProblem::Ray& ray : problem.RaysOf(k)) {
      if (new_camera[ray.camera] < 0) continue;
      part.rays.push_back({new_camera[ray.camera], ray.direction});
    }
    if (part.rays.size() < begin + 2) {
      part.rays.resize(begin);
      continue;
    }
    part.track_begin.push_back(static_cast<int>(part.rays.size()));
  }
  return part;
}

}  // namespace cairn
