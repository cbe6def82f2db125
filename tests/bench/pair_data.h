#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "cairn/database/database.h"
#include "cairn/depth/options.h"
#include "cairn/two_view/pair_verifier.h"

namespace cairn::bench {

struct ImageData {
  std::string name;
  Camera camera;
  std::vector<Keypoint> keypoints;
  std::vector<DepthSample> depth;
};

// What pairs are verified from, in memory.
struct PairData {
  std::map<image_t, ImageData> images;
  std::vector<std::pair<image_pair_t, FeatureMatches>> pairs;
  std::vector<bool> are_best_first;  // of pairs

  PairInput Input(size_t index, uint64_t seed) const;
};

PairData ReadPairData(const std::string& database_path);

// Replaces the depth of every image. source: a folder of maps, a network (.onnx) that is run on the
// photographs image_path/<scene>/images/<file> of the images named <scene>_<file>, or "none".
void ReadDepth(const std::string& source, const std::string& image_path,
               const DepthOptions& options, PairData* data);

}  // namespace cairn::bench
