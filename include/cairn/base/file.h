#pragma once

#include <cstdio>
#include <limits>
#include <string>
#include <string_view>

namespace cairn {

// An open file for reading: the one way in which cairn opens its input. Only regular files are
// opened (links are followed): a pipe or a device would block for ever. Throws IoError.
class InputFile {
 public:
  explicit InputFile(const std::string& path);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  size_t size() const { return size_; }  // bytes; 0 for files of /proc
  // Reads up to `num_bytes`, fewer only at the end of the file.
  size_t Read(char* data, size_t num_bytes);

 private:
  std::string path_;
  int descriptor_;
  size_t size_ = 0;
};

// The whole content of a file, or its first max_bytes. Throws IoError: absent, no regular file, not
// readable.
std::string ReadFile(const std::string& path,
                     size_t max_bytes = std::numeric_limits<size_t>::max());

// A file that appears under its name complete, or not at all: everything goes to a temporary file
// in the same folder, `path`.cairn-tmp (or a short name), which Commit() renames. An interrupted
// program, a full disk or an exception leave the file that was there before untouched. What a
// killed process leaves, the next one that writes the file takes; writers of the same file wait for
// each other. Where `path` is a link to a file, that file is written; a pipe or a device gets the
// bytes as they come. A SQLite database is never replaced. Every method throws IoError with the
// path of the final file and the system's reason (read-only folder, no space, ...). Not synced to
// the disk: a power failure is not covered.
class AtomicFile {
 public:
  explicit AtomicFile(const std::string& path);
  ~AtomicFile();  // without Commit(): the temporary file is removed
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void Write(std::string_view bytes);
  void Commit();

 private:
  void RemoveTemporary();
  [[noreturn]] void Fail(const std::string& what);
  std::string path_;
  std::string target_;  // behind links
  std::string temporary_path_;
  int lock_ = -1;  // the temporary file; -1: it is not there
  std::FILE* file_ = nullptr;
};

void WriteFileAtomically(const std::string& path, std::string_view content);

// Creates a folder and its parents if absent. Throws IoError.
void CreateFolders(const std::string& path);

// ".jpg" of "a/b.JPG"; "" where there is none.
std::string LowerCaseExtension(const std::string& path);

// A relative path without a part "..".
bool StaysInFolder(const std::string& name);

// The file that links lead to, also where it is not there yet; absolute where it is.
std::string BehindLinks(const std::string& path);

// Is it the folder, or in it, whatever links lead there? Neither needs to exist.
bool IsInFolder(const std::string& path, const std::string& folder);

// folder/name. Names of images come from databases and models, which may be a stranger's: throws
// IoError where the name would lead out of the folder.
std::string PathInFolder(const std::string& folder, const std::string& name);

}  // namespace cairn
