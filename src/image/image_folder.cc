#include "cairn/image/image_folder.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <span>
#include <string_view>
#include <system_error>

#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

using Extensions = std::span<const std::string_view>;

constexpr std::string_view kRead[] = {".jpg",  ".jpeg", ".jpe", ".jfif", ".png", ".tif",
                                      ".tiff", ".bmp",  ".ppm", ".pgm",  ".pnm", ".webp"};
constexpr std::string_view kUnread[] = {
    ".gif", ".heic", ".heif", ".avif", ".jxl", ".jp2", ".exr", ".hdr", ".tga", ".psd",  ".mpo",
    ".raw", ".dng",  ".cr2",  ".cr3",  ".crw", ".nef", ".nrw", ".arw", ".orf", ".rw2",  ".rwl",
    ".raf", ".pef",  ".srw",  ".3fr",  ".fff", ".iiq", ".x3f", ".gpr", ".dcr", ".erf",  ".insp",
    ".360", ".insv", ".mp4",  ".m4v",  ".mov", ".avi", ".mkv", ".mts", ".mpg", ".webm", ".wmv"};

bool HasExtension(const fs::path& path, Extensions extensions) {
  const std::string extension = LowerCaseExtension(path.string());
  return std::find(extensions.begin(), extensions.end(), extension) != extensions.end();
}

// `open_folders` holds the real paths of the folders on the way down: a link back to one of them
// is a cycle. It begins with folders that are left out.
void ListInto(const fs::path& folder, const std::string& prefix, Extensions extensions,
              std::set<fs::path>& open_folders, std::vector<std::string>& names) {
  std::error_code error;
  const fs::path real_path = fs::canonical(folder, error);
  if (error) throw IoError(folder.string(), error.message());
  if (!open_folders.insert(real_path).second) return;
  fs::directory_iterator it(folder, error);
  if (error) throw IoError(folder.string(), "cannot be listed: " + error.message());
  for (const fs::directory_entry& entry : it) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with('.')) continue;
    std::error_code ignored;  // of broken links: neither a folder nor a file
    if (entry.is_directory(ignored)) {
      if (name == "images" && fs::exists(folder / kUndistortedImages, ignored)) continue;
      ListInto(entry.path(), prefix + name + "/", extensions, open_folders, names);
    } else if (HasExtension(entry.path(), extensions)) {
      names.push_back(prefix + name);
    }
  }
  open_folders.erase(real_path);
}

std::vector<std::string> List(const std::string& folder, std::span<const std::string> left_out,
                              Extensions extensions) {
  CheckImageFolder(folder);
  std::vector<std::string> names;
  std::set<fs::path> open_folders;
  for (const std::string& other : left_out) {
    std::error_code error;
    const fs::path real_path = fs::canonical(other, error);
    if (!error && real_path != fs::canonical(folder)) open_folders.insert(real_path);
  }
  ListInto(folder, "", extensions, open_folders, names);
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace

void CheckImageFolder(const std::string& folder) {
  std::error_code error;
  if (!fs::exists(folder, error)) throw IoError(folder, "no such folder");
  if (!fs::is_directory(folder, error)) throw IoError(folder, "is not a folder");
}

std::vector<std::string> ListImages(const std::string& folder,
                                    std::span<const std::string> left_out) {
  return List(folder, left_out, kRead);
}

std::vector<std::string> ListUnreadImages(const std::string& folder,
                                          std::span<const std::string> left_out) {
  return List(folder, left_out, kUnread);
}

}  // namespace cairn
