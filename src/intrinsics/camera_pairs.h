#pragma once

#include <map>
#include <set>
#include <vector>

#include "cairn/database/database.h"

namespace cairn {

std::map<image_t, camera_t> CamerasOfImages(const Database& database);

// The key by which pairs are drawn: a random order, the same in every run.
uint64_t DrawingOrder(image_pair_t pair);

// Pairs until each of the wanted cameras has max_per_camera of them, if there are so many;
// ascending. They are drawn at random, since the pairs with the most matches are close to each
// other, and nearly any focal length and distortion explain them. Pairs of images that camera_of
// lacks are left out.
std::vector<image_pair_t> DrawPairs(std::vector<image_pair_t> pairs,
                                    const std::map<image_t, camera_t>& camera_of,
                                    const std::set<camera_t>& wanted, int max_per_camera);

// Has the pair an image of one of these cameras?
bool IsOfCameras(image_pair_t pair, const std::map<image_t, camera_t>& camera_of,
                 const std::set<camera_t>& cameras);

// Removes the results and the jobs of verified pairs that have an image of one of these cameras.
// Returns the pairs, ascending. The caller has the transaction.
std::vector<image_pair_t> UndoVerification(Database& database,
                                           const std::map<image_t, camera_t>& camera_of,
                                           const std::set<camera_t>& cameras);

}  // namespace cairn
