#include "translation_averaging/rigidity.h"

#include <algorithm>

#include "graph/parallel_rigidity.h"

namespace cairn {
namespace {

bool IsTiedTogether(const ParallelRigidity& rigidity, std::span<const DirectionProblem::Ray> rays) {
  for (size_t a = 0; a < rays.size(); ++a) {
    for (size_t b = a + 1; b < rays.size(); ++b) {
      if (!rigidity.InOneComponent(rays[a].camera, rays[b].camera)) return false;
    }
  }
  return true;
}

}  // namespace

std::vector<int> LargestPlaceableSet(const DirectionProblem& problem,
                                     const std::vector<char>& edge_is_out) {
  ParallelRigidity rigidity(problem.NumCameras());
  for (size_t e = 0; e < problem.edges.size(); ++e) {
    if (!edge_is_out[e]) rigidity.AddEdge(problem.edges[e].camera1, problem.edges[e].camera2);
  }
  for (int k = 0; k < problem.NumTracks(); ++k) {
    const auto rays = problem.RaysOf(k);
    if (IsTiedTogether(rigidity, rays)) continue;
    const int point = rigidity.AddNode();
    for (const DirectionProblem::Ray& ray : rays) rigidity.AddEdge(ray.camera, point);
  }
  std::vector<int> best;
  for (const std::vector<int>& nodes : rigidity.Components()) {
    std::vector<int> cameras;
    std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(cameras),
                 [&](int node) { return node < problem.NumCameras(); });
    if (cameras.size() > best.size()) best = cameras;
  }
  return best.size() < 2 ? std::vector<int>() : best;
}

}  // namespace cairn
