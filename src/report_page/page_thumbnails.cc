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
constexpr double kHeaderBytes = 640;     // of any JPEG
constexpr int64_t kLeastBytes = 1100;    // of one of kMinSidePx

// Of every so many-th photograph.
std::vector<std::string> MakeAll(const PageScene& scene, int64_t step, int max_side_px) {
  std::vector<std::string> jpegs(scene.images.size());
  ParallelFor(scene.run.num_threads, static_cast<int64_t>(jpegs.size()), [&](int64_t i) {
    if (i % step != 0 || scene.run.monitor.StopRequested()) return;
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
int SideFor(double bytes_per_image) {
  const double pixels = std::max(0.0, bytes_per_image - kHeaderBytes) / kBytesPerPixel;
  return std::clamp(static_cast<int>(std::sqrt(pixels * 4 / 3)), kMinSidePx, kMaxSidePx);
}

}  // namespace

Json ThumbnailsJson(const PageScene& scene, PageBlocks& blocks) {
  const int64_t limit = scene.input.limits.thumbnail_bytes;
  const int64_t step = 1 + std::ssize(scene.images) * kLeastBytes / std::max<int64_t>(1, limit);
  std::vector<std::string> jpegs(scene.images.size());
  if (!scene.input.image_path.empty() && !scene.images.empty()) {
    const double header_bytes = kHeaderBytes * static_cast<double>(std::ssize(jpegs) / step + 1);
    int side_px = SideFor(static_cast<double>(limit * step) / static_cast<double>(jpegs.size()));
    jpegs = MakeAll(scene, step, side_px);
    while (TotalSize(jpegs) > limit && side_px > 1) {
      const double room = std::max(0.0, static_cast<double>(limit) - header_bytes);
      const double taken = std::max(1.0, static_cast<double>(TotalSize(jpegs)) - header_bytes);
      const double scale = std::min(1.0, std::sqrt(room / taken));
      side_px = std::max(1, static_cast<int>(0.95 * scale * side_px));
      jpegs = MakeAll(scene, step, side_px);
    }
  }
  std::string bytes;
  std::vector<uint32_t> end;
  int num_absent = 0;
  for (size_t i = 0; i < jpegs.size(); ++i) {
    bytes += jpegs[i];
    end.push_back(static_cast<uint32_t>(bytes.size()));
    num_absent += i % step == 0 && jpegs[i].empty();
  }
  return {{"bytes", blocks.AddBytes(bytes)}, {"end", blocks.Add(end)}, {"absent", num_absent}};
}

}  // namespace cairn
