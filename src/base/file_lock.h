#pragma once

#include <string>

namespace cairn {

// Opens a file for writing, or makes it, and locks it (flock); another file where the owner before
// renamed or removed this one meanwhile. -1 with errno: it cannot be opened,
// or, without waiting, another has the lock (EWOULDBLOCK). A file system without locks does
// without.
int OpenLocked(const std::string& path, bool waits);

// While it lives, no other FileLock of the same path can be made, in this process or another: its
// constructor throws IoError. The lock is that of a file `path`.lock (of the path that links lead
// to), which it removes; the system gives it up when a process is killed. Where no such file can be
// made, or the file system has no locks, there is none.
class FileLock {
 public:
  explicit FileLock(const std::string& path);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

 private:
  std::string lock_path_;
  int descriptor_;
};

}  // namespace cairn
