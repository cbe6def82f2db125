// Models and data sets of other programs.
#include "cairn/io/bundler.h"
#include "cairn/io/one_dsfm.h"
#include "cairn/io/strecha.h"
#include "fuzz/input.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {

void FuzzBundler(std::string_view input) {
  static const Scratch scratch;
  const std::vector<std::string_view> files = SplitFiles(input, 2);
  const std::string list = scratch.Write("list.txt", files[0]);
  const std::string bundle = scratch.Write("bundle.out", files[1]);
  for (const bool read_points : {false, true}) {
    ReadOrRefuse([&] { ReadBundler(bundle, list, {.read_points = read_points}); });
  }
}

void FuzzStrecha(std::string_view input) {
  static const Scratch scratch;
  scratch.Write("0000.png.camera", input);
  ReadOrRefuse([&] { ReadStrecha(scratch.path()); });
}

void FuzzOneDsfm(std::string_view input) {
  constexpr int kNumImages = 3;
  static const Scratch scratch;
  const std::vector<std::string_view> files = SplitFiles(input, 5);
  constexpr const char* kNames[] = {"list.txt", "cc.txt", "EGs.txt", "coords.txt", "tracks.txt"};
  for (size_t i = 0; i < files.size(); ++i) scratch.Write(kNames[i], files[i]);
  ReadOrRefuse([&] { ReadOneDsfmDataset(scratch.path()); });
  ReadOrRefuse([&] { ReadOneDsfmCoords(scratch.path() + "/coords.txt", kNumImages); });
  ReadOrRefuse([&] { ReadOneDsfmTracks(scratch.path() + "/tracks.txt", kNumImages); });
}

}  // namespace cairn::fuzz
