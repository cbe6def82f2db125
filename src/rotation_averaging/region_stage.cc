#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "rotation_averaging/stages.h"

namespace cairn {
namespace {

constexpr size_t kMaxTurns = 32;  // tried in a round
constexpr size_t kMaxProposals = 1024;
constexpr size_t kMaxVoters = 1 << 13;
// Edges with a smaller share of their trust as support ask for turns.
constexpr double kBadShare = 0.5;
// Every edge conducts at least that, relative to a perfect one.
constexpr double kMinConductance = 1e-3;
// Potentials only order the cameras.
constexpr double kTolerance = 0.1;
// What an edge counts that no loop confirms.
constexpr double kMinWitness = 0.05;
constexpr int kGrain = 4096;  // edges a task

// Turns regions of cameras: R <- R * turn for all cameras of one.
class RegionTurner {
 public:
  RegionTurner(RotationProblem problem, double sigma, const RunContext& run,
               LaplacianSolver& solver, std::vector<Eigen::Quaterniond>& cam_from_world)
      : problem_(std::move(problem)),
        sigma_(sigma),
        run_(run),
        solver_(solver),
        cam_from_world_(cam_from_world),
        // (What one camera's edges can gain is left to the consensus of single ones.)
        min_gain_(0.2 * std::accumulate(problem_.trust.begin(), problem_.trust.end(), 0.0) /
                  problem_.NumNodes()),
        misfit_(problem_.NumEdges()),
        support_(problem_.NumEdges()) {}

  // True: a region was turned.
  bool RunRound() {
    if (TryTurns()) return true;
    failed_.clear();  // What brought nothing before may gain now.
    return TryTurns();
  }

 private:
  struct Region {
    std::vector<int> cameras;
    double gain = 0;
  };

  bool TryTurns() {
    UpdateMisfits();
    const std::vector<int> bad = BadEdges();
    const std::vector<Eigen::Quaterniond> turns = FindTurns(bad);
    if (turns.empty()) return false;
    const Eigen::MatrixXd potentials = FindPotentials(bad, turns);
    std::vector<Region> regions(turns.size());
    const auto find = [&](int64_t k) { regions[k] = FindRegion(turns[k], potentials.col(k)); };
    ParallelFor(run_.num_threads, std::ssize(turns), find, 1);
    bool has_turned = false;
    for (size_t k = 0; k < turns.size(); ++k) {
      if (regions[k].gain > min_gain_ && has_turned) find(static_cast<int64_t>(k));
      if (regions[k].gain > min_gain_) {
        Turn(regions[k], turns[k]);
        has_turned = true;
      } else {
        failed_.push_back(turns[k]);
      }
    }
    return has_turned;
  }

  // Support of an edge by the cosine of half of its error.
  double SupportOf(int e, double cos_half) const {
    const double squared_angle = 4.0 * std::max(0.0, 1.0 - cos_half * cos_half);
    return problem_.trust[e] / (1.0 + squared_angle / (sigma_ * sigma_));
  }
  // If only the first, or the second, of its cameras turns.
  double IfFirstTurns(int e, const Eigen::Quaterniond& turn) const {
    return SupportOf(e, turn.conjugate().dot(misfit_[e]));
  }
  double IfSecondTurns(int e, const Eigen::Quaterniond& turn) const {
    return SupportOf(e, turn.dot(misfit_[e]));
  }

  void UpdateMisfits() {
    const auto update = [&](int64_t e) {
      const auto [node1, node2] = problem_.edges[e];
      misfit_[e] =
          cam_from_world_[node2].conjugate() * problem_.relative[e] * cam_from_world_[node1];
      support_[e] = SupportOf(static_cast<int>(e), misfit_[e].w());
    };
    ParallelFor(run_.num_threads, problem_.NumEdges(), update, kGrain);
  }

  std::vector<int> BadEdges() const {
    std::vector<int> bad;
    for (int e = 0; e < problem_.NumEdges(); ++e) {
      if (support_[e] < kBadShare * problem_.trust[e]) bad.push_back(e);
    }
    return bad;
  }

  bool IsNear(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) const {
    return std::abs(a.dot(b)) > std::cos(sigma_) ||
           std::abs(a.conjugate().dot(b)) > std::cos(sigma_);
  }

  // Turns that many bad edges ask for, the most wanted first: none that failed, and no small ones.
  std::vector<Eigen::Quaterniond> FindTurns(const std::vector<int>& bad) const {
    std::vector<std::pair<double, int>> ranked(std::min(bad.size(), kMaxProposals));
    const size_t step = 1 + bad.size() / kMaxVoters;
    const auto rank = [&](int64_t k) {
      const int proposed = bad[k * bad.size() / ranked.size()];
      double wanted = 0;
      for (size_t i = 0; i < bad.size(); i += step) {
        wanted +=
            IfFirstTurns(bad[i], misfit_[proposed]) + IfSecondTurns(bad[i], misfit_[proposed]);
      }
      ranked[k] = {-wanted, proposed};
    };
    ParallelFor(run_.num_threads, std::ssize(ranked), rank, 1);
    std::sort(ranked.begin(), ranked.end());
    std::vector<Eigen::Quaterniond> turns;
    for (const std::pair<double, int>& proposed : ranked) {
      const Eigen::Quaterniond& turn = misfit_[proposed.second];
      const auto is_near = [&](const Eigen::Quaterniond& other) { return IsNear(other, turn); };
      if (is_near(Eigen::Quaterniond::Identity()) ||
          std::any_of(turns.begin(), turns.end(), is_near) ||
          std::any_of(failed_.begin(), failed_.end(), is_near)) {
        continue;
      }
      turns.push_back(turn);
      if (turns.size() == kMaxTurns) break;
    }
    ParallelFor(
        run_.num_threads, std::ssize(turns),
        [&](int64_t k) { turns[k] = MeanOfBad(bad, turns[k]); }, 1);
    return turns;
  }

  // The mean of what bad edges ask for near a turn.
  Eigen::Quaterniond MeanOfBad(const std::vector<int>& bad, Eigen::Quaterniond turn) const {
    const size_t step = 1 + bad.size() / (4 * kMaxVoters);
    for (int k = 0; k < 2; ++k) {
      Eigen::Vector4d sum = Eigen::Vector4d::Zero();
      const auto add = [&](const Eigen::Quaterniond& asked, double support, double trust) {
        const double weight = support * support / trust;
        sum += (asked.dot(turn) < 0 ? -weight : weight) * asked.coeffs();
      };
      for (size_t i = 0; i < bad.size(); i += step) {
        const int e = bad[i];
        add(misfit_[e], IfSecondTurns(e, turn), problem_.trust[e]);
        add(misfit_[e].conjugate(), IfFirstTurns(e, turn), problem_.trust[e]);
      }
      turn = Eigen::Quaterniond(sum).normalized();
    }
    return turn;
  }

  // For each turn, potentials of the cameras: bad edges that the turn would mend push their ends
  // apart, and edges conduct as they hold their ends together.
  Eigen::MatrixXd FindPotentials(const std::vector<int>& bad,
                                 const std::vector<Eigen::Quaterniond>& turns) {
    Eigen::MatrixXd push = Eigen::MatrixXd::Zero(problem_.NumNodes(), std::ssize(turns));
    const auto fill = [&](int64_t k) {
      for (const int e : bad) {
        const double by_first = IfFirstTurns(e, turns[k]), by_second = IfSecondTurns(e, turns[k]);
        const double flow = by_second > by_first ? by_second : -by_first;
        push(problem_.edges[e].node2, k) += flow;
        push(problem_.edges[e].node1, k) -= flow;
      }
    };
    ParallelFor(run_.num_threads, std::ssize(turns), fill, 1);
    std::vector<double> conductance(problem_.NumEdges());
    for (int e = 0; e < problem_.NumEdges(); ++e) {
      conductance[e] = std::max(support_[e], kMinConductance * problem_.trust[e]);
    }
    if (!solver_.Factorize(conductance)) return push;
    return solver_.Solve(push, {}, kTolerance);
  }

  // Of the cameras in the order of their potential, so many that support gains the most.
  Region FindRegion(const Eigen::Quaterniond& turn, const Eigen::VectorXd& potential) const {
    std::vector<int> order(problem_.NumNodes()), rank(problem_.NumNodes());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return potential[a] > potential[b]; });
    for (size_t k = 0; k < order.size(); ++k) rank[order[k]] = static_cast<int>(k);
    // An edge's support changes when one of its cameras turns, and is back when both have.
    std::vector<double> change(problem_.NumNodes(), 0.0);
    for (int e = 0; e < problem_.NumEdges(); ++e) {
      const int rank1 = rank[problem_.edges[e].node1], rank2 = rank[problem_.edges[e].node2];
      const double apart = rank1 < rank2 ? IfFirstTurns(e, turn) : IfSecondTurns(e, turn);
      change[std::min(rank1, rank2)] += apart - support_[e];
      change[std::max(rank1, rank2)] -= apart - support_[e];
    }
    double gain = 0, most = 0;
    size_t size = 0;
    for (size_t k = 0; k < order.size(); ++k) {
      gain += change[k];
      if (gain <= most) continue;
      most = gain;
      size = k + 1;
    }
    order.resize(size);
    return {std::move(order), most};
  }

  void Turn(const Region& region, const Eigen::Quaterniond& turn) {
    for (const int v : region.cameras) {
      cam_from_world_[v] = (cam_from_world_[v] * turn).normalized();
    }
    UpdateMisfits();
  }

  const RotationProblem problem_;
  const double sigma_;
  const RunContext& run_;
  LaplacianSolver& solver_;
  std::vector<Eigen::Quaterniond>& cam_from_world_;
  const double min_gain_;
  std::vector<Eigen::Quaterniond> misfit_;  // R_2^T R_21 R_1 of each edge
  std::vector<double> support_;             // of each edge
  std::vector<Eigen::Quaterniond> failed_;  // turns that have brought nothing
};

// Edges that close loops with each other are right or wrong together: of so many as agree, as of so
// many measurements of one thing, the square root counts. An edge that closes none is not trusted.
RotationProblem WithIndependentTrust(RotationProblem problem, std::span<const double> num_loops) {
  for (int e = 0; e < problem.NumEdges(); ++e) {
    problem.trust[e] *= std::max(kMinWitness, std::sqrt(num_loops[e]) / (1.0 + num_loops[e]));
  }
  return problem;
}

}  // namespace

int RunRegionStage(const RotationProblem& problem, std::span<const double> num_loops,
                   const RotationAveragingOptions& options, const RunContext& run,
                   LaplacianSolver& solver, std::vector<Eigen::Quaterniond>& cam_from_world) {
  RotationAveragingOptions smoothing = options;
  smoothing.sigma_end_deg = options.sigma_start_deg;
  smoothing.max_irls_iterations = std::min(2, options.max_irls_iterations);
  RegionTurner turner(WithIndependentTrust(problem, num_loops), DegToRad(options.sigma_start_deg),
                      run, solver, cam_from_world);
  int num_rounds = 0;
  while (num_rounds < options.max_region_rounds && !run.monitor.StopRequested()) {
    if (!turner.RunRound()) break;
    ++num_rounds;
    RunConsensusStage(problem, options, run, cam_from_world);
    RunIrlsStage(problem, smoothing, run, solver, cam_from_world);
  }
  return num_rounds;
}

}  // namespace cairn
