#pragma once

#include <algorithm>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/base/error.h"
#include "support/temp_folder.h"

namespace cairn::fuzz {

// Runs fn, which may refuse what it is given in the two ways that are documented.
template <class Fn>
void ReadOrRefuse(const Fn& fn) {
  try {
    fn();
  } catch (const IoError&) {
  } catch (const ConfigError&) {
  }
}

// A folder for the files of one input.
class Scratch {
 public:
  std::string Write(const std::string& name, std::string_view bytes) const {
    const std::string path = folder_ / name;
    std::ofstream(path, std::ios::binary).write(bytes.data(), std::ssize(bytes));
    return path;
  }
  const std::string& path() const { return folder_.path(); }

 private:
  TempFolder folder_;
};

// The line between two files of one input.
inline constexpr std::string_view kFileSeparator = "\n--- file ---\n";

// `n` files; those that are not there are empty.
inline std::vector<std::string_view> SplitFiles(std::string_view input, size_t n) {
  std::vector<std::string_view> files(n);
  for (size_t i = 0; i < n; ++i) {
    const size_t end =
        i + 1 < n ? std::min(input.find(kFileSeparator), input.size()) : input.size();
    files[i] = input.substr(0, end);
    input.remove_prefix(std::min(end + kFileSeparator.size(), input.size()));
  }
  return files;
}

// Takes values from the bytes of an input; zeros after their end.
class Bytes {
 public:
  explicit Bytes(std::string_view input) : rest_(input) {}

  bool IsEmpty() const { return rest_.empty(); }
  template <class T>
  T Take() {
    T value{};
    const std::string_view bytes = TakeBytes(sizeof(T));
    std::memcpy(&value, bytes.data(), bytes.size());
    return value;
  }
  // Less than n, which is positive.
  size_t TakeIndex(size_t n) { return Take<uint8_t>() % n; }
  std::string_view TakeBytes(size_t n) {
    const std::string_view bytes = rest_.substr(0, std::min(n, rest_.size()));
    rest_.remove_prefix(bytes.size());
    return bytes;
  }

 private:
  std::string_view rest_;
};

}  // namespace cairn::fuzz
