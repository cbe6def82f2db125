#include "translation_averaging/iterative_cameras.h"

#include <Eigen/LU>
#include <algorithm>
#include <numeric>
#include <span>

#include "cairn/base/parallel.h"

namespace cairn {
namespace {

// A step of a fit need not be exact: the next one mends it.
constexpr int kMaxCgIterations = 100;
constexpr double kCgTolerance = 3e-2;
constexpr int kIterationGrain = 64;
// Cameras of a group, at most, and groups, at most: a system of more takes longer than it saves.
constexpr int kMaxGroup = 32;
constexpr int kMaxGroups = 1000;
// Sums over edges and tracks are of so many parts, whatever the number of threads; each part has an
// element for every camera.
constexpr int kNumParts = 8;

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

// C P C for the curvature C = a'a I - a a' of an axis a, and P symmetric.
Eigen::Matrix3d FromBothSides(const Eigen::Vector3d& axis, const Eigen::Matrix3d& P) {
  const double square = axis.squaredNorm();
  const Eigen::Vector3d image = P * axis;
  const Eigen::Vector3d half = square * image - 0.5 * axis.dot(image) * axis;
  return square * square * P - half * axis.transpose() - axis * half.transpose();
}

// x, y, z and the squared length.
Eigen::Vector4f WithSquare(const Eigen::Vector3d& axis) {
  Eigen::Vector4f result;
  result << axis.cast<float>(), 0;
  result[3] = result.squaredNorm();
  return result;
}

// The curvature of such an axis times x, y, z of a vector whose last element is 0; the result's
// last one means nothing. (By halves, which all instruction sets have. In double precision, since
// the curvature is none along the axis, and may be large across it.)
Eigen::Vector4d Across(const Eigen::Vector4f& axis, const Eigen::Vector4d& x) {
  Eigen::Vector4d a;
  a.head<2>() = axis.head<2>().cast<double>();
  a.tail<2>() = axis.tail<2>().cast<double>();
  return a[3] * x - a.cwiseProduct(x).sum() * a;
}

Eigen::Vector4d WithZero(const Eigen::Vector3d& x) { return {x.x(), x.y(), x.z(), 0}; }

// Calls use(k) for the elements k of a part of `size`.
template <class Use>
void ForPart(int64_t part, int64_t size, const Use& use) {
  for (int64_t k = part * size / kNumParts; k < (part + 1) * size / kNumParts; ++k) use(k);
}

// Of blocks (row, column), row >= column, by rows.
size_t LowerIndex(int row, int column) { return static_cast<size_t>(row) * (row + 1) / 2 + column; }

}  // namespace

IterativeCameras::IterativeCameras(const DirectionProblem& problem, int num_threads)
    : problem_(problem), num_threads_(num_threads) {
  for (const DirectionProblem::Edge& edge : problem.edges) {
    edge_cameras_.emplace_back(edge.camera1, edge.camera2);
  }
  for (const DirectionProblem::Ray& ray : problem.rays) ray_cameras_.push_back(ray.camera);
}

void IterativeCameras::Restart(const Eigen::Matrix3Xd& positions) {
  has_groups_ = false;
  if (!group_of_.empty()) return;
  const int n = problem_.NumCameras();
  std::vector<int> cameras(n);
  std::iota(cameras.begin(), cameras.end(), 0);
  group_of_.resize(n);
  SplitIntoGroups(positions, cameras, std::max(kMaxGroup, n / kMaxGroups), group_of_, num_groups_);
}

Eigen::Matrix3Xd IterativeCameras::Solve(const FitModels& models, const EliminatedPoints& points,
                                         double damping) {
  Assemble(models, points, damping);
  if (!std::exchange(has_groups_, true)) FactorizeGroups(models, points);
  return Iterate(points);
}

void IterativeCameras::Assemble(const FitModels& models, const EliminatedPoints& points,
                                double damping) {
  const int n = problem_.NumCameras();
  edge_axes_.resize(problem_.edges.size());
  ray_axes_.resize(problem_.rays.size());
  std::vector<std::vector<Diagonal>> parts(kNumParts);
  const auto assemble_part = [&](int64_t part) {
    parts[part].resize(n);
    AssemblePart(part, models, points, parts[part]);
  };
  ParallelFor(num_threads_, kNumParts, assemble_part, 1);
  rhs_.resize(3, n);
  damped_.resize(n);
  diagonal_inverse_.resize(n);
  const auto assemble_camera = [&](int64_t i) {
    Diagonal sum;
    if (!models.centers.empty()) {
      sum.own = models.centers[i].curvature;
      sum.rhs = -models.centers[i].gradient;
    }
    for (const std::vector<Diagonal>& part : parts) {
      sum.own += part[i].own;
      sum.fill += part[i].fill;
      sum.rhs += part[i].rhs;
    }
    rhs_.col(i) = sum.rhs;
    damped_[i] = Damped(sum.own, damping);
    diagonal_inverse_[i] = (damped_[i] - sum.fill).inverse();
  };
  ParallelFor(num_threads_, n, assemble_camera, kIterationGrain);
}

void IterativeCameras::AssemblePart(int64_t part, const FitModels& models,
                                    const EliminatedPoints& points,
                                    std::vector<Diagonal>& diagonal) {
  ForPart(part, std::ssize(problem_.edges), [&](int64_t e) {
    const DirectionModel& model = models.edges[e];
    Diagonal& camera1 = diagonal[problem_.edges[e].camera1];
    Diagonal& camera2 = diagonal[problem_.edges[e].camera2];
    const Eigen::Matrix3d curvature = model.Curvature();
    camera1.own += curvature;
    camera2.own += curvature;
    camera1.rhs += model.gradient;
    camera2.rhs -= model.gradient;
    edge_axes_[e] = WithSquare(model.axis);
  });
  ForPart(part, problem_.NumTracks(), [&](int64_t k) {
    const Eigen::Matrix3d& P = points.inverse[k];
    const Eigen::Vector3d point = P * points.rhs.col(k);
    for (int r = problem_.track_begin[k]; r < problem_.track_begin[k + 1]; ++r) {
      const DirectionModel& model = models.rays[r];
      Diagonal& camera = diagonal[problem_.rays[r].camera];
      camera.own += model.Curvature();
      camera.fill += FromBothSides(model.axis, P);
      camera.rhs += model.gradient + model.CurvatureTimes(point);
      ray_axes_[r] = WithSquare(model.axis);
    }
  });
}

// The cameras' system times x, by way of the points.
Eigen::Matrix3Xd IterativeCameras::Multiply(const EliminatedPoints& points,
                                            const Eigen::Matrix3Xd& x) const {
  const int64_t n = x.cols();
  std::vector<Eigen::Vector4d> cameras(n);
  for (int64_t i = 0; i < n; ++i) cameras[i] = WithZero(x.col(i));
  std::vector<std::vector<Eigen::Vector4d>> parts(kNumParts);
  const auto multiply_part = [&](int64_t part) {
    parts[part].assign(n, Eigen::Vector4d::Zero());
    MultiplyPart(part, points, cameras.data(), parts[part].data());
  };
  ParallelFor(num_threads_, kNumParts, multiply_part, 1);
  Eigen::Matrix3Xd y(3, n);
  const auto sum_camera = [&](int64_t i) {
    Eigen::Vector3d sum = damped_[i] * x.col(i);
    for (const std::vector<Eigen::Vector4d>& part : parts) sum -= part[i].head<3>();
    y.col(i) = sum;
  };
  ParallelFor(num_threads_, n, sum_camera, kIterationGrain);
  return y;
}

// By pointers: bounds checks would take a third of the time.
void IterativeCameras::MultiplyPart(int64_t part, const EliminatedPoints& points,
                                    const Eigen::Vector4d* x, Eigen::Vector4d* sums) const {
  ForPart(part, std::ssize(problem_.edges), [&](int64_t e) {
    const auto [camera1, camera2] = edge_cameras_[e];
    sums[camera1] += Across(edge_axes_[e], x[camera2]);
    sums[camera2] += Across(edge_axes_[e], x[camera1]);
  });
  ForPart(part, problem_.NumTracks(), [&](int64_t k) {
    const std::span axes(ray_axes_.data() + problem_.track_begin[k],
                         ray_axes_.data() + problem_.track_begin[k + 1]);
    const int* const cameras = ray_cameras_.data() + problem_.track_begin[k];
    Eigen::Vector4d pull = Eigen::Vector4d::Zero();
    const int* camera = cameras;
    for (const Eigen::Vector4f& axis : axes) pull += Across(axis, x[*camera++]);
    const Eigen::Vector4d point = WithZero(points.inverse[k] * pull.head<3>());
    camera = cameras;
    for (const Eigen::Vector4f& axis : axes) sums[*camera++] += Across(axis, point);
  });
}

void IterativeCameras::AddToGroups(int64_t part, const FitModels& models,
                                   const EliminatedPoints& points,
                                   std::vector<Eigen::Matrix3d>& blocks) const {
  ForPart(part, problem_.NumCameras(),
          [&](int64_t i) { blocks[LowerIndex(group_of_[i], group_of_[i])] += damped_[i]; });
  ForPart(part, std::ssize(problem_.edges), [&](int64_t e) {
    const auto [group2, group1] =
        std::minmax(group_of_[problem_.edges[e].camera1], group_of_[problem_.edges[e].camera2]);
    const double times = group1 == group2 ? 2 : 1;
    blocks[LowerIndex(group1, group2)] -= times * models.edges[e].Curvature();
  });
  std::vector<std::pair<int, Eigen::Matrix3d>> pulls;  // of a point, on each group
  ForPart(part, problem_.NumTracks(), [&](int64_t k) {
    pulls.clear();
    for (int r = problem_.track_begin[k]; r < problem_.track_begin[k + 1]; ++r) {
      const int group = group_of_[problem_.rays[r].camera];
      const auto pull = std::ranges::find(pulls, group, [](const auto& p) { return p.first; });
      if (pull == pulls.end()) {
        pulls.emplace_back(group, models.rays[r].Curvature());
      } else {
        pull->second += models.rays[r].Curvature();
      }
    }
    for (const auto& [group1, pull1] : pulls) {
      const Eigen::Matrix3d weighted = pull1 * points.inverse[k];
      for (const auto& [group2, pull2] : pulls) {
        if (group1 >= group2) blocks[LowerIndex(group1, group2)] -= weighted * pull2;
      }
    }
  });
}

void IterativeCameras::FactorizeGroups(const FitModels& models, const EliminatedPoints& points) {
  std::vector<std::vector<Eigen::Matrix3d>> parts(kNumParts);
  const auto make = [&](int64_t part) {
    parts[part].assign(LowerIndex(num_groups_, 0), Eigen::Matrix3d::Zero());
    AddToGroups(part, models, points, parts[part]);
  };
  ParallelFor(num_threads_, kNumParts, make, 1);
  Eigen::MatrixXd system(3 * num_groups_, 3 * num_groups_);  // its lower triangle
  for (int row = 0; row < num_groups_; ++row) {
    for (int column = 0; column <= row; ++column) {
      Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
      for (const auto& part : parts) sum += part[LowerIndex(row, column)];
      system.block<3, 3>(3 * row, 3 * column) = sum;
    }
  }
  groups_.compute(system);
}

Eigen::Matrix3Xd IterativeCameras::Precondition(const Eigen::Matrix3Xd& residual) const {
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

Eigen::Matrix3Xd IterativeCameras::Iterate(const EliminatedPoints& points) const {
  Eigen::Matrix3Xd step = Eigen::Matrix3Xd::Zero(3, problem_.NumCameras());
  Eigen::Matrix3Xd residual = rhs_;
  Eigen::Matrix3Xd z = Precondition(residual);
  Eigen::Matrix3Xd direction = z;
  double rho = residual.cwiseProduct(z).sum();
  const double target = kCgTolerance * kCgTolerance * rho;
  for (int iteration = 0; iteration < kMaxCgIterations && rho > target; ++iteration) {
    const Eigen::Matrix3Xd image = Multiply(points, direction);
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
  return step;
}

}  // namespace cairn
