#include <filesystem>

#include "cairn/base/file.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/model.h"
#include "cairn/io/one_dsfm.h"
#include "support/check_consistency.h"
#include "support/shared_data.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

#define SKIP_WITHOUT(path) \
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is absent"

TEST(IoData, MadridMetropolis) {
  const std::string folder = SharedDataPath("1dsfm/Madrid_Metropolis");
  SKIP_WITHOUT(folder);
  const OneDsfmDataset dataset = ReadOneDsfmDataset(folder);
  EXPECT_EQ(dataset.component.size(), 394u);
  EXPECT_EQ(dataset.edges.size(), 23784u);
  EXPECT_FALSE(dataset.has_photographs);
  EXPECT_EQ(dataset.images.at(0).name, "images/1022056833_b0bcddb09e_o.jpg");
  EXPECT_NEAR(dataset.images.at(0).focal_px.value(), 2113.71237, 1e-9);
  for (const OneDsfmEdge& edge : dataset.edges) {
    EXPECT_NEAR(edge.cam_j_from_cam_i.translation.norm(), 1.0, 1e-12);
  }
}

TEST(IoData, LundDoorIsConsistentAndItsPointsProject) {
  const std::string folder = SharedDataPath("lund_door/gt");
  SKIP_WITHOUT(folder);
  const Reconstruction r = ReadColmapModel(folder);
  EXPECT_EQ(r.images.size(), 12u);
  EXPECT_EQ(r.points3D.size(), 11384u);
  CheckConsistency(r);
  double stored = 0;
  for (const auto& [id, point] : r.points3D) stored += point.error_px;
  EXPECT_NEAR(r.MeanReprojectionErrorPx(), stored / static_cast<double>(r.points3D.size()), 0.05);
}

TEST(IoData, ModelsWithoutPoints) {
  for (const char* name : {"reichstag", "temple_ring"}) {
    const std::string folder = SharedDataPath(std::string(name) + "/gt");
    SKIP_WITHOUT(folder);
    const Reconstruction r = ReadModel(folder);
    EXPECT_EQ(r.images.size(), name[0] == 'r' ? 10u : 19u);
    EXPECT_TRUE(r.points3D.empty());
  }
}

// Camera centers of fountain-P11 lie in front of the fountain, a few meters apart; K is that of the
// half-size photographs, twice as large.
TEST(IoData, FountainsCameras) {
  const std::string folder = SharedDataPath("strecha/fountain-P11/gt");
  SKIP_WITHOUT(folder);
  const Reconstruction r = ReadModel(folder);
  ASSERT_EQ(r.images.size(), 11u);
  EXPECT_EQ(r.images.at(1).image.name, "0000.jpg");
  EXPECT_EQ(r.cameras.at(1).width, 3072);
  // The intrinsics given for the photographs at half size: 1379.74 1382.08 760.595 503.655.
  EXPECT_NEAR(r.cameras.at(1).FocalX() / 2, 1379.74, 0.01);
  EXPECT_NEAR(r.cameras.at(1).PrincipalPoint().x() / 2, 760.595, 0.01);
  EXPECT_NEAR(r.cameras.at(1).PrincipalPoint().y() / 2, 503.655, 0.01);
}

}  // namespace
}  // namespace cairn
