#pragma once

#include <functional>
#include <string>
#include <vector>

#include "cairn/database/database.h"
#include "cairn/scene/view_graph.h"

namespace cairn {

// Every pair of two_view_geometries that has inliers or a pose as an edge, ascending by pair, with
// residual, angle and verifier from cairn_pair_metrics where they are.
// A pair without a stored pose (COLMAP up to 3.13 stores none) gets it from its E, or its F and the
// cameras, by the cheirality of its inliers. Panoramic pairs have a rotation alone. Pairs without a
// pose, or of other kinds (watermark, ...), come with the removal reason kNoPose. Rows that cannot
// be used are left out, and `warn` names them. `keep` gets every edge with its geometry, so that
// these are decoded once. Throws IoError where the database cannot be read.
std::vector<ViewEdge> ReadViewEdges(
    const Database& database,
    const std::function<void(const std::string&)>& warn = [](const std::string&) {},
    const std::function<void(const ViewEdge&, TwoViewGeometry&&)>& keep = {});

// A pair without translation is used if its camera turned: one that did neither sees what does not
// move with the scene, such as a watermark, dust, or the background of a turntable.
bool HasTurned(const Eigen::Quaterniond& cam2_from_cam1);

}  // namespace cairn
