// Depth maps of every kind; the first byte chooses the extension.
#include "cairn/depth/depth_map.h"

#include "fuzz/input.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {

void FuzzDepthMap(std::string_view input) {
  constexpr const char* kNames[] = {"map.npy", "map.pfm", "map.bin", "map.png"};
  static const Scratch scratch;
  Bytes bytes(input);
  const std::string name = kNames[bytes.TakeIndex(4)];
  const std::string path = scratch.Write(name, input.substr(std::min<size_t>(1, input.size())));
  for (const DepthKind kind : {DepthKind::kDepth, DepthKind::kInverse, DepthKind::kLog}) {
    ReadOrRefuse([&] { ReadDepthMap(path, DepthOptions{.kind = kind}); });
  }
}

}  // namespace cairn::fuzz
