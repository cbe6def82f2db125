#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>

namespace cairn {

// While it lives, this process has no right to write into a folder that ReadOnly() closed, even
// where the tests run as root (in a container).
class Unprivileged {
 public:
  Unprivileged() : is_root_(geteuid() == 0) {
    constexpr uid_t kNobody = 65534;
    if (is_root_ && seteuid(kNobody) != 0) is_root_ = false;
  }
  ~Unprivileged() {
    if (is_root_ && seteuid(0) != 0) std::abort();
  }
  Unprivileged(const Unprivileged&) = delete;
  Unprivileged& operator=(const Unprivileged&) = delete;

 private:
  bool is_root_;
};

// Everybody may read, nobody may write.
inline void ReadOnly(const std::filesystem::path& path) {
  using std::filesystem::perms;
  auto rights = perms::owner_read | perms::group_read | perms::others_read;
  if (std::filesystem::is_directory(path)) {
    rights |= perms::owner_exec | perms::group_exec | perms::others_exec;
  }
  std::filesystem::permissions(path, rights);
}

}  // namespace cairn
