#include "cairn/base/file.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "cairn/base/check.h"
#include "cairn/base/error.h"

namespace cairn {
namespace {

constexpr const char* kTemporary = ".tmp-";

// Unique in this process; with the process id, unique in the folder.
std::string TemporaryPath(const std::string& path) {
  static std::atomic<int> counter = 0;
  return path + kTemporary + std::to_string(getpid()) + "-" + std::to_string(counter++);
}

// "12-0", of a TemporaryPath, is of a process 12 that is not there.
bool IsOfNoProcess(const std::string& ending) {
  int process = 0, number = 0, length = 0;
  const int found = std::sscanf(ending.c_str(), "%d-%d%n", &process, &number, &length);
  return found == 2 && length == static_cast<int>(ending.size()) && process > 0 &&
         kill(process, 0) != 0 && errno == ESRCH;
}

}  // namespace

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

AtomicFile::AtomicFile(const std::string& path)
    : path_(path), temporary_path_(TemporaryPath(path)) {
  file_ = std::fopen(temporary_path_.c_str(), "wb");
  if (!file_) throw IoError(path_, std::string("cannot be written: ") + std::strerror(errno));
}

AtomicFile::~AtomicFile() {
  if (!file_) return;
  std::fclose(file_);
  std::remove(temporary_path_.c_str());
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
  if (std::rename(temporary_path_.c_str(), path_.c_str()) != 0) Fail("cannot be replaced");
}

void AtomicFile::Fail(const std::string& what) {
  const std::string reason = std::strerror(errno);
  if (file_) std::fclose(file_);
  file_ = nullptr;
  std::remove(temporary_path_.c_str());
  throw IoError(path_, what + ": " + reason);
}

void WriteFileAtomically(const std::string& path, std::string_view content) {
  AtomicFile file(path);
  file.Write(content);
  file.Commit();
}

void RemoveLeftovers(const std::string& path) {
  const std::filesystem::path target(path);
  const std::string beginning = target.filename().string() + kTemporary;
  std::error_code error;
  const auto folder = target.has_parent_path() ? target.parent_path() : std::filesystem::path(".");
  std::filesystem::directory_iterator entry(folder, error);
  for (; entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(beginning) && IsOfNoProcess(name.substr(beginning.size()))) {
      std::error_code ignored;
      std::filesystem::remove(entry->path(), ignored);
    }
  }
}

std::string LowerCaseExtension(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

bool StaysInFolder(const std::string& name) {
  const std::filesystem::path path(name);
  return !path.is_absolute() &&
         std::none_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
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
