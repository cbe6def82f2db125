// What `global_sfm report` and `inspect` read of an earlier run.
#include "global_sfm/run_folder.h"

#include "cairn/io/colmap_model.h"
#include "fuzz/input.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {
namespace {

constexpr std::string_view kConfidences =
    "image,model,pairs,points,rotation_sigma_deg,position_sigma\n"
    "a.jpg,0,1,300,0.25,0.01\n"
    "b.jpg,0,1,300,inf,inf\n";

// A folder whose model has two images.
struct FolderOfARun {
  FolderOfARun() {
    Reconstruction model;
    model.cameras[1] = Camera::FromFocal(1, CameraModel::kPinhole, 500, 640, 480);
    model.images[1].image = {1, "a.jpg", 1};
    model.images[2].image = {2, "b.jpg", 1};
    WriteColmapModel(model, scratch.path() + "/sparse/0");
  }
  Scratch scratch;
};

}  // namespace

void FuzzRunFolder(std::string_view input) {
  static const FolderOfARun folder;
  const std::vector<std::string_view> files = SplitFiles(input, 3);
  folder.scratch.Write("report.json", files[0]);
  folder.scratch.Write("view_graph.json", files[1]);
  // Read before the view graph, which few inputs would reach otherwise.
  folder.scratch.Write("confidence.csv", files[2].empty() ? kConfidences : files[2]);
  ReadOrRefuse([&] { ReadRunFolder(folder.scratch.path()); });
}

}  // namespace cairn::fuzz
