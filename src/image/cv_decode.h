#pragma once

#include <new>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>

namespace cairn {

// OpenCV has an error code where others throw std::bad_alloc.
inline void ThrowIfOutOfMemory(const cv::Exception& exception) {
  if (exception.code == cv::Error::StsNoMem) throw std::bad_alloc();
}

// The pixels of an image file in memory; flags as cv::imdecode has them. Throws IoError(path,
// reason).
cv::Mat DecodeToMat(const std::string& path, std::string_view bytes, int flags);

}  // namespace cairn
