#include "cairn/io/colmap_model.h"

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "io/colmap_files.h"
#include "random_reconstruction.h"
#include "support/check_consistency.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

std::array<std::string, 3> Names(ColmapModelFormat format) {
  const std::string extension = format == ColmapModelFormat::kBinary ? ".bin" : ".txt";
  return {"cameras" + extension, "images" + extension, "points3D" + extension};
}

void ExpectEqual(const Reconstruction& a, const Reconstruction& b) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (const auto& [id, camera] : a.cameras) {
    const Camera& other = b.cameras.at(id);
    EXPECT_EQ(camera.model, other.model);
    EXPECT_EQ(camera.width, other.width);
    EXPECT_EQ(camera.height, other.height);
    EXPECT_EQ(camera.params, other.params);
  }
  ASSERT_EQ(a.images.size(), b.images.size());
  for (const auto& [id, image] : a.images) {
    const RegisteredImage& other = b.images.at(id);
    EXPECT_EQ(image.image.name, other.image.name);
    EXPECT_EQ(image.image.camera_id, other.image.camera_id);
    EXPECT_EQ(image.cam_from_world.rotation.coeffs(), other.cam_from_world.rotation.coeffs());
    EXPECT_EQ(image.cam_from_world.translation, other.cam_from_world.translation);
    EXPECT_EQ(image.points2D, other.points2D);
    EXPECT_EQ(image.point3D_ids, other.point3D_ids);
  }
  ASSERT_EQ(a.points3D.size(), b.points3D.size());
  for (const auto& [id, point] : a.points3D) {
    const Point3D& other = b.points3D.at(id);
    EXPECT_EQ(point.xyz, other.xyz);
    EXPECT_EQ(point.color, other.color);
    EXPECT_EQ(point.error_px, other.error_px);
    EXPECT_EQ(point.track, other.track);
  }
}

std::string ReadError(const std::string& folder) {
  return ThrownMessage<IoError>([&] { ReadColmapModel(folder); });
}

class ColmapModel : public ::testing::TestWithParam<ColmapModelFormat> {};
INSTANTIATE_TEST_SUITE_P(Formats, ColmapModel,
                         ::testing::Values(ColmapModelFormat::kBinary, ColmapModelFormat::kText),
                         [](const auto& info) {
                           return info.param == ColmapModelFormat::kBinary ? "Binary" : "Text";
                         });

TEST_P(ColmapModel, ComesBackExactlyAndInEqualBytes) {
  const TempFolder folder;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const Reconstruction written = RandomReconstruction(seed);
    WriteColmapModel(written, folder / "a", GetParam());
    const Reconstruction read = ReadColmapModel(folder / "a");
    CheckConsistency(read);
    ExpectEqual(written, read);
    WriteColmapModel(read, folder / "b/c", GetParam());
    for (const std::string& name : Names(GetParam())) {
      EXPECT_EQ(ReadFile(folder / ("a/" + name)), ReadFile(folder / ("b/c/" + name))) << name;
    }
  }
}

// The files' sizes are checked by the smallest records: a file may have nothing else.
TEST_P(ColmapModel, EveryCameraModelComesBackAlone) {
  const TempFolder folder;
  for (int id = 0; id < kNumCameraModels; ++id) {
    Reconstruction model;
    model.cameras[1] = Camera::FromFocal(1, *CameraModelFromId(id), 700, 1000, 600);
    WriteColmapModel(model, folder.path(), GetParam());
    ExpectEqual(model, ReadColmapModel(folder.path()));
  }
}

TEST_P(ColmapModel, EveryCameraModelComesBack) {
  const TempFolder folder;
  const Reconstruction model =
      RandomReconstruction(5, {.num_images = kNumCameraModels, .num_models = kNumCameraModels});
  WriteColmapModel(model, folder / "a", GetParam());
  ExpectEqual(ReadColmapModel(folder / "a"), model);
}

TEST_P(ColmapModel, EmptyModelAndImagesWithoutKeypoints) {
  const TempFolder folder;
  WriteColmapModel({}, folder / "a", GetParam());
  EXPECT_TRUE(ReadColmapModel(folder / "a").images.empty());
  Reconstruction r = RandomReconstruction(1, {.num_points = 0});
  WriteColmapModel(r, folder / "a", GetParam());
  ExpectEqual(r, ReadColmapModel(folder / "a"));
}

TEST_P(ColmapModel, ErrorsThatAreNotFiniteAreWrittenAsUnknown) {
  const TempFolder folder;
  Reconstruction r = RandomReconstruction(1);
  r.points3D.begin()->second.error_px = std::numeric_limits<double>::infinity();
  WriteColmapModel(r, folder / "a", GetParam());
  EXPECT_EQ(ReadColmapModel(folder / "a").points3D.begin()->second.error_px, -1);
}

TEST_P(ColmapModel, EveryTruncatedFileIsAnErrorOrASmallerText) {
  const TempFolder folder;
  WriteColmapModel(RandomReconstruction(3, {.num_images = 2, .num_points = 2}), folder.path(),
                   GetParam());
  for (const std::string& name : Names(GetParam())) {
    const std::string bytes = ReadFile(folder / name);
    const size_t step = GetParam() == ColmapModelFormat::kBinary ? 1 : 5;
    for (size_t size = 0; size < bytes.size(); size += step) {
      std::ofstream(folder / name, std::ios::binary) << std::string_view(bytes).substr(0, size);
      if (GetParam() == ColmapModelFormat::kBinary) {
        EXPECT_THROW(ReadColmapModel(folder.path()), IoError) << name << " cut at " << size;
      } else {
        try {  // A text can end anywhere; a cut last number cannot be told from a whole one.
          ReadColmapModel(folder.path());
        } catch (const IoError&) {
        }
      }
    }
    WriteFileAtomically(folder / name,
                        bytes + (GetParam() == ColmapModelFormat::kBinary ? std::string("\0", 1)
                                                                          : std::string("1 x\n")));
    EXPECT_THROW(ReadColmapModel(folder.path()), IoError);
    WriteFileAtomically(folder / name, bytes);
  }
  EXPECT_NO_THROW(ReadColmapModel(folder.path()));
}

TEST_P(ColmapModel, DamagedBytesNeverCrashOrAskForMuchMemory) {
  const TempFolder folder;
  WriteColmapModel(RandomReconstruction(3, {.num_images = 2, .num_points = 2}), folder.path(),
                   GetParam());
  Rng rng(5);
  for (const std::string& name : Names(GetParam())) {
    const std::string bytes = ReadFile(folder / name);
    for (int i = 0; i < 150; ++i) {
      std::string damaged = bytes;
      for (uint32_t n = 1 + rng.UniformInt(8); n > 0; --n) {
        damaged[rng.UniformInt(static_cast<uint32_t>(damaged.size()))] =
            static_cast<char>(rng.UniformInt(256));
      }
      std::ofstream(folder / name, std::ios::binary) << damaged;
      try {
        ReadColmapModel(folder.path());
      } catch (const IoError&) {
      }
    }
    WriteFileAtomically(folder / name, bytes);
  }
}

TEST_P(ColmapModel, AbsentFilesAndFoldersAreNamed) {
  const TempFolder folder;
  EXPECT_FALSE(IsColmapModel(folder.path()));
  EXPECT_THROW(ReadColmapModel(folder / "absent"), IoError);
  WriteColmapModel(RandomReconstruction(3), folder.path(), GetParam());
  EXPECT_TRUE(IsColmapModel(folder.path()));
  const std::string points = Names(GetParam())[2];
  std::filesystem::remove(folder / points);
  EXPECT_THAT(ReadError(folder.path()), HasSubstr(points + ": No such file"));
}

TEST_P(ColmapModel, FilesThatContradictEachOtherAreErrors) {
  const TempFolder folder;
  const auto expect_error = [&](const char* reason, auto change) {
    Reconstruction r = RandomReconstruction(3);
    change(r);
    const bool is_binary = GetParam() == ColmapModelFormat::kBinary;
    (is_binary ? WriteColmapBinary : WriteColmapText)(r, folder.path());
    EXPECT_THAT(ReadError(folder.path()), HasSubstr(reason));
  };
  expect_error("no error", [](Reconstruction&) {});
  expect_error("not there", [](Reconstruction& r) { r.points3D.erase(r.points3D.begin()); });
  expect_error("refers to a keypoint twice", [](Reconstruction& r) {
    std::vector<TrackElement>& track = r.points3D.begin()->second.track;
    track.push_back(track.front());
  });
  expect_error("does not refer back",
               [](Reconstruction& r) { r.points3D.begin()->second.track[0].image_id = 1000; });
  expect_error("does not refer back",
               [](Reconstruction& r) { r.points3D.begin()->second.track[0].point2D = 1000000; });
  expect_error("do not refer back",
               [](Reconstruction& r) { r.points3D.begin()->second.track.pop_back(); });
}

TEST_P(ColmapModel, ImagesOfOneNameAreAnError) {
  const TempFolder folder;
  Reconstruction r = RandomReconstruction(3);
  r.images.begin()->second.image.name = "first.jpg";
  r.images.rbegin()->second.image.name = "other.jpg";
  WriteColmapModel(r, folder.path(), GetParam());
  const std::string file =
      folder / (GetParam() == ColmapModelFormat::kBinary ? "images.bin" : "images.txt");
  std::string bytes = ReadFile(file);
  bytes.replace(bytes.find("other.jpg"), 5, "first");
  WriteFileAtomically(file, bytes);
  EXPECT_THAT(ReadError(folder.path()), HasSubstr("have one name, first.jpg"));
  r.images.rbegin()->second.image.name = "first.jpg";
  EXPECT_THROW(WriteColmapModel(r, folder / "a", GetParam()), IoError);
}

TEST_P(ColmapModel, BrokenReconstructionsAreNotWritten) {
  const TempFolder folder;
  Reconstruction r = RandomReconstruction(3);
  r.images.begin()->second.image.camera_id = 77;
  EXPECT_THROW(WriteColmapModel(r, folder / "a", GetParam()), IoError);
  r = RandomReconstruction(3);
  r.images.begin()->second.cam_from_world.translation[0] = std::nan("");
  EXPECT_THROW(WriteColmapModel(r, folder / "a", GetParam()), IoError);
  r = RandomReconstruction(3);
  r.images.begin()->second.cam_from_world.rotation.coeffs().setZero();
  EXPECT_THROW(WriteColmapModel(r, folder / "a", GetParam()), IoError);
  r = RandomReconstruction(3);
  r.points3D.begin()->second.xyz[1] = std::nan("");
  EXPECT_THROW(WriteColmapModel(r, folder / "a", GetParam()), IoError);
  r = RandomReconstruction(3);
  r.points3D.erase(r.points3D.begin());
  EXPECT_THROW(WriteColmapModel(r, folder / "a", GetParam()), IoError);
  r = RandomReconstruction(3);
  r.images.begin()->second.image.name = "two\nlines";
  EXPECT_THROW(WriteColmapModel(r, folder / "a", GetParam()), IoError);
  r = RandomReconstruction(3);
  r.images.begin()->second.points2D[0].x() = std::nan("");
  EXPECT_THROW(WriteColmapModel(r, folder / "a", GetParam()), IoError);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  // A file where the folder should be.
  WriteFileAtomically(folder / "file", "");
  EXPECT_THROW(WriteColmapModel(RandomReconstruction(3), folder / "file", GetParam()), IoError);
}

TEST(ColmapModelFiles, RigsOfTheReplacedModelGoOthersStay) {
  const TempFolder folder;
  for (const char* name : {"rigs.bin", "frames.bin", "rigs.txt", "notes.txt"}) {
    WriteFileAtomically(folder / name, "");
  }
  WriteColmapModel(RandomReconstruction(3), folder.path());
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    names.push_back(entry.path().filename().string());
  }
  EXPECT_THAT(names, UnorderedElementsAre("cameras.bin", "images.bin", "points3D.bin", "rigs.txt",
                                          "notes.txt"));
  // Beside a model that is read they change nothing.
  WriteFileAtomically(folder / "rigs.bin", "of COLMAP 4");
  WriteFileAtomically(folder / "frames.bin", "likewise");
  EXPECT_EQ(ReadColmapModel(folder.path()).images.size(), RandomReconstruction(3).images.size());
  EXPECT_TRUE(std::filesystem::exists(folder / "rigs.bin"));
}

TEST(ColmapBinary, LayoutByHand) {
  const TempFolder folder;
  Reconstruction r;
  r.cameras[3] = Camera::FromFocal(3, CameraModel::kSimplePinhole, 500, 640, 480);
  r.images[7].image = {7, "a.jpg", 3};
  r.images[7].cam_from_world =
      Rigid3d(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Eigen::Vector3d(1, 2, 3));
  WriteColmapModel(r, folder.path());
  const std::string cameras = ReadFile(folder / "cameras.bin");
  ASSERT_EQ(cameras.size(), 8u + 4 + 4 + 8 + 8 + 3 * 8);
  double focal;
  std::memcpy(&focal, &cameras[32], 8);
  EXPECT_EQ(focal, 500);
  const std::string images = ReadFile(folder / "images.bin");
  ASSERT_EQ(images.size(), 8u + 4 + 7 * 8 + 4 + 6 + 8);
  double pose[7];
  std::memcpy(pose, &images[12], sizeof(pose));
  EXPECT_THAT(pose, ElementsAre(0.5, -0.5, 0.5, -0.5, 1, 2, 3));
  EXPECT_EQ(images.substr(72, 6), std::string("a.jpg\0", 6));
}

TEST(ColmapBinary, NumbersThatAreNotFiniteAreNamed) {
  const TempFolder folder;
  WriteColmapModel(RandomReconstruction(3), folder.path());
  const auto expect_error = [&](const std::string& name, size_t offset, const char* reason) {
    const std::string bytes = ReadFile(folder / name);
    std::string changed = bytes;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::memcpy(&changed[offset], &nan, sizeof(nan));
    WriteFileAtomically(folder / name, changed);
    EXPECT_THAT(ReadError(folder.path()), HasSubstr(reason));
    WriteFileAtomically(folder / name, bytes);
  };
  const size_t name_size = RandomReconstruction(3).images.begin()->second.image.name.size() + 1;
  expect_error("images.bin", 8 + 4 + 7 * 8 + 4 + name_size + 8 + 8, "image 1 has a keypoint that");
  expect_error("points3D.bin", 8 + 8, "point 1 is not finite");
  expect_error("points3D.bin", 8 + 8 + 3 * 8 + 3, "point 1 is not finite");
}

TEST(ColmapBinary, UnknownCameraModelsAndTwoOfAKindAreNamed) {
  const TempFolder folder;
  WriteColmapModel(RandomReconstruction(3), folder.path());
  const std::string bytes = ReadFile(folder / "cameras.bin");
  std::string changed = bytes;
  changed[12] = 99;
  WriteFileAtomically(folder / "cameras.bin", changed);
  EXPECT_THAT(ReadError(folder.path()), HasSubstr("camera 1 has the model 99"));
  WriteFileAtomically(folder / "cameras.bin", bytes);
  std::string images = ReadFile(folder / "images.bin");
  images[8] = 2;  // the id of the second image
  WriteFileAtomically(folder / "images.bin", images);
  EXPECT_THAT(ReadError(folder.path()), HasSubstr("images.bin: image 2 appears twice"));
}

TEST(ColmapText, ErrorsNameTheLine) {
  const TempFolder folder;
  WriteColmapModel(RandomReconstruction(3), folder.path(), ColmapModelFormat::kText);
  const auto error_with = [&](const std::string& name, const std::string& text) {
    const std::string good = ReadFile(folder / name);
    WriteFileAtomically(folder / name, text);
    const std::string error = ReadError(folder.path());
    WriteFileAtomically(folder / name, good);
    return error;
  };
  EXPECT_THAT(error_with("cameras.txt", "# c\n\n1 CYLINDER 10 10 1 1 1\n"),
              HasSubstr("cameras.txt:3: 'CYLINDER' is none of"));
  EXPECT_THAT(error_with("cameras.txt", "1 PINHOLE 10 10 1 1 1\n"),
              HasSubstr("cameras.txt:1: the line is too short"));
  EXPECT_THAT(error_with("cameras.txt", "1 PINHOLE 10 10 1 1 1 1 1\n"),
              HasSubstr("cameras.txt:1: the line is too long"));
  EXPECT_THAT(error_with("cameras.txt", "1 PINHOLE 10 10 1 -1 1 1\n"),
              HasSubstr("cameras.txt:1: the focal length must be positive"));
  EXPECT_THAT(error_with("images.txt", "1 1 0 0 nan 0 0 0 1 a.jpg\n\n"),
              HasSubstr("images.txt:1: quaternion expected, not 'nan'"));
  EXPECT_THAT(error_with("images.txt", "1 0 0 0 0 0 0 0 1 a.jpg\n\n"),
              HasSubstr("images.txt:1: the quaternion is zero"));
  EXPECT_THAT(error_with("images.txt", "1 1 0 0 0 0 0 0 1\n\n"),
              HasSubstr("images.txt:1: the line is too short: the name"));
  EXPECT_THAT(error_with("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n1 2\n"),
              HasSubstr("images.txt:2: the line is too short: 3D point id"));
  EXPECT_THAT(error_with("points3D.txt", "1 0 0 0 256 0 0 1 1 0\n"),
              HasSubstr("points3D.txt:1: color 256 is not in"));
}

// Readers take the binary files, so that the text would never be seen.
TEST(ColmapText, IsNotWrittenBesideABinaryModel) {
  const TempFolder folder;
  WriteColmapModel(RandomReconstruction(3), folder.path(), ColmapModelFormat::kBinary);
  try {
    WriteColmapModel(RandomReconstruction(4), folder.path(), ColmapModelFormat::kText);
    ADD_FAILURE() << "not refused";
  } catch (const IoError& error) {
    EXPECT_EQ(error.path(), folder.path());
    EXPECT_THAT(error.reason(), HasSubstr("binary model"));
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "cameras.txt"));
}

TEST(ColmapResult, ReplacesItsOwnFilesAndNobodyElses) {
  const TempFolder folder;
  const std::string path = folder / "out";
  const auto write = [&](const ColmapResult& result, bool overwrites = false) {
    WriteColmapResult(RandomReconstruction(3), path, result, overwrites);
  };
  write({"export"});
  const ColmapResult text = {"export", ColmapModelFormat::kText, {{"a.json", "{}"}}};
  write(text);
  EXPECT_FALSE(std::filesystem::exists(path + "/cameras.bin"));
  EXPECT_EQ(ReadFile(path + "/a.json"), "{}");
  ExpectEqual(ReadColmapModel(path), RandomReconstruction(3));
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { write({"georegister"}, true); }),
              HasSubstr("holds the results of export"));
  // COLMAP 4 has been here.
  WriteFileAtomically(path + "/frames.bin", "another's");
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { write(text); }),
              HasSubstr("frames.bin is not as cairn wrote it"));
  write(text, true);
  EXPECT_FALSE(std::filesystem::exists(path + "/frames.bin"));
}

TEST(ColmapText, QuaternionsAreNormalizedAndCarriageReturnsIgnored) {
  const TempFolder folder;
  WriteFileAtomically(folder / "cameras.txt", "1 SIMPLE_PINHOLE 10 10 5 5 5\r\n");
  WriteFileAtomically(folder / "images.txt", "4 2 0 0 0 1 2 3 1 a b.jpg\r\n\r\n");
  WriteFileAtomically(folder / "points3D.txt", "");
  const Reconstruction r = ReadColmapModel(folder.path());
  EXPECT_EQ(r.images.at(4).image.name, "a b.jpg");
  EXPECT_EQ(r.images.at(4).cam_from_world.rotation.w(), 1.0);
}

}  // namespace
}  // namespace cairn
