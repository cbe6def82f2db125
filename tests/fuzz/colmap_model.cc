// COLMAP models: what was read can be written and read again.
#include "cairn/io/colmap_model.h"

#include "cairn/base/check.h"
#include "fuzz/input.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {
namespace {

void FuzzModel(std::string_view input, ColmapModelFormat format, const Scratch& scratch) {
  const std::string extension = format == ColmapModelFormat::kBinary ? ".bin" : ".txt";
  const std::vector<std::string_view> files = SplitFiles(input, 3);
  scratch.Write("cameras" + extension, files[0]);
  scratch.Write("images" + extension, files[1]);
  scratch.Write("points3D" + extension, files[2]);
  ReadOrRefuse([&] {
    const Reconstruction model = ReadColmapModel(scratch.path());
    const std::string copy = scratch.path() + "/copy";
    try {
      WriteColmapModel(model, copy, format);
    } catch (const IoError&) {  // a name that no model can hold
      return;
    }
    const Reconstruction again = ReadColmapModel(copy);
    CAIRN_CHECK_EQ(again.images.size(), model.images.size());
    CAIRN_CHECK_EQ(again.points3D.size(), model.points3D.size());
  });
}

}  // namespace

void FuzzColmapBinary(std::string_view input) {
  static const Scratch scratch;
  FuzzModel(input, ColmapModelFormat::kBinary, scratch);
}

void FuzzColmapText(std::string_view input) {
  static const Scratch scratch;
  FuzzModel(input, ColmapModelFormat::kText, scratch);
}

}  // namespace cairn::fuzz
