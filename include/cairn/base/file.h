#pragma once

#include <cstdio>
#include <string>
#include <string_view>

namespace cairn {

// The whole content of a file. Throws IoError: absent, a folder, not readable.
std::string ReadFile(const std::string& path);

// A file that appears under its name complete, or not at all: everything goes to a temporary file
// in the same folder, which Commit() renames. An interrupted program, a full disk or an exception
// leave the file that was there before untouched. Every method throws IoError with the path of the
// final file and the system's reason (read-only folder, no space, ...). Not synced to the disk: a
// power failure is not covered.
class AtomicFile {
 public:
  explicit AtomicFile(const std::string& path);
  ~AtomicFile();  // without Commit(): the temporary file is removed
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void Write(std::string_view bytes);
  void Commit();

 private:
  [[noreturn]] void Fail(const std::string& what);
  std::string path_;
  std::string temporary_path_;
  std::FILE* file_ = nullptr;
};

void WriteFileAtomically(const std::string& path, std::string_view content);

// Creates a folder and its parents if absent. Throws IoError.
void CreateFolders(const std::string& path);

}  // namespace cairn
