// What `global_sfm report` and `inspect` read of an earlier run.
#include "global_sfm/run_folder.h"

#include "fuzz/input.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {

void FuzzRunFolder(std::string_view input) {
  static const Scratch scratch;
  const std::vector<std::string_view> files = SplitFiles(input, 2);
  scratch.Write("report.json", files[0]);
  scratch.Write("view_graph.json", files[1]);
  ReadOrRefuse([&] { ReadRunFolder(scratch.path()); });
}

}  // namespace cairn::fuzz
