#include "base/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "cairn/base/error.h"

namespace cairn {
namespace {

// Whether the open file still has its name.
bool IsNamed(int descriptor, const std::string& path) {
  struct stat open_file, named;
  return fstat(descriptor, &open_file) == 0 && stat(path.c_str(), &named) == 0 &&
         open_file.st_ino == named.st_ino && open_file.st_dev == named.st_dev;
}

}  // namespace

FileLock::FileLock(const std::string& path) : lock_path_(path + ".lock") {
  // Again where the owner before removed the file between our opening and locking it.
  do {
    descriptor_ = open(lock_path_.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (descriptor_ < 0) return;
    if (flock(descriptor_, LOCK_EX | LOCK_NB) == 0) {
      if (IsNamed(descriptor_, lock_path_)) return;
    } else if (errno == EWOULDBLOCK) {
      close(descriptor_);
      throw IoError(path, "another run of cairn is writing to it");
    } else {
      return;
    }
    close(descriptor_);
  } while (true);
}

FileLock::~FileLock() {
  if (descriptor_ < 0) return;
  unlink(lock_path_.c_str());
  close(descriptor_);
}

}  // namespace cairn
