#include <algorithm>
#include <cmath>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/image/thumbnail.h"
#include "report_page/page_parts.h"

namespace cairn {
namespace {

constexpr int kMaxSidePx = 640;  // a pair fills a wide screen
constexpr int kMinSidePx = 48;
constexpr int kJpegQuality = 72;
constexpr double kBytesPerPixel = 0.25;  // of such JPEGs, of detailed photographs

std::vector<std::string> MakeAll(const PageScene& scene, int max_side_px) {
  std::vector<std::string> jpegs(scene.images.size());
  ParallelFor(scene.run.num_threads, static_cast<int64_t>(jpegs.size()), [&](int64_t i) {
    try {
      const std::string path = PathInFolder(scene.input.image_path, scene.images[i].image.name);
      jpegs[i] = MakeThumbnail(path, max_side_px, kJpegQuality);
    } catch (const IoError&) {
      // The photograph is not there; the page shows its name alone.
    }
  });
  return jpegs;
}

int64_t TotalSize(const std::vector<std::string>& jpegs) {
  int64_t size = 0;
  for (const std::string& jpeg : jpegs) size += static_cast<int64_t>(jpeg.size());
  return size;
}

// Of 4:3 photographs.
int SideFor(int64_t bytes_per_image) {
  const double side = std::sqrt(bytes_per_image / kBytesPerPixel * 4 / 3);
  return std::clamp(static_cast<int>(side), kMinSidePx, kMaxSidePx);
}

}  // namespace

Json ThumbnailsJson(const PageScene& scene, PageBlocks& blocks) {
  const int64_t limit = scene.input.limits.thumbnail_bytes;
  std::vector<std::string> jpegs(scene.images.size());
  if (!scene.input.image_path.empty() && !scene.images.empty()) {
    int side_px = SideFor(limit / static_cast<int64_t>(scene.images.size()));
    jpegs = MakeAll(scene, side_px);
    while (TotalSize(jpegs) > limit && side_px > 1) {
      const double scale = std::sqrt(limit / static_cast<double>(TotalSize(jpegs)));
      side_px = std::max(1, static_cast<int>(0.95 * scale * side_px));
      jpegs = MakeAll(scene, side_px);
    }
  }
  std::string bytes;
  std::vector<uint32_t> end;
  int num_absent = 0;
  for (const std::string& jpeg : jpegs) {
    bytes += jpeg;
    end.push_back(static_cast<uint32_t>(bytes.size()));
    num_absent += jpeg.empty();
  }
  return {{"bytes", blocks.AddBytes(bytes)}, {"end", blocks.Add(end)}, {"absent", num_absent}};
}

}  // namespace cairn
