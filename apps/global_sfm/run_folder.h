#pragma once

#include <map>
#include <string>
#include <vector>

#include "cairn/base/progress.h"
#include "cairn/bundle_adjustment/pose_confidence.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/scene/view_graph.h"

namespace cairn {

// What `global_sfm reconstruct` wrote into a folder.
struct RunFolder {
  std::vector<Reconstruction> models;    // largest first; none after a failure
  std::vector<std::string> model_names;  // "sparse/0", ...
  std::vector<std::map<image_t, PoseConfidence>> confidences;  // of each model's images
  ViewGraph graph;
  std::string report_json;
};

// The folder of the run that the path is in, as itself, its models or one of them; "": of none.
std::string RunFolderOf(const std::string& path);
// Warns where the path is of a run that did not finish its models: its folder, or a model in it.
void WarnOfUnfinishedModels(const std::string& model_path, ProgressMonitor& monitor);
// Warns of the models beside the largest, which alone is `done` where the path is a run's folder.
void WarnOfOtherModels(const std::string& model_path, const std::string& done,
                       ProgressMonitor& monitor);
// Throws IoError where a file cannot be read.
RunFolder ReadRunFolder(const std::string& folder);

}  // namespace cairn
