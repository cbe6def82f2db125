#include "cairn/mapper/view_edges.h"

#include "cairn/base/rng.h"
#include "cairn/geometry/epipolar.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

// Two images with exact matches, and the geometry that COLMAP 3.8 would store: E, no pose.
class ViewEdgesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, 800, 1000, 800);
    database_.WriteCamera(camera);
    Rng rng(1);
    std::vector<Keypoint> keypoints[2];
    for (point2D_t i = 0; i < 40; ++i) {
      const Eigen::Vector3d x1 = UniformVector({{-1, 1}, {-1, 1}, {4, 6}}, rng);
      const Eigen::Vector3d x2 = pose_ * x1;
      const Eigen::Vector2d p1 = camera.ImgFromCam(x1.hnormalized());
      const Eigen::Vector2d p2 = camera.ImgFromCam(x2.hnormalized());
      keypoints[0].push_back({static_cast<float>(p1.x()), static_cast<float>(p1.y())});
      keypoints[1].push_back({static_cast<float>(p2.x()), static_cast<float>(p2.y())});
      geometry_.inlier_matches.push_back({i, i});
    }
    for (image_t id = 1; id <= 2; ++id) {
      database_.WriteImage({id, std::to_string(id), 1});
      database_.WriteKeypoints(id, keypoints[id - 1]);
    }
    geometry_.config = TwoViewConfig::kCalibrated;
    geometry_.E = EssentialFromPose(pose_);
  }
  ViewEdge OnlyEdge() {
    database_.WriteTwoViewGeometry(ImagePairToPairId(1, 2), geometry_);
    const std::vector<ViewEdge> edges = ReadViewEdges(database_);
    EXPECT_EQ(edges.size(), 1u);
    return edges.at(0);
  }

  const Rigid3d pose_{Eigen::Quaterniond(0.98, 0.1, -0.1, 0.05).normalized(),
                      Eigen::Vector3d(0.6, 0.1, -0.2).normalized()};
  TwoViewGeometry geometry_;
  Database database_{":memory:"};
};

TEST_F(ViewEdgesTest, AStoredPoseIsTaken) {
  geometry_.cam2_from_cam1 = pose_;
  PairMetrics metrics;
  metrics.pair_id = ImagePairToPairId(1, 2);
  metrics.verifier = "both";
  metrics.step = "five_point";
  metrics.is_winner = true;
  metrics.residual_px = 0.25;
  metrics.triangulation_angle_deg = 7;
  database_.WritePairMetrics(metrics);
  const ViewEdge edge = OnlyEdge();
  EXPECT_EQ(edge.removal, EdgeRemoval::kNone);
  EXPECT_EQ(edge.num_inliers, 40);
  EXPECT_EQ(edge.verifier, "five_point");
  EXPECT_EQ(edge.residual_px, 0.25);
  EXPECT_EQ(edge.triangulation_angle_deg, 7);
  EXPECT_LT(edge.cam2_from_cam1.rotation.angularDistance(pose_.rotation), 1e-12);
}

TEST_F(ViewEdgesTest, ItIsStatedWhoDeterminedAnEdge) {
  EXPECT_EQ(OnlyEdge().source, EdgeSource::kOtherProgram);
  PairMetrics metrics;
  metrics.pair_id = ImagePairToPairId(1, 2);
  metrics.verifier = "five_point";
  database_.WritePairMetrics(metrics);  // without success: the row is not its result
  EXPECT_EQ(OnlyEdge().source, EdgeSource::kOtherProgram);
  metrics.is_winner = true;
  database_.WritePairMetrics(metrics);
  EXPECT_EQ(OnlyEdge().source, EdgeSource::kVerified);
  metrics.verifier = "imported";
  database_.WritePairMetrics(metrics);
  EXPECT_EQ(OnlyEdge().source, EdgeSource::kDataset);
}

TEST_F(ViewEdgesTest, APoseIsFoundFromTheEssentialMatrix) {
  const ViewEdge edge = OnlyEdge();
  EXPECT_EQ(edge.removal, EdgeRemoval::kNone);
  EXPECT_LT(edge.cam2_from_cam1.rotation.angularDistance(pose_.rotation), 1e-9);
  EXPECT_LT((edge.cam2_from_cam1.translation - pose_.translation).norm(), 1e-9);
}

TEST_F(ViewEdgesTest, APoseIsFoundFromTheFundamentalMatrix) {
  const Eigen::Matrix3d K = database_.ReadCameras()[0].CalibrationMatrix();
  geometry_.F = FundamentalFromEssential(*geometry_.E, K, K);
  geometry_.E.reset();
  geometry_.config = TwoViewConfig::kUncalibrated;
  const ViewEdge edge = OnlyEdge();
  EXPECT_LT(edge.cam2_from_cam1.rotation.angularDistance(pose_.rotation), 1e-9);
}

TEST_F(ViewEdgesTest, PairsWithoutATranslationAreMarked) {
  geometry_.cam2_from_cam1 = pose_;
  for (const TwoViewConfig config :
       {TwoViewConfig::kWatermark, TwoViewConfig::kMultiple, TwoViewConfig::kDegenerate}) {
    geometry_.config = config;
    EXPECT_EQ(OnlyEdge().removal, EdgeRemoval::kNoPose);
  }
  geometry_.config = TwoViewConfig::kCalibrated;
  geometry_.cam2_from_cam1.reset();
  geometry_.E.reset();
  EXPECT_EQ(OnlyEdge().removal, EdgeRemoval::kNoPose);
}

// A camera that turned without moving still tells by how much.
TEST_F(ViewEdgesTest, PanoramicPairsHaveARotationAlone) {
  geometry_.config = TwoViewConfig::kPanoramic;
  geometry_.cam2_from_cam1 = pose_;
  const ViewEdge edge = OnlyEdge();
  EXPECT_TRUE(edge.IsActive());
  EXPECT_FALSE(edge.HasTranslation());
  EXPECT_LT(edge.cam2_from_cam1.rotation.angularDistance(pose_.rotation), 1e-12);
  // Nor moved: what stands still before the camera.
  geometry_.cam2_from_cam1 = Rigid3d();
  EXPECT_EQ(OnlyEdge().removal, EdgeRemoval::kNoPose);
  geometry_.cam2_from_cam1.reset();
  EXPECT_EQ(OnlyEdge().removal, EdgeRemoval::kNoPose);
}

TEST_F(ViewEdgesTest, RowsOfRejectedPairsAreNoEdges) {
  database_.WriteTwoViewGeometry(ImagePairToPairId(1, 2), {});
  EXPECT_TRUE(ReadViewEdges(database_).empty());
}

}  // namespace
}  // namespace cairn
