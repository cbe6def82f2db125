#include "translation_averaging/position_system.h"

#include <Eigen/Dense>

#include "math/random_vectors.h"
#include "support/test.h"
#include "unit/translation_averaging/direction_test_util.h"

namespace cairn {
namespace {

// Cameras in the order of their numbers.
Eigen::Matrix3Xd Line(int num_cameras) {
  Eigen::Matrix3Xd positions = Eigen::Matrix3Xd::Zero(3, num_cameras);
  for (int i = 0; i < num_cameras; ++i) positions(0, i) = i;
  return positions;
}

struct Fixture {
  explicit Fixture(int num_cameras) {
    Rng rng(4);
    DirectionScene scene;
    std::vector<Eigen::Vector3d> centers;
    for (int k = 0; k < num_cameras; ++k) centers.push_back(RandomDirection(rng) * 3);
    scene.AddCenters(centers);
    scene.AddChain(3, 1, 0, rng);
    scene.AddPoints(30, 4, 2, 1, 0, rng);
    problem = MakeDirectionProblem(scene.edges, scene.tracks);
    const auto random = [&rng] { return GaussianVector<3>(rng); };
    const auto random_models = [&](size_t num) {
      std::vector<DirectionModel> result(num);
      for (DirectionModel& m : result) m = {random(), random()};
      return result;
    };
    models.edges = random_models(problem.edges.size());
    models.rays = random_models(problem.rays.size());
    for (int i = 0; i < problem.NumCameras(); ++i) {
      Eigen::Matrix3d A;
      A << random(), random(), random();
      models.centers.push_back({A * A.transpose(), random()});
    }
  }

  // The whole system, points not eliminated.
  Positions SolveDensely(double damping) const {
    const int n = problem.NumCameras(), p = problem.NumTracks();
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * (n + p), 3 * (n + p));
    Eigen::VectorXd b = Eigen::VectorXd::Zero(3 * (n + p));
    const auto add = [&](int i, int j, const DirectionModel& m) {
      H.block<3, 3>(3 * i, 3 * i) += m.Curvature();
      H.block<3, 3>(3 * j, 3 * j) += m.Curvature();
      H.block<3, 3>(3 * i, 3 * j) -= m.Curvature();
      H.block<3, 3>(3 * j, 3 * i) -= m.Curvature();
      b.segment<3>(3 * i) += m.gradient;
      b.segment<3>(3 * j) -= m.gradient;
    };
    for (size_t e = 0; e < problem.edges.size(); ++e) {
      add(problem.edges[e].camera1, problem.edges[e].camera2, models.edges[e]);
    }
    for (int k = 0; k < p; ++k) {
      for (int r = problem.track_begin[k]; r < problem.track_begin[k + 1]; ++r) {
        add(problem.rays[r].camera, n + k, models.rays[r]);
      }
    }
    for (int i = 0; i < n; ++i) {
      H.block<3, 3>(3 * i, 3 * i) += models.centers[i].curvature;
      b.segment<3>(3 * i) -= models.centers[i].gradient;
    }
    for (int i = 0; i < n + p; ++i) {
      const double mean = H.block<3, 3>(3 * i, 3 * i).trace() / 3;
      H.block<3, 3>(3 * i, 3 * i) += damping * mean * Eigen::Matrix3d::Identity();
    }
    const Eigen::VectorXd x = H.ldlt().solve(b);
    return {Eigen::Map<const Eigen::Matrix3Xd>(x.data(), 3, n),
            Eigen::Map<const Eigen::Matrix3Xd>(x.data() + 3 * n, 3, p)};
  }

  // By how much a step makes the sum of all models smaller.
  double Gain(const Positions& step) const {
    double gain = 0;
    const auto add = [&](const Eigen::Vector3d& difference, const Eigen::Vector3d& gradient,
                         const Eigen::Matrix3d& curvature) {
      gain -= gradient.dot(difference) + 0.5 * difference.dot(curvature * difference);
    };
    const auto add_direction = [&](const Eigen::Vector3d& difference, const DirectionModel& m) {
      add(difference, m.gradient, m.Curvature());
    };
    for (size_t e = 0; e < problem.edges.size(); ++e) {
      const DirectionProblem::Edge& edge = problem.edges[e];
      add_direction(step.cameras.col(edge.camera2) - step.cameras.col(edge.camera1),
                    models.edges[e]);
    }
    for (int k = 0; k < problem.NumTracks(); ++k) {
      for (int r = problem.track_begin[k]; r < problem.track_begin[k + 1]; ++r) {
        add_direction(step.points.col(k) - step.cameras.col(problem.rays[r].camera),
                      models.rays[r]);
      }
    }
    for (int i = 0; i < problem.NumCameras(); ++i) {
      add(step.cameras.col(i), models.centers[i].gradient, models.centers[i].curvature);
    }
    return gain;
  }

  DirectionProblem problem;
  FitModels models;
};

TEST(PositionSystem, EliminatingPointsChangesNothing) {
  const Fixture f(12);
  for (const double damping : {1e-3, 1.0}) {
    PositionSystem system(f.problem, 1);
    EXPECT_TRUE(system.UsesCholesky());
    Positions step;
    system.Restart(Line(12));
    ASSERT_TRUE(system.Solve(f.models, damping, step));
    const Positions expected = f.SolveDensely(damping);
    EXPECT_LT((step.cameras - expected.cameras).norm(), 1e-9 * expected.cameras.norm());
    EXPECT_LT((step.points - expected.points).norm(), 1e-9 * expected.points.norm());
  }
}

// A step of a fit need not be exact.
TEST(PositionSystem, ConjugateGradientsGainNearlyWhatCholeskyDoes) {
  for (const int num_cameras : {30, 3000}) {
    const Fixture f(num_cameras);
    PositionSystem direct(f.problem, 1);
    PositionSystem iterative(f.problem, 1, 0);
    EXPECT_FALSE(iterative.UsesCholesky());
    Positions a, b;
    direct.Restart(Line(num_cameras));
    iterative.Restart(Line(num_cameras));
    for (const double damping : {1e-5, 1e-2}) {  // the second as after a step that was rejected
      ASSERT_TRUE(direct.Solve(f.models, damping, a));
      ASSERT_TRUE(iterative.Solve(f.models, damping, b));
      EXPECT_GT(f.Gain(b), 0.98 * f.Gain(a)) << num_cameras << " " << damping;
    }
  }
}

TEST(PositionSystem, SameBytesForAnyNumberOfThreads) {
  const Fixture f(20);
  for (const int max_cholesky_steps : {200, 0}) {
    PositionSystem one(f.problem, 1, max_cholesky_steps), eight(f.problem, 8, max_cholesky_steps);
    Positions a, b;
    one.Restart(Line(20));
    ASSERT_TRUE(one.Solve(f.models, 1e-2, a));
    eight.Restart(Line(20));
    ASSERT_TRUE(eight.Solve(f.models, 1e-2, b));
    EXPECT_EQ(a.cameras, b.cameras);
    EXPECT_EQ(a.points, b.points);
  }
}

}  // namespace
}  // namespace cairn
