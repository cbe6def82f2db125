#include "view_graph/symmetry.h"

#include <cmath>
#include <set>

#include "cairn/math/angles.h"

namespace cairn {
namespace {

constexpr double kMinAngleDeg = 20.0;  // of a symmetry; less is an inexact pose
constexpr double kMaxSpreadDeg = 4.0;  // of the turns of one symmetry
constexpr int kMinInliers = 30;        // of a pair that counts
constexpr size_t kMaxTurns = 3000;     // looked at; every k-th of more

// By how much a pair would turn its second image in the model's frame, as an axis on the upper half
// of the sphere: the pair the other way round would turn it back.
Eigen::Quaterniond TurnOf(const Reconstruction& model, const ViewEdge& edge) {
  const Eigen::Quaterniond& R1 = model.images.at(edge.image_id1).cam_from_world.rotation;
  const Eigen::Quaterniond& R2 = model.images.at(edge.image_id2).cam_from_world.rotation;
  return R2.conjugate() * edge.cam2_from_cam1.rotation * R1;
}

bool IsSameOrBack(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  static const double kMinCosine = std::cos(DegToRad(kMaxSpreadDeg) / 2);
  return std::abs(a.dot(b)) > kMinCosine || std::abs(a.dot(b.conjugate())) > kMinCosine;
}

}  // namespace

Symmetry FindSymmetry(const Reconstruction& model, const ViewGraph& graph) {
  Symmetry symmetry;
  std::vector<Eigen::Quaterniond> turns;
  std::vector<const ViewEdge*> edges;  // of the turns
  for (const ViewEdge& edge : graph.edges) {
    if (edge.num_inliers < kMinInliers || !model.images.contains(edge.image_id1) ||
        !model.images.contains(edge.image_id2)) {
      continue;
    }
    if (edge.IsActive()) ++symmetry.num_active;
    // Only what contradicts a rotation: others have none, or agree with it.
    if (edge.removal != EdgeRemoval::kRotationInconsistent &&
        edge.removal != EdgeRemoval::kTripletInconsistent &&
        edge.removal != EdgeRemoval::kModelInconsistent &&
        edge.removal != EdgeRemoval::kAmbiguous) {
      continue;
    }
    const Eigen::Quaterniond turn = TurnOf(model, edge);
    if (turn.angularDistance(Eigen::Quaterniond::Identity()) > DegToRad(kMinAngleDeg)) {
      turns.push_back(turn);
      edges.push_back(&edge);
    }
  }
  const size_t step = 1 + turns.size() / kMaxTurns;
  size_t best = turns.size();
  for (size_t i = 0; i < turns.size(); i += step) {
    int num_alike = 0;
    for (size_t j = 0; j < turns.size(); j += step) num_alike += IsSameOrBack(turns[i], turns[j]);
    num_alike *= static_cast<int>(step);
    if (num_alike <= symmetry.num_pairs) continue;
    best = i;
    symmetry.num_pairs = num_alike;
    symmetry.angle_deg = RadToDeg(turns[i].angularDistance(Eigen::Quaterniond::Identity()));
  }
  std::set<image_t> images;
  for (size_t j = 0; j < turns.size() && best < turns.size(); ++j) {
    if (!IsSameOrBack(turns[best], turns[j])) continue;
    images.insert({edges[j]->image_id1, edges[j]->image_id2});
  }
  symmetry.images.assign(images.begin(), images.end());
  return symmetry;
}

}  // namespace cairn
