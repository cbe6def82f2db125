#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "cairn/image/bitmap.h"

namespace cairn {

// What the structure of an image file says, without decoding it.
struct ContainerInfo {
  std::optional<ImageSize> size;  // of JPEG and PNG files with a complete header
  // JPEG and PNG: everything up to the end marker is there, and not less than so many pixels need.
  bool is_complete = true;
};

// Walks over the segments of a JPEG file (ITU T.81, annex B) or the chunks of a PNG file (ISO
// 15948). Decoders fill up what is missing in a truncated JPEG with gray and go on; this does not.
ContainerInfo InspectContainer(std::string_view bytes);

// Of a complete PNG file: the signature and those chunks that pixels depend on (the critical ones,
// and tRNS); "" for other files. libpng looks at the others only to warn on the error stream,
// without the file's name, of color profiles that nobody here applies.
std::string EssentialPngChunks(std::string_view bytes);

// Of a TIFF file (TIFF 6.0; BigTIFF) whose first image has another orientation than that in which
// pixels are stored: the bytes with that one, since OpenCV's decoder turns them; "" for other
// files.
std::string UprightTiff(std::string_view bytes);

}  // namespace cairn
