#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace cairn {

// A fresh folder, removed with everything in it at the end of the test.
class TempFolder {
 public:
  TempFolder() {
    std::string name = (Parent() / "cairn_test_").string() + std::string(6, 'X');
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
  // In memory, where nothing waits for a disk; unless TMPDIR says where, or there is little room.
  static std::filesystem::path Parent() {
    std::error_code error;
    const auto space = std::filesystem::space("/dev/shm", error);
    const bool has_room = !error && space.available > (1 << 30) && access("/dev/shm", W_OK) == 0;
    return has_room && !std::getenv("TMPDIR") ? "/dev/shm" : std::filesystem::temp_directory_path();
  }
  std::string path_;
};

}  // namespace cairn
