// Pairs that several poses explain, and what global rotations make of them.
#include "cairn/base/rng.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "mapper/stages.h"
#include "math/random_vectors.h"
#include "support/test.h"

namespace cairn {
namespace {

enum class Motion { kAround, kTurn };

// Two images of a cloud of points as deep as it is wide, `focal_px` away in units of its size. The
// camera goes around the cloud, or turns where it is.
struct TwoImages {
  TwoImages(double focal_px, double noise_px, uint64_t seed, Motion motion = Motion::kAround) {
    Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, focal_px, 640, 480);
    scene.cameras[1] = camera;
    Rng rng(seed);
    const double distance = focal_px / 400;
    const Eigen::Quaterniond turn = ExpSO3({0.03, 0.2, -0.05});
    const Eigen::Vector3d middle(0, 0, distance);
    truth = Rigid3d(turn, Eigen::Vector3d(middle - turn * middle));
    if (motion == Motion::kTurn) truth.translation.setZero();
    FeatureMatches& matches = scene.matches[ImagePairToPairId(1, 2)];
    for (point2D_t i = 0; i < 150; ++i) {
      const Eigen::Vector3d x = middle + 0.5 * UniformVector({{-1, 1}, {-1, 1}, {-1, 1}}, rng);
      const auto pixel = [&](const Eigen::Vector3d& point) {
        return Eigen::Vector2d(camera.ImgFromCam(point.hnormalized()) +
                               noise_px * GaussianVector<2>(rng));
      };
      scene.pixels[1].push_back(pixel(x));
      scene.pixels[2].push_back(pixel(truth * x));
      matches.push_back({i, i});
    }
    for (image_t id = 1; id <= 2; ++id) scene.images[id] = {id, std::to_string(id) + ".jpg", 1};
    ViewEdge edge;
    edge.image_id1 = 1;
    edge.image_id2 = 2;
    edge.cam2_from_cam1 = truth;
    edge.cam2_from_cam1.translation.normalize();
    edge.num_inliers = 150;
    edge.residual_px = 0.6745 * noise_px;
    graph.image_ids = {1, 2};
    graph.edges = {edge};
    scene.edges = {edge};
  }

  double ErrorDeg() const {
    return RadToDeg(AngleBetween(graph.edges[0].cam2_from_cam1.rotation, truth.rotation));
  }
  // Depths mirrored.
  Eigen::Quaterniond Reversed() const {
    const Eigen::Vector3d flip(1, 1, -1);
    return Eigen::Quaterniond(
        Eigen::Matrix3d(flip.asDiagonal() * truth.rotation.toRotationMatrix() * flip.asDiagonal()));
  }

  std::map<image_t, Eigen::Quaterniond> TrueRotations() const {
    return {{1, Eigen::Quaterniond::Identity()}, {2, truth.rotation}};
  }

  SceneData scene;
  Rigid3d truth;
  ViewGraph graph;
  ReconstructSettings settings;
  RunReport report;
  StageContext context{scene, settings, {.num_threads = 1}, report};
};

TEST(RefitEdges, TakesThePoseThatFitsTheRotationsWhereItExplainsTheMatches) {
  TwoImages pair(3000, 0.2, 1);
  pair.graph.edges[0].cam2_from_cam1.rotation = pair.Reversed();
  pair.graph.edges[0].removal = EdgeRemoval::kTripletInconsistent;
  EXPECT_EQ(RefitEdges(pair.context, pair.TrueRotations(), 5, pair.graph), 1);
  EXPECT_TRUE(pair.graph.edges[0].IsActive());
  EXPECT_LT(pair.ErrorDeg(), 1.0);
  const Eigen::Vector3d& t = pair.graph.edges[0].cam2_from_cam1.translation;
  EXPECT_LT(RadToDeg(AngleBetween(t, pair.truth.translation)), 3.0);
}

TEST(RefitEdges, LeavesWhatNoSuchPoseExplains) {
  TwoImages pair(800, 0.3, 1);
  const Eigen::Quaterniond wrong = ExpSO3({0, 0, 0.5}) * pair.truth.rotation;
  EXPECT_EQ(
      RefitEdges(pair.context, {{1, Eigen::Quaterniond::Identity()}, {2, wrong}}, 5, pair.graph),
      0);
  EXPECT_EQ(pair.ErrorDeg(), 0);
}

// What ImproveRelativePoses makes of the pair, if this is stored of it.
ViewEdge Improved(TwoImages pair, const TwoViewGeometry& stored) {
  ImproveRelativePoses({{ImagePairToPairId(1, 2), stored}}, {.num_threads = 1}, pair.scene);
  return pair.scene.edges[0];
}
double RotationErrorDeg(const ViewEdge& edge, const TwoImages& pair) {
  return RadToDeg(AngleBetween(edge.cam2_from_cam1.rotation, pair.truth.rotation));
}
double DirectionErrorDeg(const ViewEdge& edge, const TwoImages& pair) {
  return RadToDeg(AngleBetween(edge.cam2_from_cam1.translation, pair.truth.translation));
}

TEST(ImproveRelativePoses, RefinesAStoredPoseAndTurnsItsDirection) {
  for (const double sign : {1.0, -1.0}) {
    TwoImages pair(800, 0.3, 1);
    ViewEdge& edge = pair.scene.edges[0];
    edge.cam2_from_cam1.rotation = ExpSO3({0.03, -0.03, 0.02}) * pair.truth.rotation;
    edge.cam2_from_cam1.translation *= sign;  // its epipolar errors are the same
    ASSERT_GT(RotationErrorDeg(edge, pair), 2.0);
    edge = Improved(pair, {});
    EXPECT_TRUE(edge.IsActive());
    EXPECT_LT(RotationErrorDeg(edge, pair), 0.3);
    EXPECT_LT(DirectionErrorDeg(edge, pair), 1.5);
    EXPECT_NEAR(edge.residual_px, 0.6745 * 0.3, 0.06);
    EXPECT_GT(edge.triangulation_angle_deg, 5.0);
    EXPECT_LT(edge.triangulation_angle_deg, 20.0);
  }
}

TEST(ImproveRelativePoses, FindsAPoseFromEachMatrix) {
  TwoImages pair(800, 0.3, 2);
  pair.scene.edges[0].removal = EdgeRemoval::kNoPose;
  pair.scene.edges[0].cam2_from_cam1 = Rigid3d();
  const Eigen::Matrix3d K = pair.scene.cameras.at(1).CalibrationMatrix();
  const Eigen::Matrix3d E = EssentialFromPose(pair.truth);
  // Of a plane through the cloud, n x = 2 in the first camera; it has two poses.
  const Eigen::Vector3d normal(-0.3, 0.2, 1.0);
  const Eigen::Matrix3d H =
      K * (pair.truth.RotationMatrix() + pair.truth.translation * normal.transpose() / 2) *
      K.inverse();
  TwoViewGeometry with_E, with_F, with_H;
  with_E.E = 3.0 * E;
  with_F.F = FundamentalFromEssential(E, K, K);
  with_H.H = -2.0 * H;
  for (const TwoViewGeometry& stored : {with_E, with_F, with_H}) {
    const ViewEdge edge = Improved(pair, stored);
    EXPECT_TRUE(edge.IsActive());
    EXPECT_LT(RotationErrorDeg(edge, pair), 0.3);
    EXPECT_LT(DirectionErrorDeg(edge, pair), 1.5);
  }
}

TEST(ImproveRelativePoses, LeavesARotationAloneWhereNothingShowsParallax) {
  TwoImages pair(800, 0.3, 3, Motion::kTurn);
  pair.scene.edges[0].cam2_from_cam1 =
      Rigid3d(ExpSO3({0.01, 0.02, 0}) * pair.truth.rotation, Eigen::Vector3d::UnitX());
  const ViewEdge edge = Improved(pair, {});
  EXPECT_TRUE(edge.IsActive());
  EXPECT_FALSE(edge.HasTranslation());
  EXPECT_LT(RotationErrorDeg(edge, pair), 0.5);
}

// The noise of keypoints grows with photographs that were matched at a smaller size.
TEST(ImproveRelativePoses, LeavesARotationAloneInLargePhotographs) {
  for (const double size : {1.0, 4.0}) {
    TwoImages pair(800, 1.0, 3, Motion::kTurn);
    Camera& camera = pair.scene.cameras.at(1);
    camera.width = static_cast<int>(3200 * size);
    for (double& param : camera.params) param *= size;
    for (auto& [id, pixels] : pair.scene.pixels) {
      for (Eigen::Vector2d& pixel : pixels) pixel *= size;
    }
    pair.scene.edges[0].cam2_from_cam1.translation = Eigen::Vector3d::UnitX();
    const ViewEdge edge = Improved(pair, {});
    EXPECT_TRUE(edge.IsActive()) << size;
    EXPECT_FALSE(edge.HasTranslation()) << size;
    EXPECT_LT(RotationErrorDeg(edge, pair), 0.5) << size;
  }
}

// Most of what the two see is far away: their parallax, in the median, is none.
TEST(ImproveRelativePoses, NearMatchesTellTheDirectionBeforeAFarBackground) {
  for (const double turn : {1.0, 0.0}) {
    TwoImages pair(800, 0.3, 6);
    pair.truth.rotation = ExpSO3({0.03 * turn, 0.2 * turn, 0});
    pair.truth.translation = {-0.2, 0.02, 0};
    const Camera& camera = pair.scene.cameras.at(1);
    FeatureMatches& matches = pair.scene.matches.begin()->second;
    Rng rng(1);
    for (point2D_t i = 0; i < 150; ++i) {
      const double depth = i < 110 ? 1e4 : 2;
      const Eigen::Vector3d x = depth * UniformVector({{-0.3, 0.3}, {-0.3, 0.3}, {1, 1}}, rng);
      pair.scene.pixels[1][i] = camera.ImgFromCam(x.hnormalized());
      pair.scene.pixels[2][i] = camera.ImgFromCam((pair.truth * x).hnormalized());
      for (image_t id = 1; id <= 2; ++id) {
        pair.scene.pixels[id][i] += 0.3 * GaussianVector<2>(rng);
      }
    }
    pair.scene.edges[0].cam2_from_cam1 = {pair.truth.rotation, pair.truth.translation.normalized()};
    ViewEdge edge = Improved(pair, {});
    EXPECT_TRUE(edge.IsActive());
    EXPECT_LT(RotationErrorDeg(edge, pair), 0.1);
    EXPECT_LT(DirectionErrorDeg(edge, pair), 2.0);
    matches.resize(120);  // ten near ones may be chance
    edge = Improved(pair, {});
    EXPECT_FALSE(edge.IsActive() && edge.HasTranslation());
  }
}

TEST(ImproveRelativePoses, PairsThatShowNoPoseHaveNone) {
  TwoImages still(800, 0.3, 4);
  still.scene.pixels.at(2) = still.scene.pixels.at(1);
  EXPECT_EQ(Improved(still, {}).removal, EdgeRemoval::kNoPose);

  TwoImages few(800, 0.3, 4);
  few.scene.matches.begin()->second.resize(7);
  EXPECT_EQ(Improved(few, {}).removal, EdgeRemoval::kNoPose);

  TwoImages unknown(800, 0.3, 4);
  unknown.scene.edges[0].removal = EdgeRemoval::kNoPose;
  EXPECT_EQ(Improved(unknown, {}).removal, EdgeRemoval::kNoPose);
}

TEST(ImproveRelativePoses, LeavesPairsThatAreNotNamed) {
  TwoImages pair(800, 0.3, 5);
  pair.scene.edges[0].cam2_from_cam1.rotation = pair.Reversed();
  ImproveRelativePoses({{ImagePairToPairId(1, 3), {}}}, {.num_threads = 2}, pair.scene);
  EXPECT_EQ(pair.scene.edges[0].cam2_from_cam1.rotation.coeffs(), pair.Reversed().coeffs());
}

}  // namespace
}  // namespace cairn
