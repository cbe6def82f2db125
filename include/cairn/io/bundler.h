#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// A line of Bundler's list file: `<name>`, or `<name> 0 <focal length in px>`.
struct BundlerListEntry {
  std::string name;
  std::optional<double> focal_px;
};
// Throws IoError with file and line.
std::vector<BundlerListEntry> ReadBundlerList(const std::string& path);

struct BundlerReadOptions {
  bool read_points = true;
};

// Reads a Bundler file (v0.3): the registered cameras as images with our frame (src/io/FORMATS.md),
// image id and camera id = line number in the list + 1. A Bundler file has no image sizes, so every
// camera is RADIAL with width = height = 0, and pixels are relative to the image center: x right, y
// down, principal point (0, 0). Points keep their order; keypoints are one for each view, in
// each image in the order of Bundler's keys; where view lists have no pixel coordinates (1DSfM's
// references), points have no track. Throws IoError with file and line.
//
// The view lists of 1DSfM's gt_bundle.out count valid cameras only, not all: read it without
// points.
Reconstruction ReadBundler(const std::string& bundle_path, const std::string& list_path,
                           const BundlerReadOptions& options = {});

// Writes bundle.out and its list file. `all_images` gives the order of cameras; those that are not
// registered become zeros. Empty: the registered images in the order of their ids. Bundler's camera
// has one focal length, two radial coefficients and a central principal point: whatever does not
// fit (fx and fy differ, a principal point off the center, tangential distortion) is approximated;
// each kind is one line of the returned warnings. Keys are keypoint pixels relative to the image
// center, y up. Throws IoError.
std::vector<std::string> WriteBundler(const Reconstruction& reconstruction,
                                      const std::string& bundle_path, const std::string& list_path,
                                      const std::vector<Image>& all_images = {});

}  // namespace cairn
