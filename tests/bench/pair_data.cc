#include "bench/pair_data.h"

#include <memory>

#include "cairn/depth/depth_network.h"
#include "cairn/depth/sample_depth.h"
#include "cairn/image/bitmap.h"
#include "database/match_origins.h"

namespace cairn::bench {

PairInput PairData::Input(size_t index, uint64_t seed) const {
  const auto& [pair_id, matches] = pairs[index];
  const auto [id1, id2] = PairIdToImagePair(pair_id);
  const ImageData& image1 = images.at(id1);
  const ImageData& image2 = images.at(id2);
  PairInput input;
  input.pair_id = pair_id;
  input.seed = seed;
  input.camera1 = &image1.camera;
  input.camera2 = &image2.camera;
  input.keypoints1 = image1.keypoints;
  input.keypoints2 = image2.keypoints;
  input.depth1 = image1.depth;
  input.depth2 = image2.depth;
  input.matches = matches;
  input.are_best_first = are_best_first[index];
  return input;
}

PairData ReadPairData(const std::string& database_path) {
  const Database database(database_path, Database::Mode::kReadOnly);
  std::map<camera_t, Camera> cameras;
  for (const Camera& camera : database.ReadCameras()) cameras[camera.camera_id] = camera;
  PairData data;
  for (const Image& image : database.ReadImages()) {
    ImageData& to = data.images[image.image_id];
    to.name = image.name;
    to.camera = cameras.at(image.camera_id);
    to.keypoints = database.ReadKeypoints(image.image_id).value();
  }
  const MatchOrigins origins(database);
  for (const image_pair_t id : database.ReadMatchedPairIds()) {
    data.are_best_first.push_back(origins.AreOurs(id));
    data.pairs.emplace_back(id, database.ReadMatches(id).value());
  }
  return data;
}

void ReadDepth(const std::string& source, const std::string& image_path,
               const DepthOptions& options, PairData* data) {
  std::unique_ptr<DepthNetwork> network;
  if (source.ends_with(".onnx")) network = std::make_unique<DepthNetwork>(source, options);
  for (auto& [id, image] : data->images) {
    image.depth.clear();
    if (source == "none") continue;
    DepthMap map;
    if (network) {
      const size_t cut = image.name.rfind('_');
      map = network->Compute(ReadBitmap(
          image_path + "/" + image.name.substr(0, cut) + "/images/" + image.name.substr(cut + 1),
          BitmapColor::kRgb));
    } else {
      const auto path = FindDepthMap(source, image.name);
      if (!path) continue;
      map = ReadDepthMap(*path, options);
    }
    image.depth =
        SampleDepth(map, image.camera.width, image.camera.height, image.keypoints, options);
  }
}

}  // namespace cairn::bench
