#include "cairn/io/bundler.h"

#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/io/model.h"
#include "random_reconstruction.h"
#include "support/check_consistency.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

std::string ErrorOf(const std::string& bundle, const std::string& list) {
  return ThrownMessage<IoError>([&] { ReadBundler(bundle, list); });
}

// The camera of Bundler's manual: P = RX + t, p = -P/P.z, p' = f (1 + k1 p^2 + k2 p^4) p.
Eigen::Vector2d BundlerProjection(const double* f_k1_k2, const Eigen::Matrix3d& R,
                                  const Eigen::Vector3d& t, const Eigen::Vector3d& X) {
  const Eigen::Vector3d P = R * X + t;
  const Eigen::Vector2d p = -P.head<2>() / P.z();
  const double r2 = p.squaredNorm();
  return f_k1_k2[0] * (1 + f_k1_k2[1] * r2 + f_k1_k2[2] * r2 * r2) * p;
}

TEST(Bundler, WrittenFileProjectsByBundlersOwnFormula) {
  const TempFolder folder;
  const Reconstruction r =
      RandomReconstruction(1, {.all_camera_models = false, .pixel_noise = 0.0});
  EXPECT_THAT(WriteBundler(r, folder / "bundle.out", folder / "list.txt"),
              ElementsAre(HasSubstr("6 image names contain blanks")));
  // Read by its definition, word by word.
  std::istringstream in(ReadFile(folder / "bundle.out"));
  std::string comment;
  std::getline(in, comment);
  EXPECT_EQ(comment, "# Bundle file v0.3");
  size_t num_cameras, num_points;
  in >> num_cameras >> num_points;
  ASSERT_EQ(num_cameras, r.images.size());
  ASSERT_EQ(num_points, r.points3D.size());
  struct BundlerCamera {
    double f_k1_k2[3];
    Eigen::Matrix3d R;
    Eigen::Vector3d t;
  };
  std::vector<BundlerCamera> cameras(num_cameras);
  for (BundlerCamera& camera : cameras) {
    for (double& value : camera.f_k1_k2) in >> value;
    for (int i = 0; i < 9; ++i) in >> camera.R(i / 3, i % 3);
    for (int i = 0; i < 3; ++i) in >> camera.t[i];
    EXPECT_NEAR(camera.R.determinant(), 1.0, 1e-12);
  }
  size_t num_views_checked = 0;
  for (size_t i = 0; i < num_points; ++i) {
    Eigen::Vector3d X;
    int color, num_views;
    in >> X[0] >> X[1] >> X[2] >> color >> color >> color >> num_views;
    for (int v = 0; v < num_views; ++v, ++num_views_checked) {
      size_t camera, key;
      Eigen::Vector2d pixel;
      in >> camera >> key >> pixel[0] >> pixel[1];
      const BundlerCamera& c = cameras.at(camera);
      EXPECT_LT((BundlerProjection(c.f_k1_k2, c.R, c.t, X) - pixel).norm(), 1e-8);
      // Half the image's size, y upward.
      const Eigen::Vector2d ours = r.images.at(static_cast<image_t>(camera + 1)).points2D.at(key);
      EXPECT_LT((ours - Eigen::Vector2d(400 + pixel[0], 300 - pixel[1])).norm(), 1e-9);
    }
  }
  EXPECT_TRUE(in.good());
  EXPECT_EQ(num_views_checked, static_cast<size_t>(r.NumObservations()));
}

TEST(Bundler, ComesBack) {
  const TempFolder folder;
  const Reconstruction r = RandomReconstruction(2, {.all_camera_models = false});
  WriteBundler(r, folder / "bundle.out", folder / "list.txt");
  const Reconstruction read = ReadModel(folder / "bundle.out");
  CheckConsistency(read);
  ASSERT_EQ(read.images.size(), r.images.size());
  for (const auto& [id, image] : r.images) {
    const RegisteredImage& other = read.images.at(id);
    EXPECT_EQ(other.image.name, image.image.name);
    EXPECT_LT(AngleBetween(other.cam_from_world.rotation, image.cam_from_world.rotation), 1e-12);
    EXPECT_LT((other.cam_from_world.Center() - image.cam_from_world.Center()).norm(), 1e-12);
    EXPECT_EQ(read.CameraOf(other).MeanFocal(), r.CameraOf(image).MeanFocal());
  }
  ASSERT_EQ(read.points3D.size(), r.points3D.size());
  for (const auto& [id, point] : r.points3D) EXPECT_EQ(read.points3D.at(id).color, point.color);
  EXPECT_EQ(read.NumObservations(), r.NumObservations());
  EXPECT_NEAR(read.MeanReprojectionErrorPx(), r.MeanReprojectionErrorPx(), 1e-9);
}

TEST(Bundler, BytesAreEqualFromTheFirstReadingOn) {
  const TempFolder folder;
  // The first reading renumbers keypoints (those without a point are not in the file).
  Reconstruction r = RandomReconstruction(2, {.all_camera_models = false});
  for (auto& [id, image] : r.images) {  // rotations that a matrix holds exactly
    image.cam_from_world.rotation = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
  }
  WriteBundler(r, folder / "0.out", folder / "list.txt");
  const Reconstruction first = ReadBundler(folder / "0.out", folder / "list.txt");
  WriteBundler(first, folder / "1.out", folder / "list1.txt");
  const Reconstruction second = ReadBundler(folder / "1.out", folder / "list1.txt");
  WriteBundler(second, folder / "2.out", folder / "list2.txt");
  EXPECT_EQ(ReadFile(folder / "1.out"), ReadFile(folder / "2.out"));
  EXPECT_EQ(ReadFile(folder / "list1.txt"), ReadFile(folder / "list2.txt"));
}

TEST(Bundler, ImagesThatAreNotRegisteredAreZeros) {
  const TempFolder folder;
  Reconstruction r = RandomReconstruction(2, {.num_images = 3, .num_points = 0});
  const std::vector<Image> all = {
      {9, "z.jpg", 1}, r.images[2].image, r.images[1].image, {8, "y.jpg", 1}, r.images[3].image};
  WriteBundler(r, folder / "bundle.out", folder / "list.txt", all);
  EXPECT_EQ(ReadFile(folder / "list.txt"),
            "z.jpg\nfolder/image 2.jpg\nfolder/image 1.jpg\ny.jpg\nfolder/image 3.jpg\n");
  EXPECT_THAT(ReadFile(folder / "bundle.out"),
              HasSubstr("\n5 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n"));
  const Reconstruction read = ReadBundler(folder / "bundle.out", folder / "list.txt");
  ASSERT_EQ(read.images.size(), 3u);
  EXPECT_EQ(read.images.at(2).image.name, "folder/image 2.jpg");
  EXPECT_EQ(read.images.at(3).image.name, "folder/image 1.jpg");
  EXPECT_EQ(read.images.at(5).image.name, "folder/image 3.jpg");
  EXPECT_THROW(WriteBundler(r, folder / "b.out", folder / "l.txt", {all[0]}), BugError);
}

TEST(Bundler, WhatDoesNotFitIsSaid) {
  const TempFolder folder;
  const auto warnings = [&](CameraModel model, auto change) {
    Reconstruction r;
    r.cameras[1] = Camera::FromFocal(1, model, 500, 640, 480);
    change(r.cameras[1].params);
    r.images[1].image = {1, "a.jpg", 1};
    return WriteBundler(r, folder / "bundle.out", folder / "list.txt");
  };
  EXPECT_THAT(warnings(CameraModel::kSimplePinhole, [](auto&) {}), IsEmpty());
  EXPECT_THAT(warnings(CameraModel::kRadial, [](auto& p) { p[3] = 0.1; }), IsEmpty());
  EXPECT_THAT(warnings(CameraModel::kPinhole, [](auto& p) { p[1] = 510; }),
              ElementsAre(HasSubstr("1 of 1 cameras have a difference between fx and fy of up to "
                                    "1.98 %: their mean is written")));
  EXPECT_THAT(warnings(CameraModel::kSimpleRadial, [](auto& p) { p[1] += 3; }),
              ElementsAre(HasSubstr("principal point and image center of up to 3 px")));
  EXPECT_THAT(warnings(CameraModel::kOpenCV, [](auto& p) { p[7] = -0.01; }),
              ElementsAre(HasSubstr("tangential distortion of up to 0.01: it is left out")));
  EXPECT_THAT(warnings(CameraModel::kOpenCVFisheye, [](auto& p) { p[4] = 0.1; }),
              ElementsAre(HasSubstr("1 of 1 cameras are of the model OPENCV_FISHEYE, which the "
                                    "format does not have")));
  EXPECT_THAT(warnings(CameraModel::kFullOpenCV, [](auto&) {}),
              ElementsAre(HasSubstr("FULL_OPENCV: the nearest two radial coefficients")));
}

TEST(Bundler, ARationalLensIsWrittenAsTheNearestOfTwoCoefficients) {
  const TempFolder folder;
  Reconstruction r;
  r.cameras[1] = Camera::FromFocal(1, CameraModel::kFullOpenCV, 500, 640, 480);
  auto& params = r.cameras[1].params;
  // (1 + 8 r^2 + 0.8 r^4 - 0.4 r^6) / (1 + 8.1 r^2)
  params[4] = 8.0, params[5] = 0.8, params[8] = -0.4, params[9] = 8.1;
  r.images[1].image = {1, "a.jpg", 1};
  WriteBundler(r, folder / "bundle.out", folder / "list.txt");
  const Reconstruction read = ReadBundler(folder / "bundle.out", folder / "list.txt");
  const Camera& nearest = read.CameraOf(read.images.begin()->second);
  for (const double x : {0.1, 0.3, 0.5, 0.7}) {
    const Eigen::Vector2d ray(x, 0.5 * x);
    const Eigen::Vector2d pixel = r.cameras[1].ImgFromCam(ray) - r.cameras[1].PrincipalPoint();
    const Eigen::Vector2d written = nearest.ImgFromCam(ray) - nearest.PrincipalPoint();
    EXPECT_LT((pixel - written).norm(), 1.5) << x;
  }
}

TEST(BundlerList, NamesAndFocalLengths) {
  const TempFolder folder;
  WriteFileAtomically(folder / "list.txt",
                      "images/a.jpg 0 1234.5\r\nb.jpg\nc d 0 7.jpg\ne 0 f.jpg 0 10\ng.jpg 0 0\n\n");
  const std::vector<BundlerListEntry> list = ReadBundlerList(folder / "list.txt");
  ASSERT_EQ(list.size(), 5u);
  EXPECT_EQ(list[0].name, "images/a.jpg");
  EXPECT_EQ(list[0].focal_px, 1234.5);
  EXPECT_EQ(list[1].name, "b.jpg");
  EXPECT_FALSE(list[1].focal_px);
  EXPECT_EQ(list[2].name, "c d 0 7.jpg");
  EXPECT_EQ(list[3].name, "e 0 f.jpg");
  EXPECT_EQ(list[3].focal_px, 10);
  EXPECT_EQ(list[4].name, "g.jpg");
  EXPECT_FALSE(list[4].focal_px);
  WriteFileAtomically(folder / "gap.txt", "a.jpg\n\nb.jpg\n");
  EXPECT_THAT(ThrownMessage<IoError>([&] { ReadBundlerList(folder / "gap.txt"); }),
              HasSubstr("gap.txt:3: an image follows after an empty line"));
}

constexpr char kOneCamera[] = "500 0 0\n1 0 0\n0 1 0\n0 0 1\n1 2 3\n";

TEST(Bundler, ReferencesWithoutPixelsKeepTheirPoints) {
  const TempFolder folder;
  WriteFileAtomically(folder / "list.txt", "images/a.jpg 0 700\n");
  WriteFileAtomically(folder / "b.out", std::string("# Bundle file v0.3\n1 1\n") + kOneCamera +
                                            "1 2 3\n10 20 30\n2 0 17 0 18\n");
  const Reconstruction r = ReadBundler(folder / "b.out", folder / "list.txt");
  ASSERT_EQ(r.points3D.size(), 1u);
  EXPECT_EQ(r.points3D.at(1).color[2], 30);
  EXPECT_TRUE(r.points3D.at(1).track.empty());
  // R = I in Bundler's frame: the camera looks along the world's -z, and y is up.
  EXPECT_LT((r.images.at(1).cam_from_world.Center() - Eigen::Vector3d(-1, -2, -3)).norm(), 1e-12);
  EXPECT_LT((r.images.at(1).cam_from_world.RotationMatrix() * Eigen::Vector3d(0, 0, -1) -
             Eigen::Vector3d(0, 0, 1))
                .norm(),
            1e-12);
}

TEST(Bundler, BrokenFilesAreNamedWithTheLine) {
  const TempFolder folder;
  WriteFileAtomically(folder / "list.txt", "a.jpg\n");
  const auto error = [&](const std::string& text) {
    WriteFileAtomically(folder / "b.out", text);
    return ErrorOf(folder / "b.out", folder / "list.txt");
  };
  const std::string camera = kOneCamera;
  EXPECT_EQ(error("1 1\n" + camera + "1 2 3\n1 2 3\n1 0 4 5.5 6\n"), "no error");
  EXPECT_THAT(error(""), HasSubstr("b.out:0: the file ends before the number of cameras"));
  EXPECT_THAT(error("2 0\n"), HasSubstr("b.out:1: 2 cameras, but "));
  EXPECT_THAT(error("1 0\n500 0 0\n1 0\n"), HasSubstr("b.out:3: the file ends before rotation"));
  EXPECT_THAT(error("1 0\n500 0 0\n1 0 0\n0 1 0\n0 0 -1\n0 0 0\n"),
              HasSubstr("b.out:6: the camera's matrix is not a rotation"));
  EXPECT_THAT(error("1 1\n" + camera + "1 2 3\n1 2 3\n1 0 4 5.5\n"),
              HasSubstr("b.out:9: a view list of 1 views has 3 numbers"));
  EXPECT_THAT(error("1 1\n" + camera + "1 2 3\n1 2 3\n1 1 4 5.5 6\n"),
              HasSubstr("b.out:9: camera 1 is not in [0, 0]"));
  EXPECT_THAT(error("1 2\n" + camera + "1 2 3\n1 2 3\n1 0 4 5.5 6\n"),
              HasSubstr("b.out:9: the file ends before point"));
  EXPECT_THAT(error("1 1\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n1 2 3\n1 2 3\n1 0 4 5.5 6\n"),
              HasSubstr("b.out:9: the point is seen by camera 0, which is not registered"));
  EXPECT_THAT(ErrorOf(folder / "absent.out", folder / "list.txt"),
              HasSubstr("absent.out: No such"));
  EXPECT_THAT(ErrorOf(folder / "b.out", folder / "absent.txt"), HasSubstr("absent.txt: No such"));
  // Without points, what is wrong with them does not matter.
  error("1 99\n" + camera + "nonsense\n");
  EXPECT_EQ(ReadModel(folder / "b.out", {.read_points = false}).images.size(), 1u);
}

TEST(Bundler, EveryPrefixIsReadOrRefused) {
  const TempFolder folder;
  const Reconstruction r =
      RandomReconstruction(2, {.num_images = 3, .num_points = 4, .all_camera_models = false});
  WriteBundler(r, folder / "bundle.out", folder / "list.txt");
  const std::string text = ReadFile(folder / "bundle.out");
  const size_t last_line = text.rfind('\n', text.size() - 2);
  for (size_t size = 0; size < last_line; size += 7) {
    WriteFileAtomically(folder / "cut.out", std::string_view(text).substr(0, size));
    EXPECT_THROW(ReadBundler(folder / "cut.out", folder / "list.txt"), IoError) << size;
  }
}

}  // namespace
}  // namespace cairn
