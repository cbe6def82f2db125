#include "translation_averaging/position_system.h"

#include <Eigen/LU>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"

namespace cairn {
namespace {

constexpr int kGrain = 64;
// Of an edge or a ray in a step of conjugate gradients: its curvature times two vectors.
constexpr double kFlopsOfTerm = 30;

}  // namespace

PositionSystem::PositionSystem(const DirectionProblem& problem, int num_threads,
                               int max_cholesky_steps)
    : problem_(problem), num_threads_(num_threads) {
  terms_of_.resize(problem.NumCameras());
  for (size_t e = 0; e < problem.edges.size(); ++e) {
    terms_of_[problem.edges[e].camera1].edges.push_back(static_cast<int>(e));
    terms_of_[problem.edges[e].camera2].edges.push_back(static_cast<int>(e));
  }
  for (int k = 0; k < problem.NumTracks(); ++k) {
    for (int r = problem.track_begin[k]; r < problem.track_begin[k + 1]; ++r) {
      terms_of_[problem.rays[r].camera].rays.push_back({r, k});
    }
  }
  columns_ = JoinedColumns(problem.NumCameras(), num_threads, [&](int i, const auto& use) {
    for (const int e : terms_of_[i].edges) {
      use(problem.edges[e].camera1);
      use(problem.edges[e].camera2);
    }
    for (const CameraTerms::Ray& own : terms_of_[i].rays) {
      for (const DirectionProblem::Ray& ray : problem.RaysOf(own.track)) use(ray.camera);
    }
  });
  // The factor has at least the system's own entries.
  double least_flops = 0;
  for (const std::vector<int>& row : columns_) {
    const auto num_blocks = static_cast<double>(row.size());
    least_flops += 27 * num_blocks * num_blocks;
  }
  const auto num_terms = static_cast<double>(problem.edges.size() + problem.rays.size());
  const double max_flops = max_cholesky_steps * kFlopsOfTerm * num_terms;
  if (least_flops <= max_flops) {
    cholesky_ = std::make_unique<BlockCholesky>(
        BlockPattern{std::vector<int>(columns_.size(), 3), columns_});
    if (cholesky_->FactorFlops() <= max_flops) return;
  }
  cholesky_.reset();
  columns_ = std::vector<std::vector<int>>();
  iterative_ = std::make_unique<IterativeCameras>(problem, num_threads);
}

void PositionSystem::Restart(const Eigen::Matrix3Xd& positions) {
  if (iterative_) iterative_->Restart(positions);
}

bool PositionSystem::Solve(const FitModels& models, double damping, Positions& step) {
  CAIRN_CHECK_EQ(models.edges.size(), problem_.edges.size());
  CAIRN_CHECK_EQ(models.rays.size(), problem_.rays.size());
  CAIRN_CHECK(models.centers.empty() || models.centers.size() == terms_of_.size());
  EliminatePoints(models, damping);
  if (iterative_) {
    step.cameras = iterative_->Solve(models, points_, damping);
  } else if (!SolveByCholesky(models, damping, step.cameras)) {
    return false;
  }
  step.points.resize(3, problem_.NumTracks());
  ParallelFor(
      num_threads_, problem_.NumTracks(),
      [&](int64_t k) {
        Eigen::Vector3d rhs = points_.rhs.col(k);
        for (int r = problem_.track_begin[k]; r < problem_.track_begin[k + 1]; ++r) {
          rhs += models.rays[r].CurvatureTimes(step.cameras.col(problem_.rays[r].camera));
        }
        step.points.col(k) = points_.inverse[k] * rhs;
      },
      kGrain);
  return step.cameras.allFinite() && step.points.allFinite();
}

void PositionSystem::EliminatePoints(const FitModels& models, double damping) {
  points_.inverse.resize(problem_.NumTracks());
  points_.rhs.resize(3, problem_.NumTracks());
  ParallelFor(
      num_threads_, problem_.NumTracks(),
      [&](int64_t k) {
        Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
        Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
        for (int r = problem_.track_begin[k]; r < problem_.track_begin[k + 1]; ++r) {
          curvature += models.rays[r].Curvature();
          gradient += models.rays[r].gradient;
        }
        points_.inverse[k] = Damped(curvature, damping).inverse();
        points_.rhs.col(k) = -gradient;
      },
      kGrain);
}

void PositionSystem::AssembleDiagonal(int camera, const FitModels& models, double damping) {
  Eigen::Matrix3d diagonal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
  for (const int e : terms_of_[camera].edges) {
    const bool is_first = problem_.edges[e].camera1 == camera;
    diagonal += models.edges[e].Curvature();
    rhs += is_first ? models.edges[e].gradient : Eigen::Vector3d(-models.edges[e].gradient);
  }
  if (!models.centers.empty()) {
    diagonal += models.centers[camera].curvature;
    rhs -= models.centers[camera].gradient;
  }
  Eigen::Matrix3d fill = Eigen::Matrix3d::Zero();  // by the points eliminated
  for (const auto [r, k] : terms_of_[camera].rays) {
    const Eigen::Matrix3d curvature = models.rays[r].Curvature();
    diagonal += curvature;
    const Eigen::Matrix3d weighted = curvature * points_.inverse[k];
    rhs += models.rays[r].gradient + weighted * points_.rhs.col(k);
    fill += weighted * curvature;
  }
  diagonal_[camera] = Damped(diagonal, damping) - fill;
  rhs_.col(camera) = rhs;
}

void PositionSystem::AssembleRow(int camera, const FitModels& models,
                                 std::vector<Eigen::Matrix3d>& scratch) {
  scratch.resize(problem_.NumCameras());
  for (const int column : columns_[camera]) scratch[column].setZero();
  for (const int e : terms_of_[camera].edges) {
    const bool is_first = problem_.edges[e].camera1 == camera;
    const int other = is_first ? problem_.edges[e].camera2 : problem_.edges[e].camera1;
    if (other > camera) scratch[other] -= models.edges[e].Curvature();
  }
  for (const auto [r, k] : terms_of_[camera].rays) {
    const Eigen::Matrix3d weighted = models.rays[r].Curvature() * points_.inverse[k];
    for (int s = r + 1; s < problem_.track_begin[k + 1]; ++s) {
      scratch[problem_.rays[s].camera] -= weighted * models.rays[s].Curvature();
    }
  }
  scratch[camera] = diagonal_[camera];
  for (const int column : columns_[camera]) {
    cholesky_->Add(column, camera, scratch[column].transpose());
  }
}

bool PositionSystem::SolveByCholesky(const FitModels& models, double damping,
                                     Eigen::Matrix3Xd& step) {
  rhs_.resize(3, problem_.NumCameras());
  diagonal_.resize(problem_.NumCameras());
  ParallelFor(
      num_threads_, problem_.NumCameras(),
      [&](int64_t i) { AssembleDiagonal(static_cast<int>(i), models, damping); }, kGrain);
  cholesky_->SetZero();
  std::vector<std::vector<Eigen::Matrix3d>> scratch(EffectiveNumThreads(num_threads_));
  ParallelForWorker(num_threads_, problem_.NumCameras(), [&](int worker, int64_t i) {
    AssembleRow(static_cast<int>(i), models, scratch[worker]);
  });
  if (!cholesky_->Factorize()) return false;
  const Eigen::VectorXd solution =
      cholesky_->Solve(Eigen::Map<const Eigen::VectorXd>(rhs_.data(), rhs_.size()));
  step = Eigen::Map<const Eigen::Matrix3Xd>(solution.data(), 3, rhs_.cols());
  return true;
}

}  // namespace cairn
