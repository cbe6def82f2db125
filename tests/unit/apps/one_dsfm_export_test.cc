#include "global_sfm/one_dsfm_export.h"

#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/image/bitmap.h"
#include "cairn/image/exif.h"
#include "cairn/io/one_dsfm.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"
#include "unit/io/random_reconstruction.h"

namespace cairn {
namespace {

struct Warnings : ProgressMonitor {
  void Warning(const std::string& message) override { text += message + "\n"; }
  std::string text;
};

// A model of six images with cameras of all kinds, photographs of them, and a database that also
// holds an image which the model does not have.
class OneDsfmExport : public ::testing::Test {
 protected:
  OneDsfmExport() : database_(":memory:") {
    model_ = RandomReconstruction(1);
    for (auto& [id, image] : model_.images) {
      image.image.name = "view/" + std::to_string(id) + ".png";
    }
    for (const auto& [id, camera] : model_.cameras) database_.WriteCamera(camera);
    for (const auto& [id, image] : model_.images) database_.WriteImage(image.image);
    Camera guessed = Camera::FromFocal(9, CameraModel::kSimpleRadial, 960, 800, 600);
    database_.WriteCamera(guessed);
    database_.WriteImage({9, "other.png", 9});
    database_.WriteKeypoints(9, {{100, 200, 1, 0, 0, 1}, {300, 400, 1, 0, 0, 1}});
    for (const auto& [id, image] : model_.images) WriteKeypointsOf(image);
    WriteEdge(1, 2);
    WriteEdge(2, 5);
    for (const Image& image : database_.ReadImages()) WritePhoto(image.name);
  }

  void WriteEdge(image_t id1, image_t id2) {
    TwoViewGeometry geometry;
    geometry.config = TwoViewConfig::kCalibrated;
    Rigid3d pose =
        model_.images.at(id2).cam_from_world * Inverse(model_.images.at(id1).cam_from_world);
    pose.translation.normalize();
    geometry.cam2_from_cam1 = pose;
    geometry.inlier_matches = {{0, 0}};
    database_.WriteTwoViewGeometry(ImagePairToPairId(id1, id2), geometry);
  }

  void WriteKeypointsOf(const RegisteredImage& image) {
    std::vector<Keypoint> keypoints;
    for (const Eigen::Vector2d& pixel : image.points2D) {
      keypoints.push_back({static_cast<float>(pixel.x()), static_cast<float>(pixel.y())});
    }
    database_.WriteKeypoints(image.image.image_id, keypoints);
  }

  void WritePhoto(const std::string& name) {
    Bitmap bitmap{.width = 800, .height = 600, .channels = 3, .data = {}};
    for (int y = 0; y < 600; ++y) {
      for (int x = 0; x < 800; ++x) {
        for (const int value : {x / 4, y / 4, 77}) {
          bitmap.data.push_back(static_cast<uint8_t>(value));
        }
      }
    }
    CreateFolders(std::filesystem::path(Photos() + "/" + name).parent_path().string());
    WriteBitmap(Photos() + "/" + name, bitmap);
  }

  std::string Photos() const { return folder_ / "photos"; }
  std::string Output() const { return folder_ / "set"; }
  OneDsfmExportReport Export() {
    return ExportOneDsfm(model_, database_, Photos(), Output(),
                         {.num_threads = 2, .monitor = monitor_});
  }

  TempFolder folder_;
  Reconstruction model_;
  Database database_;
  Warnings monitor_;
};

TEST_F(OneDsfmExport, HoldsTheReconstructionAndTheVerifiedPairs) {
  const OneDsfmExportReport report = Export();
  EXPECT_EQ(report.num_images, 7);
  EXPECT_EQ(report.num_registered, 6);
  EXPECT_EQ(report.num_edges, 2);
  EXPECT_EQ(report.num_tracks, static_cast<int>(model_.points3D.size()));
  EXPECT_EQ(report.num_without_photo, 0);
  EXPECT_EQ(monitor_.text, "");

  const OneDsfmDataset dataset = ReadOneDsfmDataset(Output());
  EXPECT_TRUE(dataset.has_photographs);
  ASSERT_EQ(dataset.images.size(), 7u);
  EXPECT_EQ(dataset.images[0].name, "images/view/1.png");
  EXPECT_DOUBLE_EQ(*dataset.images[0].focal_px, model_.cameras.at(1).MeanFocal());
  EXPECT_EQ(dataset.images[6].name, "images/other.png");
  EXPECT_FALSE(dataset.images[6].focal_px);  // a guess is not written as a known focal length
  EXPECT_EQ(dataset.component, (std::vector<int>{0, 1, 2, 3, 4, 5}));
  ASSERT_EQ(dataset.edges.size(), 2u);
  EXPECT_EQ(dataset.edges[1].i, 1);
  EXPECT_EQ(dataset.edges[1].j, 4);
  const Rigid3d truth =
      model_.images.at(5).cam_from_world * Inverse(model_.images.at(2).cam_from_world);
  const Rigid3d& edge = dataset.edges[1].cam_j_from_cam_i;
  EXPECT_LT(AngleBetween(edge.rotation, truth.rotation), 1e-12);
  EXPECT_LT(AngleBetween(edge.translation, truth.translation), 1e-7);
}

// As of COLMAP up to 3.13.
TEST_F(OneDsfmExport, PairsWithoutAStoredPoseHaveTheirEssentialMatrixs) {
  const RegisteredImage &image1 = model_.images.at(3), &image2 = model_.images.at(4);
  const Rigid3d pose = image2.cam_from_world * Inverse(image1.cam_from_world);
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kCalibrated;
  geometry.E = EssentialFromPose(pose);
  for (point2D_t k = 0; k < image1.points2D.size(); ++k) {
    if (image1.point3D_ids[k] == kInvalidPoint3DId) continue;
    for (const TrackElement& other : model_.points3D.at(image1.point3D_ids[k]).track) {
      if (other.image_id == 4) geometry.inlier_matches.push_back({k, other.point2D});
    }
  }
  database_.WriteTwoViewGeometry(ImagePairToPairId(3, 4), geometry);
  EXPECT_EQ(Export().num_edges, 3);
}

TEST_F(OneDsfmExport, KeysAndReferenceAreThoseOfTheResampledPhotographs) {
  Export();
  const OneDsfmDataset dataset = ReadOneDsfmDataset(Output());
  const auto coords = ReadOneDsfmCoords(dataset.coords_path, 7);
  const auto tracks = ReadOneDsfmTracks(dataset.tracks_path, 7);
  const Reconstruction reference = ReadBundler(Output() + "/gt_bundle.out", Output() + "/list.txt");
  ASSERT_EQ(reference.images.size(), 6u);
  ASSERT_EQ(coords.size(), 7u);
  EXPECT_EQ(coords[6].keys.size(), 2u);
  ASSERT_EQ(tracks.size(), model_.points3D.size());
  auto point = model_.points3D.begin();
  for (const auto& track : tracks) {
    ASSERT_EQ(track.size(), point->second.track.size());
    for (const OneDsfmObservation& observation : track) {
      // One focal length and a central principal point explain the key up to its noise.
      const OneDsfmImageKeys& keys = coords[observation.image];
      const auto key = std::find_if(keys.keys.begin(), keys.keys.end(),
                                    [&](const auto& k) { return k.key == observation.key; });
      ASSERT_NE(key, keys.keys.end());
      const RegisteredImage& image = reference.images.at(observation.image + 1);
      const Eigen::Vector3d x = image.cam_from_world * point->second.xyz;
      const Eigen::Vector2d pixel = keys.focal_px * x.hnormalized() + Eigen::Vector2d(400, 300);
      EXPECT_LT((pixel - key->pixel).norm(), 2.0);
    }
    ++point;
  }
}

TEST_F(OneDsfmExport, PhotographsShowWhatTheKeysSay) {
  const OneDsfmExportReport report = Export();
  EXPECT_EQ(report.num_copied, 1);  // the guessed camera: no distortion, central
  EXPECT_EQ(report.num_resampled, 6);
  EXPECT_EQ(ReadFile(Output() + "/images/other.png"), ReadFile(Photos() + "/other.png"));
  const OneDsfmDataset dataset = ReadOneDsfmDataset(Output());
  for (const OneDsfmImageKeys& keys : ReadOneDsfmCoords(dataset.coords_path, 7)) {
    const Bitmap bitmap = ReadBitmap(Output() + "/" + keys.name, BitmapColor::kRgb);
    ASSERT_EQ(bitmap.width, 800);
    for (const OneDsfmKey& key : keys.keys) {
      if (key.pixel.x() < 5 || key.pixel.y() < 5 || key.pixel.x() > 795 || key.pixel.y() > 595) {
        continue;
      }
      const uint8_t* rgb =
          bitmap.Pixel(static_cast<int>(key.pixel.x()), static_cast<int>(key.pixel.y()));
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(rgb[c], key.color[c], 2);
    }
  }
}

TEST_F(OneDsfmExport, PhotographsOfOneCameraSayWhichItIs) {
  // Image 2 was taken by the camera of image 1.
  model_.images.at(2).image.camera_id = 1;
  database_.WriteImage(model_.images.at(2).image);
  Export();
  const auto tags = [&](int id) {
    return ReadExif(Output() + "/images/view/" + std::to_string(id) + ".png", 800, 600);
  };
  EXPECT_EQ(tags(1).camera_model, tags(2).camera_model);
  EXPECT_EQ(tags(1).camera_make, tags(2).camera_make);
  EXPECT_NE(tags(1).camera_model, tags(3).camera_model);
  ASSERT_TRUE(tags(1).focal_px);
  EXPECT_NEAR(*tags(1).focal_px, model_.cameras.at(1).MeanFocal(), 15);  // whole millimeters
  EXPECT_EQ(ReadExif(Output() + "/images/other.png", 800, 600).camera_make, "");
}

TEST_F(OneDsfmExport, NamesBrokenPhotographsAndGoesOn) {
  WriteFileAtomically(Photos() + "/view/3.png", "no picture");
  std::filesystem::remove(Photos() + "/view/4.png");
  const OneDsfmExportReport report = Export();
  EXPECT_EQ(report.num_without_photo, 2);
  EXPECT_THAT(monitor_.text, HasSubstr("view/3.png"));
  EXPECT_THAT(monitor_.text, HasSubstr("view/4.png"));
  EXPECT_EQ(ReadOneDsfmDataset(Output()).images.size(), 7u);
}

TEST_F(OneDsfmExport, WhatCannotBeWrittenEndsIt) {
  CreateFolders(Output() + "/images/view/3.png");
  EXPECT_NE(ThrownMessage<IoError>([&] { Export(); }).find("view/3.png"), std::string::npos);
}

TEST_F(OneDsfmExport, NeverReplacesThePhotographsThatItReads) {
  std::filesystem::create_directory(Output());
  std::filesystem::rename(Photos(), Output() + "/images");
  std::filesystem::create_symlink(Output() + "/images", Photos());
  const std::string before = ReadFile(Photos() + "/other.png");
  const std::string message = ThrownMessage<ConfigError>([&] { Export(); });
  EXPECT_NE(message.find("photographs would be replaced in " + Output() + "/images"),
            std::string::npos)
      << message;
  EXPECT_EQ(ReadFile(Photos() + "/other.png"), before);
}

TEST_F(OneDsfmExport, RefusesABlankInANameBeforeAnyWork) {
  database_.WriteImage({10, "with blank.png", 9});
  EXPECT_THAT(ThrownMessage<IoError>([&] { Export(); }), HasSubstr("'images/with blank.png'"));
  EXPECT_FALSE(std::filesystem::exists(Output()));
}

TEST_F(OneDsfmExport, RefusesAModelOfAnotherDatabase) {
  model_.images.at(2).image.name = "elsewhere.png";
  EXPECT_THAT(ThrownMessage<IoError>([&] { Export(); }), HasSubstr("elsewhere.png"));
}

}  // namespace
}  // namespace cairn
