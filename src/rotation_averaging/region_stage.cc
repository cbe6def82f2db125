#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "math/sorted_order.h"
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
constexpr int kGrain = 1024;  // edges a task, and at once

// What edges ask for: R_2^T R_21 R_1 of each, a turn of the second camera, or its inverse of the
// first. In columns, for arithmetic on several edges at once.
struct Misfits {
  Eigen::ArrayXd w;
  Eigen::MatrixX3d v;
  Eigen::ArrayXd trust;

  explicit Misfits(Eigen::Index num_edges) : w(num_edges), v(num_edges, 3), trust(num_edges) {}

  // Every `step`-th of some edges.
  Misfits Of(std::span<const int> edges, size_t step) const {
    Misfits some(static_cast<Eigen::Index>((edges.size() + step - 1) / step));
    for (Eigen::Index k = 0; k < some.w.size(); ++k) {
      const int e = edges[k * step];
      some.w[k] = w[e];
      some.v.row(k) = v.row(e);
      some.trust[k] = trust[e];
    }
    return some;
  }
  Eigen::Quaterniond TurnOf(Eigen::Index e) const { return {w[e], v(e, 0), v(e, 1), v(e, 2)}; }
};

// Edges that close loops with each other are right or wrong together: of so many as agree, as of so
// many measurements of one thing, the square root counts. An edge that closes none is not trusted.
Eigen::ArrayXd IndependentTrust(const RotationGraph& graph) {
  Eigen::ArrayXd trust(graph.problem.NumEdges());
  for (Eigen::Index e = 0; e < trust.size(); ++e) {
    const double num_loops = graph.num_loops[e];
    trust[e] =
        graph.problem.trust[e] * std::max(kMinWitness, std::sqrt(num_loops) / (1 + num_loops));
  }
  return trust;
}

// Turns regions of cameras: R <- R * turn for all cameras of one.
class RegionTurner {
 public:
  RegionTurner(RotationGraph& graph, double sigma, const RunContext& run,
               std::vector<Eigen::Quaterniond>& cam_from_world)
      : problem_(graph.problem),
        solver_(graph.solver),
        sigma_(sigma),
        run_(run),
        cam_from_world_(cam_from_world),
        misfits_(problem_.NumEdges()) {
    misfits_.trust = IndependentTrust(graph);
    // (What one camera's edges can gain is left to the consensus of single ones.)
    min_gain_ = 0.2 * misfits_.trust.sum() / problem_.NumNodes();
  }

  // True: a region was turned.
  bool RunRound() {
    const auto num_failed = std::ssize(failed_);
    if (TryTurns({})) return true;
    // What brought nothing before may gain now; what was tried just now will not.
    const std::vector<Eigen::Quaterniond> in_vain(failed_.begin() + num_failed, failed_.end());
    failed_.clear();
    return TryTurns(in_vain);
  }

 private:
  struct Region {
    std::vector<int> cameras;
    double gain = 0;
  };

  bool TryTurns(std::span<const Eigen::Quaterniond> in_vain) {
    UpdateMisfits();
    const std::vector<int> bad = BadEdges();
    std::vector<Eigen::Quaterniond> turns = FindTurns(bad);
    std::erase_if(turns, [&](const Eigen::Quaterniond& turn) {
      return std::find(in_vain.begin(), in_vain.end(), turn) != in_vain.end();
    });
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

  // The cosine of half of an edge's error is w * w' - v * v' with its misfit and the turn of its
  // first camera, and w * w' + v * v' with that of the second.
  template <typename T>
  auto Loss(const T& cos_half) const {
    return SupportLoss(cos_half, sigma_);
  }

  void UpdateMisfits() {
    const auto update = [&](int64_t e) {
      const auto [node1, node2] = problem_.edges[e];
      const Eigen::Quaterniond misfit =
          cam_from_world_[node2].conjugate() * problem_.relative[e] * cam_from_world_[node1];
      misfits_.w[e] = misfit.w();
      misfits_.v.row(e) = misfit.vec();
    };
    ParallelFor(run_.num_threads, problem_.NumEdges(), update, kGrain);
    support_ = misfits_.trust / Loss(misfits_.w);
  }

  std::vector<int> BadEdges() const {
    std::vector<int> bad;
    for (int e = 0; e < problem_.NumEdges(); ++e) {
      if (support_[e] < kBadShare * misfits_.trust[e]) bad.push_back(e);
    }
    return bad;
  }

  bool IsNear(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) const {
    return std::max(std::abs(a.dot(b)), std::abs(a.conjugate().dot(b))) > std::cos(sigma_);
  }

  // Turns that many bad edges ask for, the most wanted first: none that failed, and no small ones.
  std::vector<Eigen::Quaterniond> FindTurns(const std::vector<int>& bad) const {
    std::vector<std::pair<double, int>> ranked(std::min(bad.size(), kMaxProposals));
    const Misfits voters = misfits_.Of(bad, 1 + bad.size() / kMaxVoters);
    const auto rank = [&](int64_t k) {
      const int proposed = bad[k * bad.size() / ranked.size()];
      const Eigen::Quaterniond turn = misfits_.TurnOf(proposed);
      const Eigen::ArrayXd w = turn.w() * voters.w, v = voters.v * turn.vec();
      const double wanted = (voters.trust / Loss(w - v) + voters.trust / Loss(w + v)).sum();
      ranked[k] = {-wanted, proposed};
    };
    ParallelFor(run_.num_threads, std::ssize(ranked), rank, 1);
    std::sort(ranked.begin(), ranked.end());
    std::vector<Eigen::Quaterniond> turns;
    for (const std::pair<double, int>& proposed : ranked) {
      const Eigen::Quaterniond turn = misfits_.TurnOf(proposed.second);
      const auto is_near = [&](const Eigen::Quaterniond& other) { return IsNear(other, turn); };
      if (is_near(Eigen::Quaterniond::Identity()) || std::ranges::any_of(turns, is_near) ||
          std::ranges::any_of(failed_, is_near)) {
        continue;
      }
      turns.push_back(turn);
      if (turns.size() == kMaxTurns) break;
    }
    const Misfits askers = misfits_.Of(bad, 1 + bad.size() / (4 * kMaxVoters));
    const auto refine = [&](int64_t k) { turns[k] = MeanOf(askers, turns[k]); };
    ParallelFor(run_.num_threads, std::ssize(turns), refine, 1);
    return turns;
  }

  // The mean of what edges ask for near a turn.
  Eigen::Quaterniond MeanOf(const Misfits& askers, Eigen::Quaterniond turn) const {
    for (int k = 0; k < 2; ++k) {
      const Eigen::ArrayXd w = turn.w() * askers.w, v = askers.v * turn.vec();
      const Eigen::ArrayXd by_first = (w - v).sign() * askers.trust / Loss(w - v).square();
      const Eigen::ArrayXd by_second = (w + v).sign() * askers.trust / Loss(w + v).square();
      turn.w() = ((by_second + by_first) * askers.w).sum();
      turn.vec() = askers.v.transpose() * (by_second - by_first).matrix();
      turn.normalize();
    }
    return turn;
  }

  // For each turn, potentials of the cameras: bad edges that the turn would mend push their ends
  // apart, and edges conduct as they hold their ends together.
  Eigen::MatrixXd FindPotentials(const std::vector<int>& bad,
                                 const std::vector<Eigen::Quaterniond>& turns) {
    Eigen::MatrixXd push = Eigen::MatrixXd::Zero(problem_.NumNodes(), std::ssize(turns));
    const Misfits pushed = misfits_.Of(bad, 1);
    const auto fill = [&](int64_t k) {
      const Eigen::ArrayXd w = turns[k].w() * pushed.w, v = pushed.v * turns[k].vec();
      const Eigen::ArrayXd flow = (w * v).sign() * pushed.trust / Loss(w.abs() + v.abs());
      for (size_t i = 0; i < bad.size(); ++i) {
        const auto [node1, node2] = problem_.edges[bad[i]];
        push(node2, k) += flow[i];
        push(node1, k) -= flow[i];
      }
    };
    ParallelFor(run_.num_threads, std::ssize(turns), fill, 1);
    const Eigen::ArrayXd conductance = support_.max(kMinConductance * misfits_.trust);
    if (!solver_.Factorize({conductance.data(), conductance.data() + conductance.size()})) {
      return push;
    }
    return solver_.Solve(push, {}, kTolerance);
  }

  // Of the cameras in the order of their potential, so many that support gains the most.
  Region FindRegion(const Eigen::Quaterniond& turn, const Eigen::VectorXd& potential) const {
    std::vector<int> order =
        SortedOrder(problem_.NumNodes(), [&](int node) { return -potential[node]; });
    Eigen::ArrayXi rank(problem_.NumNodes());
    for (size_t k = 0; k < order.size(); ++k) rank[order[k]] = static_cast<int>(k);
    const Eigen::ArrayXd change = ChangesBy(turn, rank);
    double gain = 0, most = 0;
    size_t size = 0;
    for (size_t k = 0; k < order.size(); ++k) {
      gain += change[order[k]];
      if (gain <= most) continue;
      most = gain;
      size = k + 1;
    }
    order.resize(size);
    return {std::move(order), most};
  }

  // Of support by each camera, where they turn one after the other by their rank. An edge's support
  // changes when one of its cameras turns, and is back when both have.
  Eigen::ArrayXd ChangesBy(const Eigen::Quaterniond& turn, const Eigen::ArrayXi& rank) const {
    Eigen::ArrayXd change = Eigen::ArrayXd::Zero(rank.size());
    // 1: the first camera turns before the second; -1: after it.
    Eigen::ArrayXd side(kGrain), gain(kGrain);
    for (int begin = 0; begin < problem_.NumEdges(); begin += kGrain) {
      const int num = std::min(kGrain, problem_.NumEdges() - begin);
      const GraphEdge* edges = &problem_.edges[begin];
      for (int k = 0; k < num; ++k) {
        side[k] = 2 * static_cast<int>(rank[edges[k].node1] < rank[edges[k].node2]) - 1;
      }
      const auto v = misfits_.v.middleRows(begin, num).lazyProduct(turn.vec()).array();
      const auto cos_half = turn.w() * misfits_.w.segment(begin, num) - side.head(num) * v;
      gain.head(num) = side.head(num) * (misfits_.trust.segment(begin, num) / Loss(cos_half) -
                                         support_.segment(begin, num));
      double sum = 0;  // of edges of one first camera, which follow each other
      for (int k = 0; k < num; ++k) {
        change[edges[k].node2] -= gain[k];
        sum += gain[k];
        if (k + 1 < num && edges[k + 1].node1 == edges[k].node1) continue;
        change[edges[k].node1] += sum;
        sum = 0;
      }
    }
    return change;
  }

  void Turn(const Region& region, const Eigen::Quaterniond& turn) {
    for (const int v : region.cameras) {
      cam_from_world_[v] = (cam_from_world_[v] * turn).normalized();
    }
    UpdateMisfits();
  }

  const RotationProblem& problem_;
  LaplacianSolver& solver_;
  const double sigma_;
  const RunContext& run_;
  std::vector<Eigen::Quaterniond>& cam_from_world_;
  double min_gain_ = 0;
  Misfits misfits_;
  Eigen::ArrayXd support_;                  // of each edge
  std::vector<Eigen::Quaterniond> failed_;  // turns that have brought nothing
};

}  // namespace

void RunRegionStage(RotationGraph& graph, const RotationAveragingOptions& options,
                    const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world) {
  RotationAveragingOptions smoothing = options;
  smoothing.sigma_end_deg = options.sigma_start_deg;
  smoothing.max_irls_iterations = std::min(2, options.max_irls_iterations);
  RegionTurner turner(graph, DegToRad(options.sigma_start_deg), run, cam_from_world);
  for (int k = 0; k < options.max_region_rounds && !run.monitor.StopRequested(); ++k) {
    if (!turner.RunRound()) break;
    RunConsensusStage(graph.problem, options, run, cam_from_world);
    RunIrlsStage(graph, smoothing, run, cam_from_world);
  }
}

}  // namespace cairn
