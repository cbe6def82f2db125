#include <bit>
#include <string>

#include "cairn/base/file.h"
#include "cairn/image/exif.h"
#include "cairn/io/colmap_model.h"
#include "cairn/synthetic/photos.h"

namespace cairn {
namespace {

// NumPy's format, version 1.0: little-endian float32, C order.
void WriteNpy(const std::string& path, const SyntheticDepthMap& map) {
  static_assert(std::endian::native == std::endian::little);
  std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (" +
                       std::to_string(map.height) + ", " + std::to_string(map.width) + "), }";
  constexpr size_t kPreamble = 10;  // magic, version, length of the header
  header.append(63 - (kPreamble + header.size()) % 64, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(map.depth.data()), map.depth.size() * sizeof(float));
  WriteFileAtomically(path, bytes);
}

}  // namespace

void WritePhotoScene(const PhotoScene& scene, const std::string& folder, int num_threads,
                     ProgressMonitor& monitor) {
  CreateFolders(folder + "/images");
  CreateFolders(folder + "/depth");
  monitor.BeginStage("render photographs", static_cast<int64_t>(scene.images.size()));
  for (size_t i = 0; i < scene.images.size() && !monitor.StopRequested(); ++i) {
    const Image& image = scene.images[i];
    const std::string path = folder + "/images/" + image.name;
    WriteBitmap(path, RenderPhoto(scene, static_cast<int>(i), num_threads));
    const int camera_index = static_cast<int>(image.camera_id) - 1;
    WriteExif(path, {FocalLength35mm(scene.options, camera_index), "cairn",
                     "synthetic camera " + std::to_string(image.camera_id)});
    WriteNpy(folder + "/depth/" + image.name + ".npy",
             RenderDepthMap(scene, static_cast<int>(i), num_threads));
    monitor.Advance(1);
  }
  monitor.EndStage();
  WriteColmapModel(scene.truth, folder + "/truth", ColmapModelFormat::kText);
}

}  // namespace cairn
