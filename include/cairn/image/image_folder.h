#pragma once

#include <span>
#include <string>
#include <vector>

namespace cairn {

// Throws IoError if the folder is absent or no folder: before work that would find none of its
// photographs.
void CheckImageFolder(const std::string& folder);

// In the folder that undistort writes: what of its `images` it wrote.
inline constexpr char kUndistortedImages[] = ".cairn-images";

// Names of all photographs in a folder and the folders in it, relative to it, with '/', sorted by
// bytes. A photograph is a file with the extension jpg, jpeg, jpe, jfif, png, tif, tiff, bmp, ppm,
// pgm, pnm or webp, in any case; hidden files and folders are left out, and the images that
// undistort wrote, and folders to be left out, where they are below this one. Symbolic links are
// followed (a link that leads back to a folder it is in is visited once). Throws as
// CheckImageFolder.
std::vector<std::string> ListImages(const std::string& folder,
                                    std::span<const std::string> left_out = {});

// The same for photographs and videos in formats that are not read: gif, heic, raw files, ...
std::vector<std::string> ListUnreadImages(const std::string& folder,
                                          std::span<const std::string> left_out = {});

}  // namespace cairn
