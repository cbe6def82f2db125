#include "cairn/io/strecha.h"

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/io/model.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

// Camera to world: x right = world y, y down = world -z, z forward = world -x... as columns.
constexpr char kCamera[] =
    "2759.48 0 1520.69\n0 2764.16 1006.81\n0 0 1\n0 0 0\n"
    "0 0 -1\n1 0 0\n0 -1 0\n10 20 30\n3072 2048\n";

TEST(Strecha, FrameAndPixelConvention) {
  const TempFolder folder;
  WriteFileAtomically(folder / "b.png.camera", kCamera);
  WriteFileAtomically(folder / "a.png.camera", kCamera);
  WriteFileAtomically(folder / "notes.txt", "");
  EXPECT_TRUE(IsStrechaFolder(folder.path()));
  const Reconstruction r = ReadModel(folder.path());
  ASSERT_EQ(r.images.size(), 2u);
  EXPECT_EQ(r.images.at(1).image.name, "a.png");
  EXPECT_EQ(r.images.at(2).image.name, "b.png");
  const Rigid3d& pose = r.images.at(1).cam_from_world;
  EXPECT_LT((pose.Center() - Eigen::Vector3d(10, 20, 30)).norm(), 1e-12);
  // One unit along the optical axis from the center: world (-1, 0, 0).
  EXPECT_LT((pose * Eigen::Vector3d(9, 20, 30) - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  const Camera& camera = r.cameras.at(1);
  EXPECT_EQ(camera.model, CameraModel::kPinhole);
  EXPECT_EQ(camera.width, 3072);
  EXPECT_EQ(camera.height, 2048);
  EXPECT_THAT(camera.params, ElementsAre(2759.48, 2764.16, 1521.19, 1007.31));
}

TEST(Strecha, BrokenFilesAreNamed) {
  const TempFolder folder;
  EXPECT_FALSE(IsStrechaFolder(folder.path()));
  EXPECT_FALSE(IsStrechaFolder(folder / "absent"));
  EXPECT_THROW(ReadStrecha(folder.path()), IoError);
  EXPECT_THROW(ReadStrecha(folder / "absent"), IoError);
  const auto error = [&](const std::string& text) -> std::string {
    WriteFileAtomically(folder / "a.camera", text);
    return ThrownMessage<IoError>([&] { ReadStrecha(folder.path()); });
  };
  const std::string good = kCamera;
  EXPECT_EQ(error(good), "no error");
  EXPECT_THAT(error(good.substr(0, 60)), HasSubstr("a.camera:6: the file ends before rotation"));
  EXPECT_THAT(error(""), HasSubstr("the file ends before calibration matrix"));
  std::string changed = good;
  changed.replace(changed.find("0 0 -1"), 6, "0 0 +1");
  EXPECT_THAT(error(changed), HasSubstr("its matrix is not a rotation"));
  changed = good;
  changed.replace(changed.find("2759.48"), 7, "-759.48");
  EXPECT_THAT(error(changed), HasSubstr("the focal length must be positive"));
  changed = good;
  changed.replace(changed.find("3072"), 4, "1e30");
  EXPECT_THAT(error(changed), HasSubstr("width and height must be positive"));
}

}  // namespace
}  // namespace cairn
