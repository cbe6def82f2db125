#include "translation_averaging/nonlinear_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "translation_averaging/term_cost.h"

namespace cairn {
namespace {

constexpr int kBlock = 4096;  // terms a task; sums run over blocks in their order
constexpr int kTracksATask = 256;
constexpr double kInitialDamping = 1e-4;
constexpr double kMaxDamping = 1e10;

// Length of the chord between two directions.
double Chord(double angle_deg) { return 2 * std::sin(0.5 * DegToRad(std::min(angle_deg, 180.0))); }

class Fit {
 public:
  Fit(const DirectionProblem& problem, const FitWeights& weights, int num_threads)
      : problem_(problem),
        weights_(weights),
        edge_huber_(Chord(weights.edge_huber_deg)),
        ray_huber_(Chord(weights.ray_huber_deg)),
        num_threads_(num_threads) {
    for (int k = 0; k < problem.NumTracks(); ++k) {
      track_of_ray_.insert(track_of_ray_.end(), problem.RaysOf(k).size(), k);
    }
    models_.edges.resize(problem.edges.size());
    models_.rays.resize(problem.rays.size());
    if (!weights.centers.empty()) models_.centers.resize(problem.NumCameras());
  }

  double Cost(const Positions& x) const {
    const size_t num_blocks = (NumTerms() + kBlock - 1) / kBlock;
    std::vector<double> sums(num_blocks, 0.0);
    ParallelFor(num_threads_, static_cast<int64_t>(num_blocks), [&](int64_t b) {
      double sum = 0;  // not in sums[b]: its cache line is the other threads', too
      for (size_t t = b * kBlock; t < std::min<size_t>(NumTerms(), (b + 1) * kBlock); ++t) {
        const Eigen::Vector3d D = DifferenceOf(t, x);
        sum += WeightOf(t) * ChordalCost(DirectionOf(t), D, HuberOf(t));
      }
      sums[b] = sum;
    });
    double cost = 0;
    for (const double sum : sums) cost += sum;
    for (const CenterTerm& term : weights_.centers) {
      const Eigen::Vector3d offset = x.cameras.col(term.camera) - term.center;
      cost += 0.5 * offset.dot(term.information * offset);
    }
    return cost;
  }

  void Linearize(const Positions& x) {
    const size_t num_blocks = (NumTerms() + kBlock - 1) / kBlock;
    ParallelFor(num_threads_, static_cast<int64_t>(num_blocks), [&](int64_t b) {
      for (size_t t = b * kBlock; t < std::min<size_t>(NumTerms(), (b + 1) * kBlock); ++t) {
        const Eigen::Vector3d D = DifferenceOf(t, x);
        DirectionModel model = ChordalModel(DirectionOf(t), D, HuberOf(t));
        model.axis *= std::sqrt(WeightOf(t));
        model.gradient *= WeightOf(t);
        (t < NumEdges() ? models_.edges[t] : models_.rays[t - NumEdges()]) = model;
      }
    });
    for (CenterModel& model : models_.centers) {
      model = {Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero()};
    }
    for (const CenterTerm& term : weights_.centers) {
      const Eigen::Vector3d offset = x.cameras.col(term.camera) - term.center;
      models_.centers[term.camera] = {term.information, term.information * offset};
    }
  }

  // Points that a step makes worse, where it has led the cameras, go half of theirs, a quarter, an
  // eighth, or stay.
  void ShortenStepsOfPoints(const Positions& from, Positions& to) const {
    constexpr int kMaxHalvings = 3;
    const auto shorten = [&](int64_t k) {
      const Eigen::Vector3d start = from.points.col(k);
      const double cost = CostOfTrack(k, to.cameras, start);
      for (int n = 0; CostOfTrack(k, to.cameras, to.points.col(k)) > cost; ++n) {
        to.points.col(k) = n < kMaxHalvings ? 0.5 * (start + to.points.col(k)) : start;
      }
    };
    ParallelFor(num_threads_, problem_.NumTracks(), shorten, kTracksATask);
  }

  const FitModels& Models() const { return models_; }

 private:
  size_t NumEdges() const { return problem_.edges.size(); }
  size_t NumTerms() const { return NumEdges() + problem_.rays.size(); }
  const Eigen::Vector3d& DirectionOf(size_t t) const {
    return t < NumEdges() ? problem_.edges[t].direction : problem_.rays[t - NumEdges()].direction;
  }
  double HuberOf(size_t t) const { return t < NumEdges() ? edge_huber_ : ray_huber_; }
  double WeightOf(size_t t) const {
    return t < NumEdges() ? weights_.edges[t] : weights_.rays[t - NumEdges()];
  }
  double CostOfTrack(int64_t k, const Eigen::Matrix3Xd& cameras, const Eigen::Vector3d& X) const {
    double sum = 0;
    for (int r = problem_.track_begin[k]; r < problem_.track_begin[k + 1]; ++r) {
      const auto& [camera, direction] = problem_.rays[r];
      const Eigen::Vector3d D = X - cameras.col(camera);
      sum += weights_.rays[r] * ChordalCost(direction, D, ray_huber_);
    }
    return sum;
  }
  Eigen::Vector3d DifferenceOf(size_t t, const Positions& x) const {
    if (t < NumEdges()) {
      return x.cameras.col(problem_.edges[t].camera2) - x.cameras.col(problem_.edges[t].camera1);
    }
    const size_t r = t - NumEdges();
    return x.points.col(track_of_ray_[r]) - x.cameras.col(problem_.rays[r].camera);
  }

  const DirectionProblem& problem_;
  const FitWeights& weights_;
  double edge_huber_;
  double ray_huber_;
  int num_threads_;
  std::vector<int> track_of_ray_;
  FitModels models_;
};

}  // namespace

FitResult FitPositions(const DirectionProblem& problem, const FitWeights& weights,
                       PositionSystem& system, Positions& positions, const RunContext& run) {
  Fit fit(problem, weights, run.num_threads);
  FitResult result;
  double cost = result.initial_cost = fit.Cost(positions);
  double damping = kInitialDamping;
  double growth = 2;
  bool has_moved = true;
  while (result.num_iterations < weights.max_iterations && !run.monitor.StopRequested()) {
    ++result.num_iterations;
    if (std::exchange(has_moved, false)) {
      fit.Linearize(positions);
      system.Restart(positions.cameras);
    }
    Positions step;
    double next_cost = std::numeric_limits<double>::infinity();
    Positions next;
    if (system.Solve(fit.Models(), damping, step)) {
      next = {positions.cameras + step.cameras, positions.points + step.points};
      next_cost = fit.Cost(next);
      if (!(next_cost <= cost)) {  // points with wrong rays must not hold back all others
        fit.ShortenStepsOfPoints(positions, next);
        next_cost = fit.Cost(next);
      }
    }
    if (!(next_cost <= cost)) {  // Nielsen 1999: damping grows ever faster
      damping *= growth;
      growth *= 2;
      if (damping > kMaxDamping) {
        result.converged = true;  // no step makes it better
        break;
      }
      continue;
    }
    const double decrease = cost - next_cost;
    positions = std::move(next);
    has_moved = true;
    cost = next_cost;
    damping = std::max(damping / 5, system.MinDamping());
    growth = 2;
    if (decrease <= weights.tolerance * cost || cost < 1e-20) {
      result.converged = true;
      break;
    }
  }
  result.final_cost = cost;
  return result;
}

}  // namespace cairn
