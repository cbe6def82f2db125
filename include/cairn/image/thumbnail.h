#pragma once

#include <string>

namespace cairn {

// The bytes of a JPEG that shows the whole photograph, not rotated by its EXIF orientation, its
// longer side at most max_side_px. A large JPEG is decoded at a part of its size, so this takes
// some 10 ms a photograph of 12 megapixels. Throws IoError with the path and the reason.
// Thread-safe.
std::string MakeThumbnail(const std::string& path, int max_side_px, int jpeg_quality);

}  // namespace cairn
