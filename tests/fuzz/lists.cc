// Text files that users write: pairs of images, positions, control points, relative rotations.
#include "cairn/io/gcp_file.h"
#include "cairn/io/gps_file.h"
#include "cairn/pipeline/stages.h"
#include "fuzz/input.h"
#include "fuzz/targets.h"
#include "global_sfm/rotation_files.h"

namespace cairn::fuzz {

void FuzzLists(std::string_view input) {
  static const Scratch scratch;
  static const std::vector<Image> images = {{1, "a.jpg", 1}, {2, "b c.jpg", 1}, {3, "c.jpg", 1}};
  const std::string path = scratch.Write("list.txt", input);
  ReadOrRefuse([&] { ReadPairList(path, images, NullMonitor()); });
  ReadOrRefuse([&] { ReadGpsFile(path); });
  ReadOrRefuse([&] { ReadGcpFile(path); });
  ReadOrRefuse([&] { ReadRelativeRotations(path); });
}

}  // namespace cairn::fuzz
