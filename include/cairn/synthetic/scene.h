#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/scene/two_view_geometry.h"
#include "cairn/synthetic/rig.h"

namespace cairn {

class Database;

struct SceneOptions : RigOptions, EdgeNoise {
  int num_points = 2000;
  int max_keypoints = 1500;     // an image; more visible points than that: a random choice
  double salience = 0.0;        // 0: chosen evenly; 1: by chances that follow Zipf's law
  double image_noise_px = 0.0;  // see ObservationNoise
  double affine_noise = 0.0;
  double depth_noise = 0.0;
  double depth_gradient_noise = 0.0;
  double missing_depth_ratio = 0.0;  // share of keypoints without depth
  double outlier_ratio = 0.0;        // share of wrong matches in a pair that overlaps
  int num_chance_matches = 0;        // wrong matches of a pair that does not overlap
  int num_clutter_keypoints = 0;     // an image; keypoints that show no scene point

  // Duplicate structure: every second image is of another place, where the middle of the scene
  // looks the same and what is beside it does not. The truth then has both places on top of each
  // other.
  bool twin_places = false;

  // Of a database alone, as EdgeNoise: which pairs it has, and how wrong they are.
  int num_pairs = 0;  // those with the most points in common; 0: all
  // Share of pairs whose pose and matches mean nothing; of a city (with num_pairs, and 600 images),
  // those of places that look alike, wrong in the same way.
  double pair_outlier_ratio = 0.0;
  bool descriptors = true;
  bool pair_metrics = false;  // write the verifier's record of each pair; COLMAP has none

  // The fields above; RigOptions has its own list.
  void VisitFields(OptionVisitor& v);
};

// An abstract scene: what all stages up to matching would give, and the truth.
struct SyntheticScene {
  SceneOptions options;
  uint64_t seed = 0;
  int num_threads = 0;  // that make it, and fill databases; 0: all
  // All images, distractors last. Ids start with 1.
  std::vector<Image> images;
  std::map<camera_t, Camera> cameras;
  std::map<image_t, std::vector<Keypoint>> keypoints;
  std::map<image_t, std::vector<DepthSample>> depth_samples;  // in the image's own unit
  // Exact poses and points of all images but the distractors. points2D are the keypoints (with
  // noise); points have the tracks of all images that show them, at least two.
  Reconstruction truth;
};

SyntheticScene MakeScene(const SceneOptions& options, uint64_t seed, int num_threads = 0);

// Matches of a pair, image_id1 < image_id2: all correct ones that there are, outlier_ratio of wrong
// ones among them (or num_chance_matches, if there are fewer than two correct ones), each keypoint
// at most once, in a random order. The correct ones come with is_inlier.
struct SyntheticMatches {
  FeatureMatches matches;
  std::vector<bool> is_inlier;
};
SyntheticMatches MakeMatches(const SyntheticScene& scene, image_t image_id1, image_t image_id2);

// The exact relative pose (|t| = 1, config calibrated, E and F) of two images that are not
// distractors, with the correct ones of the given matches.
TwoViewGeometry TrueTwoViewGeometry(const SyntheticScene& scene, image_t image_id1,
                                    image_t image_id2, const SyntheticMatches& matches);

// Descriptors (rows x 128) of an image's keypoints: the same scene point looks nearly the same in
// all images.
Descriptors MakeDescriptors(const SyntheticScene& scene, image_t image_id);

// The stage up to which a database is filled. Each includes those before.
enum class SceneContent { kFeatures, kDepth, kMatches, kTwoViewGeometries };

// Writes the scene into a database, as the stages of build_view_graph would have.
void WriteScene(const SyntheticScene& scene, SceneContent content, Database& database);
// Makes the folder if absent, and in it scene.db, in place of an earlier one, and truth (a COLMAP
// model). Throws IoError.
void WriteSceneFolder(const SyntheticScene& scene, SceneContent content, const std::string& folder);

}  // namespace cairn
