#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/bundle_adjustment/pose_confidence.h"
#include "cairn/database/database.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/scene/view_graph.h"

namespace cairn {

// Where Debian's libjs-three has three.js.
inline constexpr const char* kThreeFolder = "/usr/share/javascript/three";

// How much of everything goes into the page, so that 2,000 photographs and a million points stay
// under 30 MB of file; four bytes of file hold three of these.
struct ReportPageLimits {
  int64_t thumbnail_bytes = 6'500'000;  // of all JPEGs together
  int64_t points = 320'000;             // of 15 bytes, of all models together
  int64_t pairs = 200'000;              // of 28 bytes
  int64_t matches = 375'000;            // of 8 bytes, of all pairs together
};

struct ReportPageInput {
  std::string title = {};
  // Folder of the photographs, for thumbnails; "" or photographs that cannot be read: none.
  std::string image_path;
  // Largest first, with image ids and keypoints of the database; none after a failure.
  std::span<const Reconstruction> models;
  std::vector<std::string> model_names;  // one a model: "sparse/0", ...
  // Of the images of each model; empty: they are estimated, as if keypoints were all alike.
  std::span<const std::map<image_t, PoseConfidence>> confidences = {};
  const ViewGraph& graph;
  std::string run_json;         // text of the run's report.json; "": unknown
  std::string build_json = {};  // text of build_view_graph's report; "": unknown
  std::string three_folder = kThreeFolder;
  ReportPageLimits limits = {};
};

struct ReportPage {
  std::string html;                   // one file that needs no network
  std::vector<std::string> warnings;  // what it lacks and how to get it
};

// A page for a browser that shows a run: what is wrong and what to do about it, a 3D view of the
// models, the view graph with its pairs, figures, lenses, stages, photographs. Works for failed
// runs, too. The same input gives the same bytes for any number of threads. Text of databases and
// file names is only ever text in it. Throws IoError where the database cannot be read, ConfigError
// where a model is not of this database.
ReportPage MakeReportPage(const Database& database, const ReportPageInput& input,
                          const RunContext& run = {});

}  // namespace cairn
