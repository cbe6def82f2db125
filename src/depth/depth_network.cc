#include "cairn/depth/depth_network.h"

#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "image/cv_bitmap.h"

namespace cairn {
namespace {

void CheckNormalization(const DepthOptions& options) {
  if (options.mean.size() != 3) throw ConfigError("depth.mean", "needs three values");
  if (options.std.size() != 3) throw ConfigError("depth.std", "needs three values");
  for (const double value : options.std) {
    if (!(value > 0)) throw ConfigError("depth.std", "must be positive");
  }
}

}  // namespace

struct DepthNetwork::Impl {
  std::string path;
  DepthOptions options;
  cv::dnn::Net net;

  // 1 x 3 x S x S, normalized.
  cv::Mat MakeInput(const Bitmap& rgb) const {
    const int size = options.input_size;
    cv::Mat resized;
    cv::resize(View(rgb), resized, cv::Size(size, size), 0, 0,
               rgb.width > size ? cv::INTER_AREA : cv::INTER_LINEAR);
    const int dims[] = {1, 3, size, size};
    cv::Mat input(4, dims, CV_32F);
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const cv::Vec3b& pixel = resized.at<cv::Vec3b>(y, x);
        for (int c = 0; c < 3; ++c) {
          input.ptr<float>(0, c, y)[x] =
              static_cast<float>((pixel[c] / 255.0 - options.mean[c]) / options.std[c]);
        }
      }
    }
    return input;
  }
};

DepthNetwork::DepthNetwork(const std::string& path, const DepthOptions& options)
    : impl_(std::make_unique<Impl>()) {
  ValidateOptions(options, "depth");
  CheckNormalization(options);
  InputFile{path};  // throws where it cannot be read
  PrepareOpenCv();
  impl_->path = path;
  impl_->options = options;
  try {
    impl_->net = cv::dnn::readNetFromONNX(path);
  } catch (const cv::Exception& error) {
    ThrowIfOutOfMemory(error);
    throw IoError(path, "cannot be read as an ONNX network: " + error.err);
  }
  if (impl_->net.empty()) throw IoError(path, "the ONNX network is empty");
}

DepthNetwork::~DepthNetwork() = default;

DepthMap DepthNetwork::Compute(const Bitmap& rgb) {
  CAIRN_CHECK_EQ(rgb.channels, 3);
  CAIRN_CHECK(rgb.width > 0 && rgb.height > 0);
  cv::Mat output;
  try {
    impl_->net.setInput(impl_->MakeInput(rgb));
    output = impl_->net.forward();
  } catch (const cv::Exception& error) {
    ThrowIfOutOfMemory(error);
    throw IoError(impl_->path, "the network does not run on a " +
                                   std::to_string(impl_->options.input_size) +
                                   " px input: " + error.err);
  }
  const int dims = output.dims;
  const int height = dims >= 2 ? output.size[dims - 2] : 0;
  const int width = dims >= 2 ? output.size[dims - 1] : 0;
  if (height < 2 || width < 2 || output.total() != static_cast<size_t>(height) * width ||
      output.type() != CV_32F) {
    throw IoError(impl_->path, "the network's output is not one map");
  }
  const float* values = output.ptr<float>();
  return DepthMapFromValues(width, height, std::vector<float>(values, values + output.total()),
                            impl_->options);
}

}  // namespace cairn
