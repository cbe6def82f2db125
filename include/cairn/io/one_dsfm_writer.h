#pragma once

#include <string>
#include <vector>

#include "cairn/io/one_dsfm.h"

namespace cairn {

// The contents of the text files of a 1DSfM data set, in cairn's frames (one_dsfm.h).
struct OneDsfmFiles {
  std::vector<BundlerListEntry> images;  // list.txt: names as there ("images/<file>")
  std::vector<int> component;            // cc.txt
  std::vector<OneDsfmEdge> edges;        // EGs.txt
  std::vector<OneDsfmImageKeys> coords;  // coords.txt
  std::vector<std::vector<OneDsfmObservation>> tracks;  // tracks.txt
};

// Writes list.txt, cc.txt, EGs.txt, coords.txt and tracks.txt, creating the folder; the readers of
// one_dsfm.h give the same values back. Indices must be those of `images`. Throws IoError, also for
// a name that the format cannot hold (empty, or with a blank in it).
void WriteOneDsfmFiles(const std::string& folder, const OneDsfmFiles& files);

// Throws IoError, which names the list, for a name that the format cannot hold.
void CheckOneDsfmName(const std::string& name, const std::string& list_path);

}  // namespace cairn
