#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/progress.h"
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

// z-depth over an image, as a depth network might give it: in a unit of its own, 0 where there is
// none (the sky). The map is stretched over the image.
struct SyntheticDepthMap {
  int width = 0;
  int height = 0;
  std::vector<float> depth;  // row-major
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
// Its depth map: depth at the centers of the map's pixels, times the image's unit, with noise.
SyntheticDepthMap RenderDepthMap(const PhotoScene& scene, int index, int num_threads = 0);

// Writes folder/images/<name> (JPEG, quality 95, with the focal length in EXIF),
// folder/depth/<name>.npy, and folder/truth (a COLMAP text model). Throws IoError.
void WritePhotoScene(const PhotoScene& scene, const std::string& folder, int num_threads,
                     ProgressMonitor& monitor);

}  // namespace cairn
