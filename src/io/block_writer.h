#pragma once

#include <string>
#include <string_view>

#include "cairn/base/file.h"

namespace cairn {

// Appends bytes, in blocks, to a file that appears on Commit.
class BlockWriter {
 public:
  explicit BlockWriter(const std::string& path) : file_(path) {}

  void Append(std::string_view bytes) {
    buffer_ += bytes;
    if (buffer_.size() > kBlockSize) Flush();
  }
  // Writes what is buffered, so that Commit needs no space.
  void Flush() {
    file_.Write(buffer_);
    buffer_.clear();
  }
  void Commit() {
    Flush();
    file_.Commit();
  }

 private:
  static constexpr size_t kBlockSize = 1 << 20;
  AtomicFile file_;
  std::string buffer_;
};

}  // namespace cairn
