#pragma once

#include <vector>

#include "cairn/base/options.h"
#include "cairn/image/bitmap.h"
#include "cairn/scene/features.h"

namespace cairn {

enum class FeatureType {
  kAffineDog,  // difference of Gaussians with Baumberg affine shape
  kSift,       // similarity frames, faster
};
inline constexpr NamedValue<FeatureType> kFeatureTypes[] = {{FeatureType::kAffineDog, "affine_dog"},
                                                            {FeatureType::kSift, "sift"}};

struct FeatureOptions {
  FeatureType type = FeatureType::kAffineDog;
  int max_num_features = 8192;
  int max_image_size = 3200;
  int first_octave = -1;
  double peak_threshold = 0.02 / 3;
  int min_num_extrema = 2000;
  double min_peak_threshold = 0.002;
  double edge_threshold = 10.0;
  int max_num_orientations = 2;
  bool estimate_upright = false;

  void VisitFields(OptionVisitor& v) {
    v.Choice("type", type, kFeatureTypes,
             "affine_dog: difference of Gaussians with Baumberg affine shape; sift: similarity "
             "frames, faster");
    v.Int("max_num_features", max_num_features, {1, 1000000}, "features kept in an image");
    v.Int("max_image_size", max_image_size, {16, 100000},
          "larger side, px, above which an image is reduced before detection");
    v.Int("first_octave", first_octave, {-1, 5},
          "finest octave; -1 doubles the image first, 1 halves it");
    v.Double("peak_threshold", peak_threshold, {0.0, 1.0},
             "smallest |DoG| response, image values in [0, 1]");
    v.Int("min_num_extrema", min_num_extrema, {0, 1000000},
          "where fewer reach peak_threshold, as many reach a lower threshold");
    v.Double("min_peak_threshold", min_peak_threshold, {0.0, 1.0}, "lowest such threshold");
    v.Double("edge_threshold", edge_threshold, {1.0, 1e6},
             "largest ratio of the principal curvatures of the response");
    v.Int("max_num_orientations", max_num_orientations, {1, 4}, "frames made from one point");
    v.Bool("estimate_upright", estimate_upright,
           "keep frames upright instead of orienting them by their gradients (cameras held level)");
  }
};

// Keypoints and their descriptors, row i belongs to keypoint i; larger frames first.
struct Features {
  std::vector<Keypoint> keypoints;
  Descriptors descriptors;  // n x 128 uint8: RootSIFT times 512, COLMAP's order of bins
  Polarities polarities;    // n
};

// Detects and describes local features of a gray image (channels = 1). Pixels as everywhere: the
// center of the top-left pixel is (0.5, 0.5). A frame's axes are as long as the scale (sigma) of
// the feature, as in COLMAP; the second axis is the image of "down" in the normalized patch.
//
// affine_dog: extrema of the difference of Gaussians (Lowe 2004), affine shape by Baumberg's
// iteration (Mikolajczyk and Schmid 2004), orientations, SIFT on the normalized patch.
// sift: the same without affine shape, M = scale * Rot(orientation).
// Both: RootSIFT (Arandjelovic and Zisserman 2012), min(255, round(512 x)).
//
// An image of little texture, where fewer than min_num_extrema reach peak_threshold, gets a lower
// one: the response of its min_num_extrema-th strongest extremum, but min_peak_threshold at least.
// That is five standard deviations of what noise of one gray level makes of the finest difference
// of Gaussians.
//
// mask, if given, has the image's size and one channel: where it is 0, there are no features (of
// which max_num_features counts none). An image without texture gives no features. The result
// depends on nothing but the arguments; single-threaded, safe to call from many threads.
Features ExtractFeatures(const Bitmap& gray, const FeatureOptions& options,
                         const Bitmap* mask = nullptr);

}  // namespace cairn
