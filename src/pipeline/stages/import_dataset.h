#pragma once

#include <vector>

#include "cairn/io/one_dsfm.h"
#include "cairn/pipeline/stages.h"

namespace cairn {

// The images of cc.txt, by their names below <folder>/images, with the focal lengths of list.txt.
std::vector<PhotoSource::Photo> SelectDatasetPhotos(const OneDsfmDataset& dataset);

// The pairs of EGs.txt between images of the database, ascending.
std::vector<image_pair_t> FindDatasetPairs(const OneDsfmDataset& dataset,
                                           const std::vector<Image>& images);

// A data set without photographs: its images (id = index in list.txt + 1) with cameras, keypoints
// from coords.txt, matches from tracks.txt, where those are there, and its EGs as two-view
// geometries with the verifier name "imported", all in one transaction. Without coords.txt the
// size of an image is unknown; then it is a square that fits its focal length. Throws IoError with
// file and line, ConfigError if the database has another data set.
StageReport ImportDataset(Database& database, const OneDsfmDataset& dataset,
                          const CameraOptions& options, const RunContext& run);

}  // namespace cairn
