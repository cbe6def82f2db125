#pragma once

#include <string>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/database/records.h"

namespace cairn {

// How a photograph with an error is remembered: with its hash, so that it stays out until it
// changes. 0 where it is another file by now or cannot be read for now (gone, no connection), so
// that the next run tries it.
inline PhotoRecord FailedPhoto(const std::string& folder, PhotoRecord photo) {
  try {
    if (HashFile(PathInFolder(folder, photo.name)) != photo.file_hash) photo.file_hash = 0;
  } catch (const IoError&) {
    photo.file_hash = 0;
  }
  return photo;
}

}  // namespace cairn
