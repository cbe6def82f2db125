#include "pipeline/stages/import_dataset.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>

#include "base/hash.h"
#include "cairn/base/error.h"
#include "cairn/geometry/epipolar.h"
#include "database/stage_names.h"
#include "pipeline/stages/camera_maker.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

// The side of an image with unknown size and focal length, px.
constexpr double kUnknownSize = 1000;

image_t ImageId(int index) { return static_cast<image_t>(index + 1); }

bool IsInComponent(const OneDsfmDataset& dataset, int index) {
  return std::binary_search(dataset.component.begin(), dataset.component.end(), index);
}

// Keypoints of all images, and where each key went.
struct DatasetKeys {
  std::map<int, OneDsfmImageKeys> images;
  std::map<int, std::unordered_map<int, point2D_t>> point_of_key;
};

DatasetKeys ReadKeys(const OneDsfmDataset& dataset) {
  DatasetKeys keys;
  if (dataset.coords_path.empty()) return keys;
  const int num_images = static_cast<int>(dataset.images.size());
  for (OneDsfmImageKeys& image : ReadOneDsfmCoords(dataset.coords_path, num_images)) {
    auto& points = keys.point_of_key[image.index];
    for (const OneDsfmKey& key : image.keys) {
      points.emplace(key.key, static_cast<point2D_t>(points.size()));
    }
    const int index = image.index;
    keys.images[index] = std::move(image);
  }
  return keys;
}

// Where the key of a track went. `track` counts from 0; the first line of the file is their number.
point2D_t PointOfKey(const OneDsfmDataset& dataset, const DatasetKeys& keys,
                     const OneDsfmObservation& observation, size_t track) {
  const auto image = keys.point_of_key.find(observation.image);
  if (image != keys.point_of_key.end()) {
    const auto point = image->second.find(observation.key);
    if (point != image->second.end()) return point->second;
  }
  throw IoError(dataset.tracks_path + ":" + std::to_string(track + 2),
                "coords.txt has no key " + std::to_string(observation.key) + " of image " +
                    std::to_string(observation.image));
}

// Matches that the tracks give, for pairs of the data set; sorted.
std::map<image_pair_t, FeatureMatches> ReadTrackMatches(const OneDsfmDataset& dataset,
                                                        const DatasetKeys& keys,
                                                        const std::vector<image_pair_t>& pairs) {
  std::map<image_pair_t, FeatureMatches> matches;
  if (dataset.tracks_path.empty() || dataset.coords_path.empty()) return matches;
  const auto tracks =
      ReadOneDsfmTracks(dataset.tracks_path, static_cast<int>(dataset.images.size()));
  for (size_t t = 0; t < tracks.size(); ++t) {
    std::vector<OneDsfmObservation> track = tracks[t];
    std::sort(track.begin(), track.end());
    for (size_t a = 0; a < track.size(); ++a) {
      for (size_t b = a + 1; b < track.size(); ++b) {
        if (track[a].image == track[b].image) continue;
        const image_pair_t pair =
            ImagePairToPairId(ImageId(track[a].image), ImageId(track[b].image));
        if (!std::binary_search(pairs.begin(), pairs.end(), pair)) continue;
        matches[pair].push_back(
            {PointOfKey(dataset, keys, track[a], t), PointOfKey(dataset, keys, track[b], t)});
      }
    }
  }
  for (auto& [pair, list] : matches) std::sort(list.begin(), list.end());
  return matches;
}

Photo DescribeImage(const OneDsfmDataset& dataset, const DatasetKeys& keys, int index) {
  Photo photo;
  photo.name = OneDsfmImageName(dataset.images[index].name);
  photo.given_focal_px = dataset.images[index].focal_px;
  const auto coords = keys.images.find(index);
  if (coords != keys.images.end()) {
    photo.size.width = static_cast<int>(std::lround(2 * coords->second.principal_point.x()));
    photo.size.height = static_cast<int>(std::lround(2 * coords->second.principal_point.y()));
    if (!photo.given_focal_px && coords->second.focal_px > 0) {
      photo.given_focal_px = coords->second.focal_px;
    }
  }
  if (photo.size.width < 1 || photo.size.height < 1) {
    const double side =
        photo.given_focal_px ? *photo.given_focal_px / kDefaultFocalFactor : kUnknownSize;
    photo.size.width = photo.size.height = std::max(1, static_cast<int>(std::lround(side)));
  }
  return photo;
}

void WriteImages(Database& database, const OneDsfmDataset& dataset, const DatasetKeys& keys,
                 const CameraOptions& options) {
  std::vector<Photo> photos;
  for (const int index : dataset.component) photos.push_back(DescribeImage(dataset, keys, index));
  CameraMaker maker(options, 1, {}, photos);
  std::vector<Image> images;
  for (size_t i = 0; i < photos.size(); ++i) {
    const std::optional<camera_t> camera_id = maker.CameraOf(photos[i]);
    if (!camera_id) throw ConfigError("single_camera", photos[i].name + " " + photos[i].error);
    images.push_back({ImageId(dataset.component[i]), photos[i].name, *camera_id});
  }
  for (const Camera& camera : maker.cameras()) database.WriteCamera(camera);
  for (const Image& image : images) database.WriteImage(image);
  for (const auto& [index, image] : keys.images) {
    if (!IsInComponent(dataset, index)) continue;
    std::vector<Keypoint> keypoints;
    for (const OneDsfmKey& key : image.keys) {
      keypoints.push_back({static_cast<float>(key.pixel.x()), static_cast<float>(key.pixel.y())});
    }
    database.WriteKeypoints(ImageId(index), keypoints);
  }
}

void WriteEdge(Database& database, const OneDsfmEdge& edge, const FeatureMatches& matches) {
  const image_pair_t pair = ImagePairToPairId(ImageId(edge.i), ImageId(edge.j));
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kCalibrated;
  geometry.cam2_from_cam1 =
      edge.i < edge.j ? edge.cam_j_from_cam_i : Inverse(edge.cam_j_from_cam_i);
  geometry.E = EssentialFromPose(*geometry.cam2_from_cam1);
  geometry.inlier_matches = matches;
  database.WriteMatches(pair, matches);
  database.WriteTwoViewGeometry(pair, geometry);
  PairMetrics metrics;
  metrics.pair_id = pair;
  metrics.verifier = metrics.step = kImportedVerifier;
  metrics.status = "verified";
  metrics.is_winner = true;
  metrics.num_matches = metrics.num_inliers = static_cast<int>(matches.size());
  metrics.cam2_from_cam1 = geometry.cam2_from_cam1;
  database.WritePairMetrics(metrics);
}

uint64_t HashDataset(const OneDsfmDataset& dataset) {
  Hasher hasher;
  for (const char* name : {"list.txt", "cc.txt", "EGs.txt"}) {
    hasher.Add(HashFile(dataset.folder + "/" + name));
  }
  for (const std::string& path : {dataset.coords_path, dataset.tracks_path}) {
    hasher.Add(path.empty() ? uint64_t{0} : HashFile(path));
  }
  return hasher.Digest();
}

}  // namespace

std::vector<PhotoSource::Photo> SelectDatasetPhotos(const OneDsfmDataset& dataset) {
  std::vector<PhotoSource::Photo> selection;
  for (const int index : dataset.component) {
    selection.push_back(
        {OneDsfmImageName(dataset.images[index].name), dataset.images[index].focal_px});
  }
  return selection;
}

std::vector<image_pair_t> FindDatasetPairs(const OneDsfmDataset& dataset,
                                           const std::vector<Image>& images) {
  std::map<std::string, image_t> ids;
  for (const Image& image : images) ids[image.name] = image.image_id;
  std::vector<image_pair_t> pairs;
  for (const OneDsfmEdge& edge : dataset.edges) {
    const auto id1 = ids.find(OneDsfmImageName(dataset.images[edge.i].name));
    const auto id2 = ids.find(OneDsfmImageName(dataset.images[edge.j].name));
    if (id1 == ids.end() || id2 == ids.end()) continue;
    pairs.push_back(ImagePairToPairId(id1->second, id2->second));
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

StageReport ImportDataset(Database& database, const OneDsfmDataset& dataset,
                          const CameraOptions& options, const RunContext& run) {
  Stage stage(run.monitor, kStageDataset);
  CheckCameraOptions(options);
  StageLedger ledger(database, kStageDataset, DumpOptions(options));
  const uint64_t hash = HashDataset(dataset);
  run.monitor.BeginStage("importing the data set", static_cast<int64_t>(dataset.edges.size()));
  std::vector<OneDsfmEdge> edges;
  for (const OneDsfmEdge& edge : dataset.edges) {
    if (IsInComponent(dataset, edge.i) && IsInComponent(dataset, edge.j)) edges.push_back(edge);
  }
  if (ledger.Find(0) == nullptr && !database.ReadImages().empty()) {
    throw ConfigError("dataset_path", database.path() +
                                          " has images already; a data set without photographs "
                                          "needs a new database");
  }
  if (!ledger.IsDone(0, hash, "the data set")) {
    const DatasetKeys keys = ReadKeys(dataset);
    std::vector<image_pair_t> pairs;
    for (const OneDsfmEdge& edge : edges) {
      pairs.push_back(ImagePairToPairId(ImageId(edge.i), ImageId(edge.j)));
    }
    std::sort(pairs.begin(), pairs.end());
    const auto matches = ReadTrackMatches(dataset, keys, pairs);
    Database::Transaction transaction(database);
    ledger.Begin(database);
    WriteImages(database, dataset, keys, options);
    for (const OneDsfmEdge& edge : edges) {
      const auto it = matches.find(ImagePairToPairId(ImageId(edge.i), ImageId(edge.j)));
      WriteEdge(database, edge, it == matches.end() ? FeatureMatches() : it->second);
      run.monitor.Advance(1);
    }
    database.WriteJob(kStageDataset, {0, hash, ""});
    ledger.Complete(database);
    transaction.Commit();
  }
  run.monitor.EndStage();
  stage.Add("images", dataset.component.size());
  stage.Add("edges", edges.size());
  stage.Add("edges_outside_cc", dataset.edges.size() - edges.size());
  return EndStage(stage, database);
}

}  // namespace cairn
