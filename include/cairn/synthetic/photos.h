#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/progress.h"
#include "cairn/depth/depth_map.h"
#include "cairn/image/bitmap.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/synthetic/rig.h"

namespace cairn {

struct PhotoOptions : RigOptions {
  int supersampling = 2;      // rays a pixel in x and in y
  double sensor_noise = 1.5;  // standard deviation, gray levels of 255
  double depth_noise = 0.02;  // relative; most of it varies slowly over the image
  int depth_downscale = 4;    // a depth map's pixel covers so many image pixels

  // The fields above; RigOptions has its own list.
  void VisitFields(OptionVisitor& v);
};

// A place that is photographed (all images but the distractors) and another one (the distractors).
struct PhotoScene {
  PhotoOptions options;
  uint64_t seed = 0;
  std::vector<Image> images;            // distractors last
  std::vector<Rigid3d> cam_from_world;  // one an image
  std::vector<double> depth_units;      // of the depth maps, per world unit
  Reconstruction truth;                 // cameras and poses without the distractors; no points
};

PhotoScene MakePhotoScene(const PhotoOptions& options, uint64_t seed);

// Renders image `index` by ray casting. The bytes do not depend on num_threads (0: all).
Bitmap RenderPhoto(const PhotoScene& scene, int index, int num_threads = 0);
// Its depth map, as a network might give it: depth at the centers of the map's pixels in the
// image's own unit, with noise; none where the sky is.
DepthMap RenderDepthMap(const PhotoScene& scene, int index, int num_threads = 0);

// Writes folder/images/<name> (JPEG, quality 95, with the focal length in EXIF),
// folder/depth/<name>.npy, and folder/truth (a COLMAP text model). Throws IoError.
void WritePhotoScene(const PhotoScene& scene, const std::string& folder, int num_threads,
                     ProgressMonitor& monitor);

}  // namespace cairn
