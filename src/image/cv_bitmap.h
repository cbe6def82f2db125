#pragma once

#include <new>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <string>
#include <string_view>

#include "cairn/image/bitmap.h"

namespace cairn {

// OpenCV has an error code where others throw std::bad_alloc.
inline void ThrowIfOutOfMemory(const cv::Exception& exception) {
  if (exception.code == cv::Error::StsNoMem) throw std::bad_alloc();
}

// Before each call of OpenCV that may use threads or write to the terminal: callers have an image a
// thread, and OpenCV would add its own to each; its exceptions say what is wrong. Once only:
// setNumThreads crashes while another thread is inside OpenCV.
inline void PrepareOpenCv() {
  [[maybe_unused]] static const auto before =
      (cv::setNumThreads(1), cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT));
}

// OpenCV's view of a bitmap's pixels (channels in our order).
inline cv::Mat View(const Bitmap& bitmap) {
  return {bitmap.height, bitmap.width, CV_8UC(bitmap.channels),
          const_cast<uint8_t*>(bitmap.data.data())};
}

// The pixels of an image file in memory; flags as cv::imdecode has them. Throws IoError(path,
// reason).
cv::Mat DecodeToMat(const std::string& path, std::string_view bytes, int flags);

}  // namespace cairn
