#include "image/image_container.h"

#include <algorithm>
#include <cstdint>

namespace cairn {
namespace {

uint32_t BigEndian(std::string_view bytes, size_t position, int num_bytes) {
  uint32_t value = 0;
  for (int i = 0; i < num_bytes; ++i) {
    value = value << 8 | static_cast<uint8_t>(bytes[position + i]);
  }
  return value;
}

// Can a file of so many bytes hold the pixels? Deflate gives at most 1032 bytes for one, which are
// 8 pixels each in an image of one bit; a JPEG has at least a bit for 64 pixels. So a short file
// with a large size in its header takes no memory.
bool CanHold(const ImageSize& size, size_t num_bytes) {
  constexpr uint64_t kMaxPixelsPerByte = 8 * 1032;
  return static_cast<uint64_t>(std::max(0, size.width)) * std::max(0, size.height) <=
         kMaxPixelsPerByte * num_bytes;
}

// Start of frame: the segments that hold the image's size (C4, C8 and CC are others).
bool IsStartOfFrame(uint8_t marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

// The position of the next marker's 0xFF after `position`, within entropy-coded data, where 0xFF
// is followed by 0 (a data byte) or by a restart marker. npos if the data end before.
size_t SkipEntropyCodedData(std::string_view bytes, size_t position) {
  while (true) {
    position = bytes.find('\xFF', position);
    if (position == std::string_view::npos || position + 1 >= bytes.size()) {
      return std::string_view::npos;
    }
    const uint8_t next = static_cast<uint8_t>(bytes[position + 1]);
    const bool is_data = next == 0 || (next >= 0xD0 && next <= 0xD7);
    if (next == 0xFF) {
      ++position;  // fill byte
    } else if (is_data) {
      position += 2;
    } else {
      return position;
    }
  }
}

ContainerInfo InspectJpeg(std::string_view bytes) {
  ContainerInfo info{std::nullopt, false};
  size_t position = 2;  // after start of image
  while (position + 1 < bytes.size()) {
    if (bytes[position] != '\xFF') {
      ++position;  // bytes between segments: decoders skip them too
      continue;
    }
    const uint8_t marker = static_cast<uint8_t>(bytes[position + 1]);
    if (marker == 0xD9) {  // end of image
      info.is_complete = info.size && CanHold(*info.size, bytes.size());
      return info;
    }
    if (marker == 0xFF) {
      ++position;
      continue;
    }
    position += 2;
    if (marker <= 0x01 || (marker >= 0xD0 && marker <= 0xD8)) continue;  // no length follows
    if (position + 2 > bytes.size()) return info;
    const size_t length = BigEndian(bytes, position, 2);
    if (IsStartOfFrame(marker) && position + 7 <= bytes.size() && !info.size) {
      info.size = ImageSize{static_cast<int>(BigEndian(bytes, position + 5, 2)),
                            static_cast<int>(BigEndian(bytes, position + 3, 2))};
    }
    position += length;
    if (marker == 0xDA) {  // start of scan
      if (position > bytes.size()) return info;
      position = SkipEntropyCodedData(bytes, position);
      if (position == std::string_view::npos) return info;
    }
  }
  return info;
}

constexpr std::string_view kPngSignature = "\x89PNG\r\n\x1A\n";

// Calls visit(type, chunk) for every whole chunk up to IEND. False where the data end before it.
template <class Visit>
bool ForEachChunk(std::string_view bytes, const Visit& visit) {
  constexpr size_t kFrame = 12;  // length, type and checksum
  size_t position = kPngSignature.size();
  while (position + kFrame <= bytes.size()) {
    const size_t length = BigEndian(bytes, position, 4);
    if (length > bytes.size() - position - kFrame) return false;
    const std::string_view chunk = bytes.substr(position, kFrame + length);
    const std::string_view type = chunk.substr(4, 4);
    visit(type, chunk);
    if (type == "IEND") return true;
    position += chunk.size();
  }
  return false;
}

// Of a TIFF file, in its order of bytes; 0 beyond the end.
uint64_t TiffNumber(std::string_view bytes, uint64_t position, size_t num_bytes) {
  if (position > bytes.size() || num_bytes > bytes.size() - position) return 0;
  uint64_t value = 0;
  for (size_t i = 0; i < num_bytes; ++i) {
    const size_t at = bytes.starts_with('M') ? i : num_bytes - 1 - i;
    value = value << 8 | static_cast<uint8_t>(bytes[position + at]);
  }
  return value;
}

ContainerInfo InspectPng(std::string_view bytes) {
  ContainerInfo info{std::nullopt, false};
  const bool has_end = ForEachChunk(bytes, [&](std::string_view type, std::string_view chunk) {
    if (type != "IHDR" || chunk.size() < 20) return;
    info.size = ImageSize{static_cast<int>(BigEndian(chunk, 8, 4)),
                          static_cast<int>(BigEndian(chunk, 12, 4))};
  });
  info.is_complete = has_end && info.size && CanHold(*info.size, bytes.size());
  return info;
}

}  // namespace

ContainerInfo InspectContainer(std::string_view bytes) {
  if (bytes.starts_with("\xFF\xD8\xFF")) return InspectJpeg(bytes);
  if (bytes.starts_with(kPngSignature)) return InspectPng(bytes);
  return {};
}

std::string UprightTiff(std::string_view bytes) {
  if (!bytes.starts_with("II") && !bytes.starts_with("MM")) return "";
  const uint64_t version = TiffNumber(bytes, 2, 2);
  if (version != 42 && version != 43) return "";
  // Entries: tag, type, a count and a value of as many bytes as offsets have.
  const size_t offset_size = version == 43 ? 8 : 4;
  const size_t count_size = version == 43 ? 8 : 2;
  const uint64_t directory = TiffNumber(bytes, version == 43 ? 8 : 4, offset_size);
  const uint64_t num_entries = TiffNumber(bytes, directory, count_size);
  for (uint64_t k = 0; k < num_entries; ++k) {
    const uint64_t entry = directory + count_size + k * (4 + 2 * offset_size);
    const uint64_t value = entry + 4 + offset_size;
    if (value < directory || value + 2 > bytes.size()) return "";
    constexpr uint64_t kOrientation = 274;
    if (TiffNumber(bytes, entry, 2) != kOrientation) continue;
    if (TiffNumber(bytes, value, 2) == 1) return "";
    std::string upright(bytes);
    upright[value] = bytes.starts_with('M') ? 0 : 1;
    upright[value + 1] = bytes.starts_with('M') ? 1 : 0;
    return upright;
  }
  return "";
}

std::string EssentialPngChunks(std::string_view bytes) {
  if (!bytes.starts_with(kPngSignature)) return "";
  std::string essential(kPngSignature);
  ForEachChunk(bytes, [&](std::string_view type, std::string_view chunk) {
    const bool is_critical = (type[0] & 0x20) == 0;
    if (is_critical || type == "tRNS") essential += chunk;
  });
  return essential;
}

}  // namespace cairn
