#include "translation_averaging/position_system.h"

#include <Eigen/LU>
#include <algorithm>
#include <numeric>
#include <span>
#include <utility>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"

namespace cairn {
namespace {

// A step of a fit need not be exact: the next one mends it.
constexpr int kMaxCgIterations = 100;
constexpr double kCgTolerance = 3e-2;
// Keeps the gauge (translation and scale) and loose nodes solvable.
constexpr double kMinDamping = 1e-9;
constexpr int kGrain = 64;
// Cameras of a group, at most, and groups, at most: a system of more takes longer than it saves.
constexpr int kMaxGroup = 32;
constexpr int kMaxGroups = 1000;
// Their system is summed up in so many parts, whatever the number of threads.
constexpr int kNumParts = 4;

Eigen::Matrix3d Damped(const Eigen::Matrix3d& curvature, double damping) {
  const double mean = curvature.trace() / 3.0;
  return curvature +
         std::max(damping, kMinDamping) * (mean > 0 ? mean : 1.0) * Eigen::Matrix3d::Identity();
}

// The curvature of DirectionModel times x.
Eigen::Vector3d Across(const Eigen::Vector3d& axis, const Eigen::Vector3d& x) {
  return axis.squaredNorm() * x - axis.dot(x) * axis;
}

// Halves the cameras along the longest side of their bounding box until few enough are left.
void SplitIntoGroups(const Eigen::Matrix3Xd& positions, std::span<int> cameras, size_t max_size,
                     std::vector<int>& group_of, int& num_groups) {
  if (cameras.size() <= max_size) {
    for (const int i : cameras) group_of[i] = num_groups;
    ++num_groups;
    return;
  }
  Eigen::Vector3d low = positions.col(cameras[0]), high = low;
  for (const int i : cameras) {
    low = low.cwiseMin(positions.col(i));
    high = high.cwiseMax(positions.col(i));
  }
  int axis = 0;
  (high - low).maxCoeff(&axis);
  const auto middle = cameras.begin() + static_cast<std::ptrdiff_t>(cameras.size() / 2);
  std::nth_element(cameras.begin(), middle, cameras.end(), [&](int a, int b) {
    return std::pair(positions(axis, a), a) < std::pair(positions(axis, b), b);
  });
  SplitIntoGroups(positions, {cameras.begin(), middle}, max_size, group_of, num_groups);
  SplitIntoGroups(positions, {middle, cameras.end()}, max_size, group_of, num_groups);
}

}  // namespace

PositionSystem::PositionSystem(const DirectionProblem& problem, int num_threads,
                               double max_cholesky_flops)
    : problem_(problem), num_threads_(num_threads) {
  edges_of_.resize(problem.NumCameras());
  rays_of_.resize(problem.NumCameras());
  for (size_t e = 0; e < problem.edges.size(); ++e) {
    edges_of_[problem.edges[e].camera1].push_back(static_cast<int>(e));
    edges_of_[problem.edges[e].camera2].push_back(static_cast<int>(e));
  }
  for (int k = 0; k < problem.NumTracks(); ++k) {
    for (int r = problem.track_begin[k]; r < problem.track_begin[k + 1]; ++r) {
      rays_of_[problem.rays[r].camera].push_back(r);
      track_of_ray_.push_back(k);
    }
  }
  BuildPattern();
  // The factor has at least the system's own entries.
  double least_flops = 0;
  for (int i = 0; i < problem.NumCameras(); ++i) {
    const double num_blocks = row_begin_[i + 1] - row_begin_[i];
    least_flops += 27 * num_blocks * num_blocks;
  }
  if (least_flops <= max_cholesky_flops) BuildCholesky(max_cholesky_flops);
  if (!cholesky_) column_ = {};
}

void PositionSystem::BuildPattern() {
  const int n = problem_.NumCameras();
  std::vector<std::vector<int>> columns(n);
  ParallelFor(num_threads_, n, [&](int64_t i) {
    std::vector<char> is_joined(n, 0);
    is_joined[i] = 1;
    for (const int e : edges_of_[i]) {
      is_joined[problem_.edges[e].camera1] = is_joined[problem_.edges[e].camera2] = 1;
    }
    for (const int r : rays_of_[i]) {
      for (const DirectionProblem::Ray& ray : problem_.RaysOf(track_of_ray_[r])) {
        is_joined[ray.camera] = 1;
      }
    }
    for (int j = static_cast<int>(i); j < n; ++j) {
      if (is_joined[j]) columns[i].push_back(j);
    }
  });
  row_begin_ = {0};
  for (const std::vector<int>& row : columns) {
    column_.insert(column_.end(), row.begin(), row.end());
    row_begin_.push_back(static_cast<int>(column_.size()));
  }
}

void PositionSystem::BuildCholesky(double max_flops) {
  BlockPattern pattern;
  for (int i = 0; i < problem_.NumCameras(); ++i) {
    pattern.sizes.push_back(3);
    pattern.columns.emplace_back(column_.begin() + row_begin_[i],
                                 column_.begin() + row_begin_[i + 1]);
  }
  cholesky_ = std::make_unique<BlockCholesky>(std::move(pattern));
  if (cholesky_->FactorFlops() > max_flops) {
    cholesky_.reset();
    return;
  }
  blocks_.resize(column_.size());
}

bool PositionSystem::Solve(const FitModels& models, double damping,
                           const Eigen::Matrix3Xd& positions, Positions& step) {
  const int n = problem_.NumCameras();
  CAIRN_CHECK_EQ(models.edges.size(), problem_.edges.size());
  CAIRN_CHECK_EQ(models.rays.size(), problem_.rays.size());
  CAIRN_CHECK(models.centers.empty() || models.centers.size() == edges_of_.size());
  EliminatePoints(models, damping);
  rhs_.resize(3, n);
  damped_.resize(n);
  diagonal_.resize(n);
  ParallelFor(
      num_threads_, n, [&](int64_t i) { AssembleDiagonal(static_cast<int>(i), models, damping); },
      kGrain);
  if (!cholesky_) {
    if (group_of_.empty()) {
      std::vector<int> cameras(n);
      std::iota(cameras.begin(), cameras.end(), 0);
      group_of_.resize(n);
      SplitIntoGroups(positions, cameras, std::max(kMaxGroup, n / kMaxGroups), group_of_,
                      num_groups_);
    }
    BuildCouplings(models);
    MakePreconditioner(models);
    SolveByConjugateGradients(step.cameras);
  } else if (!SolveByCholesky(models, step.cameras)) {
    return false;
  }

  step.points.resize(3, problem_.NumTracks());
  ParallelFor(
      num_threads_, problem_.NumTracks(),
      [&](int64_t k) {
        Eigen::Vector3d rhs = point_rhs_.col(k);
        for (int r = problem_.track_begin[k]; r < problem_.track_begin[k + 1]; ++r) {
          rhs += Across(models.rays[r].axis, step.cameras.col(problem_.rays[r].camera));
        }
        step.points.col(k) = point_inverse_[k] * rhs;
      },
      kGrain);
  return step.cameras.allFinite() && step.points.allFinite();
}

void PositionSystem::EliminatePoints(const FitModels& models, double damping) {
  point_inverse_.resize(problem_.NumTracks());
  point_rhs_.resize(3, problem_.NumTracks());
  ParallelFor(
      num_threads_, problem_.NumTracks(),
      [&](int64_t k) {
        Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
        Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
        for (int r = problem_.track_begin[k]; r < problem_.track_begin[k + 1]; ++r) {
          curvature += models.rays[r].Curvature();
          gradient += models.rays[r].gradient;
        }
        point_inverse_[k] = Damped(curvature, damping).inverse();
        point_rhs_.col(k) = -gradient;
      },
      kGrain);
}

void PositionSystem::AssembleDiagonal(int camera, const FitModels& models, double damping) {
  Eigen::Matrix3d diagonal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
  for (const int e : edges_of_[camera]) {
    const bool is_first = problem_.edges[e].camera1 == camera;
    diagonal += models.edges[e].Curvature();
    rhs += is_first ? models.edges[e].gradient : Eigen::Vector3d(-models.edges[e].gradient);
  }
  if (!models.centers.empty()) {
    diagonal += models.centers[camera].curvature;
    rhs -= models.centers[camera].gradient;
  }
  Eigen::Matrix3d fill = Eigen::Matrix3d::Zero();  // by the points eliminated
  for (const int r : rays_of_[camera]) {
    const int k = track_of_ray_[r];
    const Eigen::Matrix3d curvature = models.rays[r].Curvature();
    diagonal += curvature;
    const Eigen::Matrix3d weighted = curvature * point_inverse_[k];
    rhs += models.rays[r].gradient + weighted * point_rhs_.col(k);
    fill += weighted * curvature;
  }
  damped_[camera] = Damped(diagonal, damping);
  diagonal_[camera] = damped_[camera] - fill;
  rhs_.col(camera) = rhs;
}

void PositionSystem::AssembleRow(int camera, const FitModels& models,
                                 std::vector<Eigen::Matrix3d>& scratch) {
  scratch.resize(problem_.NumCameras());
  for (int k = row_begin_[camera]; k < row_begin_[camera + 1]; ++k) scratch[column_[k]].setZero();
  for (const int e : edges_of_[camera]) {
    const bool is_first = problem_.edges[e].camera1 == camera;
    const int other = is_first ? problem_.edges[e].camera2 : problem_.edges[e].camera1;
    if (other > camera) scratch[other] -= models.edges[e].Curvature();
  }
  for (const int r : rays_of_[camera]) {
    const int k = track_of_ray_[r];
    const Eigen::Matrix3d weighted = models.rays[r].Curvature() * point_inverse_[k];
    for (int s = r + 1; s < problem_.track_begin[k + 1]; ++s) {
      scratch[problem_.rays[s].camera] -= weighted * models.rays[s].Curvature();
    }
  }
  scratch[camera] = diagonal_[camera];
  for (int k = row_begin_[camera]; k < row_begin_[camera + 1]; ++k) {
    blocks_[k] = scratch[column_[k]];
  }
}

bool PositionSystem::SolveByCholesky(const FitModels& models, Eigen::Matrix3Xd& step) {
  std::vector<std::vector<Eigen::Matrix3d>> scratch(EffectiveNumThreads(num_threads_));
  ParallelForWorker(num_threads_, problem_.NumCameras(), [&](int worker, int64_t i) {
    AssembleRow(static_cast<int>(i), models, scratch[worker]);
  });
  cholesky_->SetZero();
  for (int i = 0; i < problem_.NumCameras(); ++i) {
    for (int k = row_begin_[i]; k < row_begin_[i + 1]; ++k) {
      cholesky_->Add(column_[k], i, blocks_[k].transpose());
    }
  }
  if (!cholesky_->Factorize()) return false;
  const Eigen::VectorXd solution =
      cholesky_->Solve(Eigen::Map<const Eigen::VectorXd>(rhs_.data(), rhs_.size()));
  step = Eigen::Map<const Eigen::Matrix3Xd>(solution.data(), 3, rhs_.cols());
  return true;
}

void PositionSystem::BuildCouplings(const FitModels& models) {
  const int n = problem_.NumCameras();
  const auto make = [](const DirectionModel& model, int other) {
    const Eigen::Vector3f axis = model.axis.cast<float>();
    return Coupling{axis.x(), axis.y(), axis.z(), other};
  };
  edges_begin_.assign(1, 0);
  rays_begin_.assign(1, 0);
  for (int i = 0; i < n; ++i) {
    edges_begin_.push_back(edges_begin_.back() + edges_of_[i].size());
    rays_begin_.push_back(rays_begin_.back() + rays_of_[i].size());
  }
  edges_by_camera_.resize(edges_begin_.back());
  rays_by_camera_.resize(problem_.rays.size());
  rays_by_track_.resize(problem_.rays.size());
  const auto fill = [&](int64_t i) {
    size_t next = edges_begin_[i];
    for (const int e : edges_of_[i]) {
      const DirectionProblem::Edge& edge = problem_.edges[e];
      const int other = edge.camera1 == i ? edge.camera2 : edge.camera1;
      edges_by_camera_[next++] = make(models.edges[e], other);
    }
    next = rays_begin_[i];
    for (const int r : rays_of_[i]) {
      rays_by_camera_[next++] = make(models.rays[r], track_of_ray_[r]);
      rays_by_track_[r] = make(models.rays[r], static_cast<int>(i));
    }
  };
  ParallelFor(num_threads_, n, fill, kGrain);
}

// The cameras' system times x, by way of the points.
Eigen::Matrix3Xd PositionSystem::Multiply(const Eigen::Matrix3Xd& x) const {
  const auto apply = [](std::span<const Coupling> couplings, const Eigen::Matrix3Xd& to) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Coupling& c : couplings) {
      sum += Across(Eigen::Vector3d(c.x, c.y, c.z), to.col(c.other));
    }
    return sum;
  };
  const auto part = [](const std::vector<Coupling>& all, size_t begin, size_t end) {
    return std::span<const Coupling>(all.data() + begin, all.data() + end);
  };
  Eigen::Matrix3Xd points(3, problem_.NumTracks());
  const auto sum_point = [&](int64_t k) {
    points.col(k) =
        point_inverse_[k] *
        apply(part(rays_by_track_, problem_.track_begin[k], problem_.track_begin[k + 1]), x);
  };
  ParallelFor(num_threads_, problem_.NumTracks(), sum_point, kGrain);
  Eigen::Matrix3Xd y(3, x.cols());
  const auto sum_camera = [&](int64_t i) {
    y.col(i) = damped_[i] * x.col(i) -
               apply(part(edges_by_camera_, edges_begin_[i], edges_begin_[i + 1]), x) -
               apply(part(rays_by_camera_, rays_begin_[i], rays_begin_[i + 1]), points);
  };
  ParallelFor(num_threads_, x.cols(), sum_camera, kGrain);
  return y;
}

// Adds a part of the cameras, edges and points to the lower triangle of the cameras' system where
// all cameras of a group move alike.
void PositionSystem::AddToGroups(const FitModels& models, int part, Eigen::MatrixXd& system) const {
  const auto for_part = [part](int64_t size, auto use) {
    for (int64_t k = part * size / kNumParts; k < (part + 1) * size / kNumParts; ++k) use(k);
  };
  const auto add = [&system](int group1, int group2, const Eigen::Matrix3d& block) {
    if (group1 >= group2) system.block<3, 3>(3 * group1, 3 * group2) += block;
  };
  for_part(problem_.NumCameras(), [&](int64_t i) { add(group_of_[i], group_of_[i], damped_[i]); });
  for_part(std::ssize(problem_.edges), [&](int64_t e) {
    const int group1 = group_of_[problem_.edges[e].camera1];
    const int group2 = group_of_[problem_.edges[e].camera2];
    const Eigen::Matrix3d curvature = models.edges[e].Curvature();
    add(group1, group2, -curvature);
    add(group2, group1, -curvature);
  });
  std::vector<std::pair<int, Eigen::Matrix3d>> pulls;  // of a point, on each group
  for_part(problem_.NumTracks(), [&](int64_t k) {
    pulls.clear();
    for (int r = problem_.track_begin[k]; r < problem_.track_begin[k + 1]; ++r) {
      const int group = group_of_[problem_.rays[r].camera];
      const auto pull = std::find_if(pulls.begin(), pulls.end(),
                                     [group](const auto& p) { return p.first == group; });
      if (pull == pulls.end()) {
        pulls.emplace_back(group, models.rays[r].Curvature());
      } else {
        pull->second += models.rays[r].Curvature();
      }
    }
    for (const auto& [group1, pull1] : pulls) {
      const Eigen::Matrix3d weighted = pull1 * point_inverse_[k];
      for (const auto& [group2, pull2] : pulls) {
        if (group1 >= group2) add(group1, group2, -weighted * pull2);
      }
    }
  });
}

void PositionSystem::MakePreconditioner(const FitModels& models) {
  diagonal_inverse_.resize(diagonal_.size());
  for (size_t i = 0; i < diagonal_.size(); ++i) diagonal_inverse_[i] = diagonal_[i].inverse();
  std::vector<Eigen::MatrixXd> parts(kNumParts);
  const auto make = [&](int64_t part) {
    parts[part] = Eigen::MatrixXd::Zero(3 * num_groups_, 3 * num_groups_);
    AddToGroups(models, static_cast<int>(part), parts[part]);
  };
  ParallelFor(num_threads_, kNumParts, make, 1);
  for (int part = 1; part < kNumParts; ++part) parts[0] += parts[part];
  groups_.compute(parts[0]);
}

Eigen::Matrix3Xd PositionSystem::Precondition(const Eigen::Matrix3Xd& residual) const {
  Eigen::VectorXd sums = Eigen::VectorXd::Zero(3 * num_groups_);
  for (Eigen::Index i = 0; i < residual.cols(); ++i) {
    sums.segment<3>(3 * group_of_[i]) += residual.col(i);
  }
  groups_.solveInPlace(sums);
  Eigen::Matrix3Xd result(3, residual.cols());
  for (Eigen::Index i = 0; i < residual.cols(); ++i) {
    result.col(i) = diagonal_inverse_[i] * residual.col(i) + sums.segment<3>(3 * group_of_[i]);
  }
  return result;
}

void PositionSystem::SolveByConjugateGradients(Eigen::Matrix3Xd& step) const {
  const int n = problem_.NumCameras();
  step = Eigen::Matrix3Xd::Zero(3, n);
  Eigen::Matrix3Xd residual = rhs_;
  Eigen::Matrix3Xd z = Precondition(residual);
  Eigen::Matrix3Xd direction = z;
  double rho = residual.cwiseProduct(z).sum();
  const double target = kCgTolerance * kCgTolerance * rho;
  for (int iteration = 0; iteration < kMaxCgIterations && rho > target; ++iteration) {
    const Eigen::Matrix3Xd image = Multiply(direction);
    const double curvature = direction.cwiseProduct(image).sum();
    if (!(curvature > 0)) break;
    const double length = rho / curvature;
    step += length * direction;
    residual -= length * image;
    z = Precondition(residual);
    const double next_rho = residual.cwiseProduct(z).sum();
    direction = z + (next_rho / rho) * direction;
    rho = next_rho;
  }
}

}  // namespace cairn
