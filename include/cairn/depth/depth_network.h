#pragma once

#include <memory>
#include <string>

#include "cairn/depth/depth_map.h"
#include "cairn/image/bitmap.h"

namespace cairn {

// A monocular depth network in an ONNX file, run by OpenCV. Its input is 1 x 3 x S x S (RGB; the
// image is stretched to a square of side options.input_size), its output one channel of any size.
// An object belongs to one thread at a time.
class DepthNetwork {
 public:
  // Throws IoError when the file cannot be read as a network, ConfigError on wrong mean or std.
  DepthNetwork(const std::string& path, const DepthOptions& options);
  ~DepthNetwork();

  // rgb has 3 channels. Throws IoError, naming the model, when the network cannot run on its input
  // or does not return one map.
  DepthMap Compute(const Bitmap& rgb);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cairn
