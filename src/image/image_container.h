#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/image/bitmap.h"

namespace cairn {

// What the structure of an image file says, without decoding it.
struct ContainerInfo {
  std::optional<ImageSize> size;  // of JPEG and PNG files with a complete header
  bool is_complete = true;        // JPEG and PNG: everything up to the end marker is there
};

// Walks over the segments of a JPEG file (ITU T.81, annex B) or the chunks of a PNG file (ISO
// 15948). Decoders fill up what is missing in a truncated JPEG with gray and go on; this does not.
ContainerInfo InspectContainer(std::string_view bytes);

}  // namespace cairn
