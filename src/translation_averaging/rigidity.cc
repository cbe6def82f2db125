#include "translation_averaging/rigidity.h"

#include <algorithm>
#include <utility>

#include "graph/parallel_rigidity.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

// Cameras that are placed one after another, each by directions to two that are placed: a rigid
// set, as most cameras of a view graph are, found in O(edges).
struct Body {
  int first = -1, second = -1;  // where it began
  std::vector<char> has;        // by camera
  int size = 0;
};

Body GrowBody(const GraphAdjacency& adjacency, int num_cameras, int first, int second) {
  Body body{first, second, std::vector<char>(num_cameras, 0), 0};
  std::vector<int> num_placed(num_cameras, 0);    // neighbors
  std::vector<int> last_placed(num_cameras, -1);  // parallel edges count once
  std::vector<int> queue = {first, second};
  body.has[first] = body.has[second] = 1;
  for (size_t k = 0; k < queue.size(); ++k) {
    for (const int camera : adjacency.NeighborsOf(queue[k])) {
      if (body.has[camera] || last_placed[camera] == queue[k]) continue;
      last_placed[camera] = queue[k];
      if (++num_placed[camera] < 2) continue;
      body.has[camera] = 1;
      queue.push_back(camera);
    }
  }
  body.size = static_cast<int>(queue.size());
  return body;
}

// One with more than half of the cameras, if there is one that begins at the camera with the most
// edges and one of its first neighbors.
Body FindBody(int num_cameras, std::span<const GraphEdge> edges) {
  constexpr size_t kMaxTries = 10;
  const GraphAdjacency adjacency = BuildAdjacency(num_cameras, edges);
  int first = 0;
  for (int v = 1; v < num_cameras; ++v) {
    if (adjacency.EdgesOf(v).size() > adjacency.EdgesOf(first).size()) first = v;
  }
  const auto neighbors = num_cameras > 0 ? adjacency.NeighborsOf(first) : std::span<const int>();
  for (size_t k = 0; k < std::min(kMaxTries, neighbors.size()); ++k) {
    Body body = GrowBody(adjacency, num_cameras, first, neighbors[k]);
    if (2 * body.size > num_cameras) return body;
  }
  return {-1, -1, std::vector<char>(num_cameras, 0), 0};
}

// The pebble game over the cameras outside a body that is known to be rigid, and those of it that
// they have edges with: what is inside the body does not matter to others. (Whiteley 1996: a rigid
// part may be replaced by any other on its nodes.)
class Game {
 public:
  Game(const DirectionProblem& problem, const Body& body)
      : body_(body), rigidity_(problem.NumCameras()), is_tied_(problem.NumCameras(), 0) {
    if (body.size > 0) rigidity_.AddEdge(body.first, body.second);
  }

  void AddEdge(int camera1, int camera2) {
    if (body_.has[camera1] && body_.has[camera2]) return;
    Tie(camera1);
    Tie(camera2);
    rigidity_.AddEdge(camera1, camera2);
  }
  void AddTrack(std::span<const DirectionProblem::Ray> rays) {
    if (IsTiedTogether(rays)) return;
    const int point = rigidity_.AddNode();
    for (const DirectionProblem::Ray& ray : rays) {
      Tie(ray.camera);
      rigidity_.AddEdge(ray.camera, point);
    }
  }
  std::vector<int> LargestSet(int num_cameras) const {
    std::vector<int> best;
    for (const std::vector<int>& nodes : rigidity_.Components()) {
      std::vector<int> cameras;
      std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(cameras),
                   [&](int node) { return node < num_cameras; });
      AddBody(cameras);
      if (cameras.size() > best.size()) best = std::move(cameras);
    }
    return best;
  }

 private:
  // Where the cameras (of one component) have the two where the body began, all of it belongs.
  void AddBody(std::vector<int>& cameras) const {
    if (body_.size == 0) return;
    for (const int camera : {body_.first, body_.second}) {
      if (std::find(cameras.begin(), cameras.end(), camera) == cameras.end()) return;
    }
    for (size_t v = 0; v < body_.has.size(); ++v) {
      if (body_.has[v]) cameras.push_back(static_cast<int>(v));
    }
    cameras = Unique(std::move(cameras));
  }
  // Joins a camera of the body to the two where it began.
  void Tie(int camera) {
    if (!body_.has[camera] || is_tied_[camera]) return;
    is_tied_[camera] = 1;
    rigidity_.AddEdge(camera, body_.first);
    rigidity_.AddEdge(camera, body_.second);
  }
  bool IsTiedTogether(std::span<const DirectionProblem::Ray> rays) const {
    for (size_t a = 0; a < rays.size(); ++a) {
      for (size_t b = a + 1; b < rays.size(); ++b) {
        const int camera1 = rays[a].camera, camera2 = rays[b].camera;
        if (body_.has[camera1] && body_.has[camera2]) continue;
        if (!rigidity_.InOneComponent(camera1, camera2)) return false;
      }
    }
    return true;
  }

  const Body& body_;
  ParallelRigidity rigidity_;
  std::vector<char> is_tied_;
};

}  // namespace

std::vector<int> LargestPlaceableSet(const DirectionProblem& problem,
                                     const std::vector<char>& edge_is_out) {
  std::vector<GraphEdge> edges;
  for (size_t e = 0; e < problem.edges.size(); ++e) {
    if (!edge_is_out[e]) edges.push_back({problem.edges[e].camera1, problem.edges[e].camera2});
  }
  const Body body = FindBody(problem.NumCameras(), edges);
  Game game(problem, body);
  for (const GraphEdge& edge : edges) game.AddEdge(edge.node1, edge.node2);
  for (int k = 0; k < problem.NumTracks(); ++k) game.AddTrack(problem.RaysOf(k));
  const std::vector<int> best = game.LargestSet(problem.NumCameras());
  return best.size() < 2 ? std::vector<int>() : best;
}

}  // namespace cairn
