#pragma once

#include <new>
#include <opencv2/core.hpp>

namespace cairn {

// OpenCV has an error code where others throw std::bad_alloc.
inline void ThrowIfOutOfMemory(const cv::Exception& exception) {
  if (exception.code == cv::Error::StsNoMem) throw std::bad_alloc();
}

}  // namespace cairn
