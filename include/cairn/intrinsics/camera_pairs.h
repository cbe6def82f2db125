#pragma once

#include <map>
#include <set>
#include <vector>

#include "cairn/database/database.h"

namespace cairn {

std::map<image_t, camera_t> CamerasOfImages(const Database& database);

// Pairs are drawn in the order of this: by chance, the same in every run.
uint64_t DrawingOrder(image_pair_t pair);

// So many pairs of each of the wanted cameras, ascending: some by chance, since those with the most
// matches are near each other, and nearly any focal length and distortion explain them. Images that
// camera_of lacks have none.
std::vector<image_pair_t> DrawPairs(std::vector<image_pair_t> pairs,
                                    const std::map<image_t, camera_t>& camera_of,
                                    const std::set<camera_t>& wanted, int max_per_camera);

// Removes the results and the jobs of verified pairs that have an image of one of these cameras.
// Returns the pairs, ascending. The caller has the transaction.
std::vector<image_pair_t> UndoVerification(Database& database,
                                           const std::map<image_t, camera_t>& camera_of,
                                           const std::set<camera_t>& cameras);

}  // namespace cairn
