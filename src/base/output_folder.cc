#include "base/output_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr char kFiles[] = ".cairn-files";               // hash and name of each file of the results
constexpr std::string_view kWriter = "# written by: ";  // a line of it
constexpr char kRemove[] = ".cairn-remove";  // in a committed folder: files to be removed

// Folder operations whose failure is an IoError that names the path.
template <class Fn>
void Do(const fs::path& path, const Fn& fn) {
  std::error_code error;
  fn(error);
  if (error) throw IoError(path.string(), "cannot be changed: " + error.message());
}

// Waits until the file or folder is on the disk.
void Sync(const fs::path& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool is_synced = descriptor >= 0 && fsync(descriptor) == 0;
  const int reason = errno;
  if (descriptor >= 0) close(descriptor);
  // Some file systems of networks cannot sync a folder.
  if (!is_synced && reason != EINVAL) {
    throw IoError(path.string(), std::string("cannot be written: ") + std::strerror(reason));
  }
}

// Regular files (and links) at or under folder/name, relative to the folder.
void ListFiles(const fs::path& folder, const fs::path& name, std::vector<std::string>& files) {
  const fs::file_status status = fs::symlink_status(folder / name);
  if (!fs::exists(status)) return;
  if (!fs::is_directory(status)) {
    // (The lists of files have one a line.)
    if (name.native().find('\n') != std::string::npos) {
      throw IoError((folder / name).string(), "has a line break in its name");
    }
    files.push_back(name.generic_string());
    return;
  }
  std::vector<fs::path> children;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder / name)) {
    children.push_back(name / entry.path().filename());
  }
  std::sort(children.begin(), children.end());
  for (const fs::path& child : children) ListFiles(folder, child, files);
}

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

std::map<std::string, std::string> ReadHashes(const fs::path& file) {
  std::map<std::string, std::string> hashes;
  if (!fs::exists(file)) return hashes;
  for (const std::string& line : Lines(ReadFile(file.string()))) {
    const size_t blank = line.find(' ');
    if (line.starts_with('#') || blank == std::string::npos) continue;
    const std::string name = line.substr(blank + 1);
    // (A list that somebody changed.)
    if (!name.empty() && StaysInFolder(name)) hashes[name] = line.substr(0, blank);
  }
  return hashes;
}

// "": there is no list, or it does not tell.
std::string ReadWriter(const fs::path& file) {
  if (!fs::exists(file)) return "";
  for (const std::string& line : Lines(ReadFile(file.string()))) {
    if (line.starts_with(kWriter)) return line.substr(kWriter.size());
  }
  return "";
}

std::string ListText(const std::string& writer, const std::map<std::string, std::string>& hashes) {
  std::string list = "# Files that cairn wrote here, and may replace, each after its hash.\n";
  list += std::string(kWriter) + writer + "\n";
  for (const auto& [name, hash] : hashes) list += hash + " " + name + "\n";
  return list;
}

// Of a folder above, which may be anybody's: nothing where its list cannot be read.
std::map<std::string, std::string> ReadHashesAbove(const fs::path& file) {
  try {
    return ReadHashes(file);
  } catch (const std::exception&) {
    return {};
  }
}

// The folders that may list results in `path`, itself first, with its name in each.
std::vector<std::pair<fs::path, fs::path>> FoldersAbove(const std::string& path) {
  std::vector<std::pair<fs::path, fs::path>> folders;
  fs::path folder = fs::absolute(path).lexically_normal(), name;
  if (!folder.has_filename()) folder = folder.parent_path();
  for (int level = 0; level < 3; ++level) {  // as deep as failed/sparse/0
    folders.emplace_back(folder, name);
    name = folder.filename() / name;
    folder = folder.parent_path();
  }
  return folders;
}

// Removes a file, and the folders that are empty without it.
void RemoveFile(const fs::path& folder, const std::string& name) {
  Do(folder / name, [&](std::error_code& error) { fs::remove(folder / name, error); });
  for (fs::path parent = fs::path(name).parent_path(); !parent.empty();
       parent = parent.parent_path()) {
    std::error_code is_in_use;
    if (!fs::remove(folder / parent, is_in_use)) return;
  }
}

}  // namespace

OutputFolder::OutputFolder(const std::string& path, const std::string& writer,
                           const std::vector<std::string>& names, bool overwrites)
    : path_(path),
      writer_(writer),
      staging_((fs::path(path) / ".cairn-new").string()),
      committed_((fs::path(path) / ".cairn-committed").string()),
      names_(names),
      overwrites_(overwrites) {
  CreateFolders(path);
  lock_ = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_ < 0) throw IoError(path, std::strerror(errno));
  try {
    // File systems without locks do without.
    if (flock(lock_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      throw IoError(path, "another run of cairn is writing to it");
    }
    if (fs::exists(committed_)) Apply();
    earlier_ = ReadHashes(fs::path(path_) / kFiles);
    CheckOneWriter();
    CheckNobodyElses();
    Do(staging_, [&](std::error_code& error) { fs::remove_all(staging_, error); });
    CreateFolders(staging_);
  } catch (...) {
    close(lock_);
    throw;
  }
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
  close(lock_);
}

bool OutputFolder::Has(const std::string& name) const {
  const auto it = earlier_.lower_bound(name);
  return it != earlier_.end() && it->first.starts_with(name);
}

std::vector<std::string> OutputFolder::FilesInTheWay() const {
  std::vector<std::string> files;
  try {
    for (const std::string& name : names_) ListFiles(path_, name, files);
  } catch (const fs::filesystem_error& error) {
    throw IoError(error.path1().string(), error.code().message());
  }
  return files;
}

bool OutputFolder::IsOurs(const std::string& name) const {
  const fs::path file = fs::path(path_) / name;
  const auto known = earlier_.find(name);
  return known != earlier_.end() && !fs::is_symlink(file) &&
         HashToHex(HashFile(file.string())) == known->second;
}

void OutputFolder::CheckOneWriter() const {
  for (const auto& [folder, within] : FoldersAbove(path_)) {
    const auto is_here = [&, &within = within](const auto& entry) {
      return entry.first.starts_with(within.generic_string());
    };
    if (!within.empty() && std::ranges::none_of(ReadHashesAbove(folder / kFiles), is_here)) {
      continue;
    }
    const std::string writer = ReadWriter(folder / kFiles);
    if (writer.empty() || writer == writer_) continue;
    throw ConfigError("output_path", path_ + " holds the results of " + writer +
                                         ", which would be lost; give another --output_path");
  }
}

void OutputFolder::CheckNobodyElses() const {
  if (overwrites_) return;
  for (const std::string& name : FilesInTheWay()) {
    if (IsOurs(name)) continue;
    throw ConfigError("output_path",
                      (fs::path(path_) / name).string() +
                          " is not as cairn wrote it and would be replaced; give another folder, "
                          "or --overwrite");
  }
}

void OutputFolder::Commit(const std::string& within) {
  CheckNobodyElses();  // they may have come since
  std::vector<std::string> files;
  for (const std::string& name : names_) ListFiles(staging_, name, files);
  Hashes hashes;
  std::string removed;
  for (const std::string& name : files) {
    const fs::path file = fs::path(staging_) / name;
    hashes[name] = HashToHex(HashFile(file.string()));
    Sync(file);
  }
  for (const auto& [name, hash] : earlier_) {
    if (!within.empty() && !name.starts_with(within + "/")) hashes.insert({name, hash});
  }
  for (const std::string& name : FilesInTheWay()) {
    const bool may_go = within.empty() || name.starts_with(within + "/");
    if (may_go && !hashes.contains(name)) removed += name + "\n";
  }
  WriteFileAtomically(staging_ + "/" + kFiles, ListText(writer_, hashes));
  WriteFileAtomically(staging_ + "/" + kRemove, removed);
  Sync(staging_ + "/" + kFiles);
  Sync(staging_ + "/" + kRemove);
  Sync(staging_);
  Do(path_, [&](std::error_code& error) { fs::rename(staging_, committed_, error); });
  Sync(path_);
  Apply();
}

// Every step may be done already, by a run that was killed in it.
void OutputFolder::Apply() {
  const fs::path committed(committed_), folder(path_);
  // Without its list, all is in place.
  if (fs::exists(committed / kFiles)) {
    for (const std::string& name : Lines(ReadFile((committed / kRemove).string()))) {
      if (!name.empty() && StaysInFolder(name)) RemoveFile(folder, name);
    }
    for (const auto& [name, hash] : ReadHashes(committed / kFiles)) {
      if (!fs::exists(committed / name)) continue;  // of an earlier run, or in place
      CreateFolders((folder / name).parent_path().string());
      Do(folder / name, [&, &name = name](std::error_code& error) {
        fs::rename(committed / name, folder / name, error);
      });
      Sync((folder / name).parent_path());
    }
    Do(folder / kFiles,
       [&](std::error_code& error) { fs::rename(committed / kFiles, folder / kFiles, error); });
  }
  Do(committed, [&](std::error_code& error) { fs::remove_all(committed, error); });
  Sync(folder);
}

void CheckNotOfAnother(const std::string& folder, const std::string& writer,
                       const std::vector<std::string>& files) {
  const fs::path list = fs::path(folder) / kFiles;
  const std::string other = ReadWriter(list);
  if (other.empty() || other == writer) return;
  const std::map<std::string, std::string> hashes = ReadHashes(list);
  for (const std::string& file : files) {
    if (!hashes.contains(file)) continue;
    throw ConfigError("output_path", (fs::path(folder) / file).string() + " is a result of " +
                                         other + ", which would be lost; give another " +
                                         "--output_path, or --overwrite");
  }
}

void RecordRewritten(const std::string& file) {
  for (const auto& [folder, name] : FoldersAbove(file)) {
    std::map<std::string, std::string> hashes = ReadHashesAbove(folder / kFiles);
    const auto entry = hashes.find((name / "").parent_path().generic_string());
    if (entry == hashes.end()) continue;
    entry->second = HashToHex(HashFile(file));
    const std::string list = (folder / kFiles).string();
    WriteFileAtomically(list, ListText(ReadWriter(list), hashes));
  }
}

}  // namespace cairn
