#include "cairn/base/file.h"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>

#include "cairn/base/check.h"
#include "cairn/base/error.h"

namespace cairn {
namespace {

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

// Unique in this process; with the process id, unique in the folder.
std::string TemporaryPath(const std::string& path) {
  static std::atomic<int> counter = 0;
  return path + ".tmp-" + std::to_string(getpid()) + "-" + std::to_string(counter++);
}

}  // namespace

std::string ReadFile(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) throw IoError(path, "is a folder, not a file");
  const std::unique_ptr<std::FILE, FileCloser> file(std::fopen(path.c_str(), "rb"));
  if (!file) throw IoError(path, std::strerror(errno));
  std::string content;
  const uintmax_t size = std::filesystem::file_size(path, error);
  // One byte more, so that the end of the file is met without another read.
  content.resize(error ? 65536 : static_cast<size_t>(size) + 1);
  size_t used = 0;
  while (true) {
    used += std::fread(content.data() + used, 1, content.size() - used, file.get());
    if (used < content.size()) break;
    content.resize(2 * content.size());
  }
  if (std::ferror(file.get())) throw IoError(path, std::strerror(errno));
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

void CreateFolders(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (error) throw IoError(path, "cannot be created: " + error.message());
  if (!std::filesystem::is_directory(path)) throw IoError(path, "is not a folder");
}

}  // namespace cairn
