#include "base/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {
namespace {

// Whether the open file still has its name.
bool IsNamed(int descriptor, const std::string& path) {
  struct stat open_file, named;
  return fstat(descriptor, &open_file) == 0 && stat(path.c_str(), &named) == 0 &&
         open_file.st_ino == named.st_ino && open_file.st_dev == named.st_dev;
}

}  // namespace

int OpenLocked(const std::string& path, bool waits) {
  while (true) {
    const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (descriptor < 0) return -1;
    int result;
    do {
      result = flock(descriptor, waits ? LOCK_EX : LOCK_EX | LOCK_NB);
    } while (result != 0 && errno == EINTR);
    const bool is_taken = result != 0 && errno == EWOULDBLOCK;
    if (!is_taken && (result != 0 || IsNamed(descriptor, path))) return descriptor;
    close(descriptor);
    if (is_taken) {
      errno = EWOULDBLOCK;
      return -1;
    }
  }
}

FileLock::FileLock(const std::string& path)
    : lock_path_(BehindLinks(path) + ".lock"), descriptor_(OpenLocked(lock_path_, false)) {
  if (descriptor_ < 0 && errno == EWOULDBLOCK) {
    throw IoError(path, "another run of cairn is writing to it");
  }
}

FileLock::~FileLock() {
  if (descriptor_ < 0) return;
  unlink(lock_path_.c_str());
  close(descriptor_);
}

}  // namespace cairn
