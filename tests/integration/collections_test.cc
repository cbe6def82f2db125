// Photographs to models through the two programs, on every collection of ../shared/data, against
// the poses that come with it. One thread each, since ctest runs several.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "cairn/evaluation/pose_evaluation.h"
#include "cairn/image/image_folder.h"
#include "cairn/io/model.h"
#include "support/run_program.h"
#include "support/shared_data.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

// What is known of the cameras: nothing, that all photographs are of one, or its intrinsics, too.
enum class Cameras { kUnknown, kOne, kGiven };

struct Photos {
  // Every step-th, and at most so many, where all of them take minutes.
  int step = 1;
  size_t max_count = std::numeric_limits<size_t>::max();
  // Of 640 x 480 pixels: they need more than 2000 keypoints, from the finest octave on.
  bool are_small = false;
};

struct Collection {
  std::string name;
  std::vector<std::string> folders;  // in ../shared/data; each is a place, with a model of its own
  Cameras cameras = Cameras::kOne;
  int min_registered = 0;  // photographs, of all models
  double min_auc5 = 0;     // percent, of each place: at least five points below what is measured
  Photos photos = {};
};

void PrintTo(const Collection& collection, std::ostream* out) { *out << collection.folders[0]; }

const Collection kCollections[] = {
    {"fountain", {"strecha/fountain-P11"}, Cameras::kGiven, 11, 93},
    {"herz_jesus", {"strecha/Herz-Jesus-P8"}, Cameras::kGiven, 8, 92},
    {"entry", {"strecha/entry-P10"}, Cameras::kGiven, 10, 92},
    {"two_places", {"strecha/fountain-P11", "strecha/Herz-Jesus-P8"}, Cameras::kGiven, 19, 92},
    {"lund_door", {"lund_door"}, Cameras::kOne, 12, 93},
    {"reichstag", {"reichstag"}, Cameras::kUnknown, 9, 45},
    {"temple_ring", {"temple_ring"}, Cameras::kGiven, 19, 90, {.are_small = true}},
    {"dino", {"collections/dino48"}, Cameras::kGiven, 48, 93, {.are_small = true}},
    {"dtu", {"collections/dtu_scan24"}, Cameras::kGiven, 49, 90},
    {"fox", {"collections/fox"}, Cameras::kOne, 48, 80},
    {"horns", {"collections/llff_horns"}, Cameras::kOne, 61, 88},
    {"kitti", {"collections/kitti_seq1"}, Cameras::kOne, 50, 72},
    {"corridor", {"collections/corridor215"}, Cameras::kOne, 62, 80, {.step = 3}},
    {"south_building", {"collections/south-building"}, Cameras::kOne, 39, 86, {.max_count = 40}},
};

std::vector<std::string> CameraOptions(const Collection& collection) {
  if (collection.cameras == Cameras::kUnknown) return {};
  if (collection.cameras == Cameras::kOne) return {"--single_camera"};
  const std::string folder = SharedDataPath(collection.folders[0]);
  std::string model = "PINHOLE", params;
  // Strecha's references are of larger photographs; the intrinsics of these are in a file.
  if (std::ifstream file(folder + "/pinhole_fx_fy_cx_cy.txt"); file) {
    std::getline(file, params);
    std::replace(params.begin(), params.end(), ' ', ',');
  } else {
    const Camera camera = ReadModel(folder + "/gt").cameras.begin()->second;
    model = CameraModelName(camera.model);
    std::ostringstream text;
    text.precision(17);
    for (const double value : camera.params) text << (text.tellp() > 0 ? "," : "") << value;
    params = text.str();
  }
  return {"--single_camera", "--camera_model", model, "--camera_params", params};
}

// The reference poses of the photographs that take part, a map a place, by the names that these
// have in `images`, into which they are linked.
std::vector<PosedCameras> LinkPhotos(const Collection& collection, const std::string& images) {
  std::vector<PosedCameras> references;
  for (size_t place = 0; place < collection.folders.size(); ++place) {
    const std::string folder = SharedDataPath(collection.folders[place]);
    const std::vector<std::string> names = ListImages(folder + "/images");
    const PosedCameras poses = PosedCamerasOf(ReadModel(folder + "/gt"));
    const std::string prefix = "place" + std::to_string(place) + "/";
    fs::create_directories(fs::path(images) / prefix);
    PosedCameras& reference = references.emplace_back();
    const size_t step = static_cast<size_t>(collection.photos.step);
    for (size_t i = 0; i < names.size() && i / step < collection.photos.max_count; i += step) {
      fs::create_symlink(folder + "/images/" + names[i], fs::path(images) / (prefix + names[i]));
      const auto pose = poses.find(names[i]);
      if (pose != poses.end()) reference[prefix + names[i]] = pose->second;
    }
  }
  return references;
}

class CollectionTest : public ::testing::TestWithParam<Collection> {};

TEST_P(CollectionTest, IsReconstructed) {
  const Collection& collection = GetParam();
  for (const std::string& folder : collection.folders) {
    if (!fs::exists(SharedDataPath(folder))) GTEST_SKIP() << SharedDataPath(folder) << " is absent";
  }
  const TempFolder work;
  const std::vector<PosedCameras> references = LinkPhotos(collection, work / "images");
  std::vector<std::string> build = {"--image_path",
                                    work / "images",
                                    "--database_path",
                                    work / "scene.db",
                                    "--num_threads",
                                    "1",
                                    "--seed",
                                    "0",
                                    "--features.max_num_features"};
  build.push_back(collection.photos.are_small ? "8192" : "2000");
  if (!collection.photos.are_small) build.insert(build.end(), {"--features.first_octave", "0"});
  const std::vector<std::string> cameras = CameraOptions(collection);
  build.insert(build.end(), cameras.begin(), cameras.end());
  const ProgramResult built = RunProgram("build_view_graph", build);
  ASSERT_EQ(built.exit_code, 0) << built.output;
  const ProgramResult reconstructed = RunProgram(
      "global_sfm", {"reconstruct", "--database_path", work / "scene.db", "--output_path",
                     work / "out", "--num_threads", "1", "--reconstruct.colors", "0"});
  ASSERT_EQ(reconstructed.exit_code, 0) << reconstructed.output;

  std::vector<PosedCameras> models;
  int num_registered = 0;
  for (const auto& entry : fs::directory_iterator(work / "out/sparse")) {
    models.push_back(PosedCamerasOf(ReadModel(entry.path())));
    num_registered += static_cast<int>(models.back().size());
  }
  EXPECT_EQ(models.size(), references.size());
  EXPECT_GE(num_registered, collection.min_registered);
  for (const PosedCameras& reference : references) {
    ASSERT_GE(reference.size(), 8u);
    double auc5 = 0;  // of the model that shows most of the place
    for (const PosedCameras& model : models) {
      auc5 = std::max(auc5, 100 * EvaluatePoses(model, reference).auc[2]);
    }
    EXPECT_GE(auc5, collection.min_auc5);
    std::cout << collection.name << ": " << models.size() << " models, " << num_registered
              << " photographs, AUC@5 " << auc5 << "\n";
  }
}

INSTANTIATE_TEST_SUITE_P(Shared, CollectionTest, ::testing::ValuesIn(kCollections),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace cairn
