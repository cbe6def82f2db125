#pragma once

#include <string>

#include "cairn/base/run_context.h"
#include "cairn/database/database.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

struct OneDsfmExportReport {
  int num_images = 0;      // list.txt: all images of the database
  int num_registered = 0;  // cc.txt
  int num_edges = 0;       // EGs.txt: verified pairs with a direction
  int num_tracks = 0;
  int num_copied = 0;         // photographs that already were what the format can hold
  int num_resampled = 0;      // photographs without distortion and with a central principal point
  int num_without_photo = 0;  // could not be read; each was named in a warning
};

// Writes a reconstruction as a 1DSfM data set folder (src/io/FORMATS.md): list.txt with all images
// of the database in the order of their ids, cc.txt with those of the model, EGs.txt with the
// database's verified pairs, coords.txt and tracks.txt with the model's keypoints and tracks (of
// images that the model does not have, the database's keypoints), gt_bundle.out with the model, and
// the photographs in images/.
//
// The format holds one focal length a camera and a central principal point. So each image becomes
// one of a SIMPLE_PINHOLE camera (image/resample.h), keypoints move along, and what cannot be
// expressed (a key where the distortion has no inverse) is left out. The list knows no shared
// cameras, so resampled photographs of one camera get equal EXIF make and model. Model and database
// meet by the images' names. Throws IoError: a model image that the database does not have, a name
// with a blank, a folder that cannot be written. Throws ConfigError where photographs would replace
// those of image_path.
OneDsfmExportReport ExportOneDsfm(const Reconstruction& model, const Database& database,
                                  const std::string& image_path, const std::string& output_path,
                                  const RunContext& run);

}  // namespace cairn
