#include "cairn/image/image_folder.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <set>
#include <string_view>
#include <system_error>

#include "cairn/base/error.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

bool HasImageExtension(const fs::path& path) {
  constexpr std::array<std::string_view, 8> kExtensions = {".jpg",  ".jpeg", ".png", ".tif",
                                                           ".tiff", ".bmp",  ".ppm", ".webp"};
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

// `open_folders` holds the real paths of the folders on the way down: a link back to one of them
// is a cycle.
void ListInto(const fs::path& folder, const std::string& prefix, std::set<fs::path>& open_folders,
              std::vector<std::string>& names) {
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
      ListInto(entry.path(), prefix + name + "/", open_folders, names);
    } else if (HasImageExtension(entry.path())) {
      names.push_back(prefix + name);
    }
  }
  open_folders.erase(real_path);
}

}  // namespace

std::vector<std::string> ListImages(const std::string& folder) {
  std::error_code error;
  if (!fs::exists(folder, error)) throw IoError(folder, "no such folder");
  if (!fs::is_directory(folder, error)) throw IoError(folder, "is not a folder");
  std::vector<std::string> names;
  std::set<fs::path> open_folders;
  ListInto(folder, "", open_folders, names);
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace cairn
