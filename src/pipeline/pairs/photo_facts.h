#pragma once

#include <map>
#include <string>
#include <vector>

#include "cairn/base/progress.h"
#include "cairn/base/types.h"
#include "cairn/geometry/gps.h"
#include "cairn/scene/image.h"

namespace cairn {

// When and where photographs were taken, of those for which it is known.
struct PhotoFacts {
  std::map<image_t, double> taken_at_s;
  std::map<image_t, GpsPosition> positions;
};

// From EXIF of the files below image_path ("": none), and positions instead from the file gps_path,
// if there is one. Absent files are passed over.
PhotoFacts ReadPhotoFacts(const std::vector<Image>& images, const std::string& image_path,
                          const std::string& gps_path, int num_threads);

// Reads the file, and warns of names in it that are no image's. Throws IoError.
void CheckPositions(const std::string& gps_path, const std::vector<Image>& images,
                    ProgressMonitor& monitor);

}  // namespace cairn
