#include "cairn/base/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "base/file_lock.h"
#include "base/hash.h"
#include "base/text.h"
#include "cairn/base/check.h"
#include "cairn/base/error.h"

namespace cairn {

InputFile::InputFile(const std::string& path)
    // Without O_NONBLOCK, opening a pipe waits for its writer.
    : path_(path), descriptor_(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)) {
  if (descriptor_ < 0) throw IoError(path, std::strerror(errno));
  struct stat status;
  const char* reason = nullptr;
  if (fstat(descriptor_, &status) != 0) {
    reason = std::strerror(errno);
  } else if (S_ISDIR(status.st_mode)) {
    reason = "is a folder, not a file";
  } else if (!S_ISREG(status.st_mode)) {
    reason = "is a pipe or a device, not a file";
  }
  if (reason) {
    close(descriptor_);
    throw IoError(path, reason);
  }
  size_ = static_cast<size_t>(status.st_size);
}

InputFile::~InputFile() { close(descriptor_); }

size_t InputFile::Read(char* data, size_t num_bytes) {
  size_t used = 0;
  while (used < num_bytes) {
    const ssize_t count = read(descriptor_, data + used, num_bytes - used);
    if (count == 0) break;
    if (count > 0) {
      used += static_cast<size_t>(count);
    } else if (errno != EINTR) {
      throw IoError(path_, std::strerror(errno));
    }
  }
  return used;
}

std::string ReadFile(const std::string& path, size_t max_bytes) {
  InputFile file(path);
  // One byte more, so that the end of the file is met without another read.
  const size_t expected = file.size() > 0 ? file.size() + 1 : 65536;
  std::string content(std::min(expected, max_bytes), '\0');
  size_t used = 0;
  while (true) {
    used += file.Read(content.data() + used, content.size() - used);
    if (used < content.size() || used == max_bytes) break;
    content.resize(std::min(2 * content.size(), max_bytes));
  }
  content.resize(used);
  return content;
}

namespace {

// Beside the file; under another name where its own is too long for the ending.
std::string TemporaryPath(const std::string& path) {
  constexpr size_t kMaxName = 255;
  const std::string ending = ".cairn-tmp";
  const std::filesystem::path file(path);
  const std::string name = file.filename().string();
  if (name.size() + ending.size() <= kMaxName) return path + ending;
  return (file.parent_path() / (HashToHex(Hasher().Add(name).Digest()) + ending)).string();
}

bool IsDatabase(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  char begin[16] = {};
  file.read(begin, sizeof(begin));
  return std::string_view(begin, sizeof(begin)) == std::string_view("SQLite format 3", 16);
}

}  // namespace

AtomicFile::AtomicFile(const std::string& path)
    : path_(path), target_(BehindLinks(path)), temporary_path_(TemporaryPath(target_)) {
  std::error_code absent;
  const std::filesystem::file_type type = std::filesystem::status(path, absent).type();
  if (type == std::filesystem::file_type::regular && IsDatabase(path)) {
    throw IoError(path, "is a database, which is not replaced: give the file another name");
  }
  if (std::filesystem::is_other(std::filesystem::file_status(type))) {
    file_ = std::fopen(path.c_str(), "wb");
    if (!file_) Fail("cannot be written");
    return;
  }
  lock_ = OpenLocked(temporary_path_, /*waits=*/true);
  if (lock_ >= 0 && ftruncate(lock_, 0) == 0) {
    if (const int descriptor = dup(lock_); descriptor >= 0) file_ = fdopen(descriptor, "wb");
  }
  if (!file_) Fail("cannot be written");
}

AtomicFile::~AtomicFile() {
  if (lock_ >= 0) {
    RemoveTemporary();
  } else if (file_) {
    std::fclose(file_);
  }
}

void AtomicFile::Write(std::string_view bytes) {
  CAIRN_CHECK(file_ != nullptr);
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) Fail("cannot be written");
}

void AtomicFile::Commit() {
  CAIRN_CHECK(file_ != nullptr);
  if (std::fflush(file_) != 0) Fail("cannot be written");
  const int closed = std::fclose(file_);
  file_ = nullptr;
  if (closed != 0) Fail("cannot be written");
  if (lock_ < 0) return;
  if (std::rename(temporary_path_.c_str(), target_.c_str()) != 0) Fail("cannot be replaced");
  close(lock_);  // not before: the next writer would begin in what is renamed
  lock_ = -1;
}

void AtomicFile::RemoveTemporary() {
  if (file_) std::fclose(file_);
  file_ = nullptr;
  std::remove(temporary_path_.c_str());
  close(lock_);
  lock_ = -1;
}

void AtomicFile::Fail(const std::string& what) {
  const std::string reason = std::strerror(errno);
  if (lock_ >= 0) RemoveTemporary();
  throw IoError(path_, what + ": " + reason);
}

void WriteFileAtomically(const std::string& path, std::string_view content) {
  AtomicFile file(path);
  file.Write(content);
  file.Commit();
}

std::string LowerCaseExtension(const std::string& path) {
  return Lowercase(std::filesystem::path(path).extension().string());
}

bool StaysInFolder(const std::string& name) {
  const std::filesystem::path path(name);
  return !path.is_absolute() &&
         std::none_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
}

std::string BehindLinks(const std::string& path) {
  namespace fs = std::filesystem;
  constexpr int kMaxLinks = 40;  // as Linux follows
  std::error_code error;
  const fs::path target = fs::canonical(path, error);
  if (!error) return target.string();
  fs::path end = path;  // of links to what is not there yet
  for (int k = 0; k < kMaxLinks && fs::is_symlink(fs::symlink_status(end, error)); ++k) {
    end = end.parent_path() / fs::read_symlink(end, error);
  }
  return end.string();
}

bool IsInFolder(const std::string& path, const std::string& folder) {
  namespace fs = std::filesystem;
  const fs::path inner = fs::weakly_canonical(fs::absolute(path));
  const fs::path outer = fs::weakly_canonical(fs::absolute(folder));
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

std::string PathInFolder(const std::string& folder, const std::string& name) {
  if (!StaysInFolder(name)) throw IoError(name, "the name leads out of the folder " + folder);
  return (std::filesystem::path(folder) / name).string();
}

void CreateFolders(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw IoError(path, "cannot be created: " + error.message());
  if (!std::filesystem::is_directory(path)) throw IoError(path, "is not a folder");
}

}  // namespace cairn
