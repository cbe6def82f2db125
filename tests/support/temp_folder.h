#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>

namespace cairn::testing {

// A fresh folder, removed with everything in it at the end of the test.
class TempFolder {
 public:
  // kMemory: in /dev/shm where that is possible, for thousands of small files.
  enum class Place { kDisk, kMemory };
  explicit TempFolder(Place place = Place::kDisk) {
    const bool in_memory = place == Place::kMemory && access("/dev/shm", W_OK) == 0;
    const std::filesystem::path parent =
        in_memory ? "/dev/shm" : std::filesystem::temp_directory_path();
    std::string name = (parent / "cairn_test_").string() + std::string(6, 'X');
    path_ = mkdtemp(name.data());
  }
  ~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

}  // namespace cairn::testing
