#pragma once

#include <map>
#include <string>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/progress.h"
#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/scene/features.h"
#include "cairn/two_view/pair_verifier.h"

namespace cairn::experiments {

// Photographs with a reference, for the experiments on real pairs.
struct RealDataOptions {
  std::string database_path;
  std::string reference_path;
  std::string pairs_path;
  std::string scene = "scene";
  std::string depth_name = "depth";

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "database with keypoints, depth and matches");
    v.String("reference_path", reference_path,
             "reference poses: COLMAP model, bundle.out with its list, or folder of .camera files");
    v.String("pairs_path", pairs_path, "file with two image names a line; without, all pairs");
    v.String("scene", scene, "name of the scene in the tables");
    v.String("depth_name", depth_name, "name of the depth source in the tables");
  }
};

struct RealImage {
  std::string name;
  Camera camera;
  std::vector<Keypoint> keypoints;
  std::vector<DepthSample> depth;  // one a keypoint, or empty
};

struct RealPair {
  image_pair_t pair_id = 0;
  const RealImage* image1 = nullptr;
  const RealImage* image2 = nullptr;
  FeatureMatches matches;
  bool are_best_first = false;  // PairInput::are_best_first
  Rigid3d cam2_from_cam1;       // of the reference, not normalized
};

struct RealScene {
  std::map<image_t, RealImage> images;
  std::vector<RealPair> pairs;  // ascending; they point into images
};

// The database's pairs with at least min_num_matches matches that the reference connects: both
// images have a pose at different places, and, where the reference has points, see one in common.
// Images meet by name, or by the last part of their path. Throws IoError, and ConfigError where a
// path is missing or nothing is left.
RealScene LoadRealScene(const RealDataOptions& options, int min_num_matches,
                        ProgressMonitor& monitor);

PairInput InputOf(const RealPair& pair, uint64_t seed);

}  // namespace cairn::experiments
