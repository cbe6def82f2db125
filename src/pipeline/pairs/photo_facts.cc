#include "pipeline/pairs/photo_facts.h"

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/image/exif.h"
#include "cairn/io/gps_file.h"

namespace cairn {

PhotoFacts ReadPhotoFacts(const std::vector<Image>& images, const std::string& image_path,
                          const std::string& gps_path, int num_threads) {
  std::vector<ExifInfo> exif(images.size());
  if (!image_path.empty()) {
    ParallelFor(num_threads, std::ssize(images), [&](int64_t i) {
      try {
        exif[i] = ReadExif(PathInFolder(image_path, images[i].name), 1, 1);
      } catch (const IoError&) {  // Its features came from elsewhere.
      }
    });
  }
  std::map<std::string, GpsRow> given;
  if (!gps_path.empty()) given = ReadGpsFile(gps_path);
  PhotoFacts facts;
  for (size_t i = 0; i < images.size(); ++i) {
    const image_t id = images[i].image_id;
    if (exif[i].taken_at_s) facts.taken_at_s[id] = *exif[i].taken_at_s;
    const auto position = given.find(images[i].name);
    if (position != given.end()) {
      facts.positions[id] = position->second.position;
    } else if (gps_path.empty() && exif[i].gps) {
      facts.positions[id] = *exif[i].gps;
    }
  }
  return facts;
}

void CheckPositions(const std::string& gps_path, const std::vector<Image>& images,
                    ProgressMonitor& monitor) {
  if (gps_path.empty()) return;
  std::vector<std::string> names;
  for (const Image& image : images) names.push_back(image.name);
  const std::string unknown = UnknownNames(ReadGpsFile(gps_path), names);
  if (!unknown.empty()) monitor.Warning(gps_path + ": " + unknown);
}

}  // namespace cairn
