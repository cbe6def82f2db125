#pragma once

#include <cstring>
#include <string>
#include <type_traits>

#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {

// Reads little-endian binary data from a file held in memory. Nothing beyond the end is touched:
// every shortage is an IoError.
class ByteReader {
 public:
  explicit ByteReader(const std::string& path) : path_(path), bytes_(ReadFile(path)) {}

  template <class T>
  requires std::is_arithmetic_v<T> T Read() {
    T value;
    if (Remaining() < sizeof(T)) Fail("the file is truncated");
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }

  // A count of records of at least `record_size` bytes each, which must fit into the rest of the
  // file: so a damaged count cannot ask for more memory than the file is large.
  size_t ReadCount(size_t record_size) {
    const uint64_t count = Read<uint64_t>();
    if (count > Remaining() / record_size) {
      Fail("the file is truncated: " + std::to_string(count) + " records do not fit");
    }
    return static_cast<size_t>(count);
  }

  // Text up to a zero byte.
  std::string ReadCString() {
    const size_t end = bytes_.find('\0', position_);
    if (end == std::string::npos) Fail("the file is truncated");
    std::string text = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    return text;
  }

  void ExpectEnd() const {
    if (Remaining() > 0) Fail(std::to_string(Remaining()) + " bytes follow after the end");
  }
  size_t Remaining() const { return bytes_.size() - position_; }
  [[noreturn]] void Fail(const std::string& reason) const { throw IoError(path_, reason); }

 private:
  std::string path_;
  std::string bytes_;
  size_t position_ = 0;
};

}  // namespace cairn
