#pragma once

#include <map>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/camera/camera.h"
#include "cairn/scene/image.h"
#include "cairn/synthetic/poses.h"

namespace cairn {

// What abstract scenes and photographs have in common: which cameras there are and where they
// stand.
struct RigOptions {
  CameraLayout layout = CameraLayout::kRing;
  int num_images = 12;
  int num_distractor_images = 0;  // of another place
  int num_cameras = 2;            // different focal lengths and sizes; images take turns
  double own_camera_share = 0.0;  // of the images that have a camera of their own
  CameraModel camera_model = CameraModel::kSimplePinhole;
  double radial_distortion = 0.0;  // first radial coefficient, where the model has one
  // In units of the larger side; 0: those of 36 mm to 56 mm lenses.
  double focal_length = 0.0;
  int image_width = 1024;  // of the first camera; every second camera has 0.8 of it
  int image_height = 768;
  double distance = 3.0;  // of the cameras from the scene's center; the scene's radius is 1

  void VisitFields(OptionVisitor& v);
};

// The focal length of a camera in 35 mm equivalents: whole numbers from 36 to 56, since EXIF holds
// no others; or options.focal_length, rounded to one.
int FocalLength35mm(const RigOptions& options, int camera_index);

// Cameras 1 .. num_cameras, then those of single images, with focal lengths as EXIF would hold
// them, or exactly options.focal_length.
std::map<camera_t, Camera> MakeCameras(const RigOptions& options);

// Images of the scene, then the distractors, ids from 1: "image00000.jpg", "other00000.jpg".
std::vector<Image> MakeImages(const RigOptions& options);

}  // namespace cairn
