#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "graph/graph.h"
#include "rotation_averaging/stages.h"

namespace cairn {
namespace {

// A camera moves only to a rotation that has this much more support, so that rounds end.
constexpr double kMinGain = 1.05;
constexpr int kMaxTried = 32;
constexpr int kLookAhead = 512;  // cameras that threads look at together

// Moves cameras one after the other, each with all moves before it in sight. Threads look ahead at
// a block of them; where a neighbor moves meanwhile, the camera is looked at again.
class CameraVote {
 public:
  CameraVote(const RotationProblem& problem, double sigma, int num_threads,
             std::vector<Eigen::Quaterniond>& cam_from_world)
      : problem_(problem),
        sigma_(sigma),
        num_threads_(problem.NumEdges() < kMinParallelEdges ? 1 : num_threads),
        cam_from_world_(cam_from_world),
        is_open_(problem.NumNodes(), 1),
        is_known_(problem.NumNodes(), 0),
        moves_(problem.NumNodes()) {}

  // True: a camera moved.
  bool RunRound() {
    bool has_moved = false;
    for (int begin = 0; begin < problem_.NumNodes(); begin += kLookAhead) {
      const int end = std::min(problem_.NumNodes(), begin + kLookAhead);
      if (num_threads_ != 1) LookAhead(begin, end);
      for (int v = begin; v < end; ++v) has_moved |= is_open_[v] && Decide(v);
    }
    return has_moved;
  }

 private:
  void LookAhead(int begin, int end) {
    ParallelFor(
        num_threads_, end - begin,
        [&](int64_t k) {
          const int v = begin + static_cast<int>(k);
          if (is_open_[v]) moves_[v] = MoveOf(v);
          is_known_[v] = is_open_[v];
        },
        16);
  }

  bool Decide(int v) {
    if (!is_known_[v]) moves_[v] = MoveOf(v);
    is_open_[v] = 0;
    if (!moves_[v]) return false;
    cam_from_world_[v] = *moves_[v];
    for (const int other : problem_.adjacency.NeighborsOf(v)) {
      is_open_[other] = 1;
      is_known_[other] = 0;
    }
    return true;
  }

  // The rotation of an edge that most edges agree on, if it has much more support than the present
  // one. Of many edges' some, evenly spread, are tried.
  std::optional<Eigen::Quaterniond> MoveOf(int v) const {
    const std::span<const int> edges = problem_.adjacency.EdgesOf(v);
    const Eigen::Index num = std::ssize(edges), num_tried = std::min<Eigen::Index>(num, kMaxTried);
    Eigen::MatrixX4d asked(num, 4);  // quaternions
    Eigen::ArrayXd trust(num);
    for (Eigen::Index k = 0; k < num; ++k) {
      const auto [node1, node2] = problem_.edges[edges[k]];
      const Eigen::Quaterniond& q = problem_.relative[edges[k]];
      asked.row(k) =
          (node2 == v ? q * cam_from_world_[node1] : q.conjugate() * cam_from_world_[node2])
              .coeffs();
      trust[k] = problem_.trust[edges[k]];
    }
    const auto support_of = [&](const Eigen::Vector4d& tried) {
      const Eigen::ArrayXd cos_half = asked * tried;
      return (trust / SupportLoss(cos_half, sigma_)).sum();
    };
    double most = kMinGain * support_of(cam_from_world_[v].coeffs());
    std::optional<Eigen::Quaterniond> move;
    for (Eigen::Index k = 0; k < num_tried; ++k) {
      const Eigen::Vector4d tried = asked.row(k * num / num_tried);
      const double support = support_of(tried);
      if (support <= most) continue;
      most = support;
      move = Eigen::Quaterniond(tried).normalized();
    }
    return move;
  }

  const RotationProblem& problem_;
  const double sigma_;
  const int num_threads_;
  std::vector<Eigen::Quaterniond>& cam_from_world_;
  std::vector<char> is_open_;   // a neighbor has moved since the camera was decided
  std::vector<char> is_known_;  // its move is that of the present rotations
  std::vector<std::optional<Eigen::Quaterniond>> moves_;
};

}  // namespace

void RunConsensusStage(const RotationProblem& problem, const RotationAveragingOptions& options,
                       const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world) {
  CameraVote vote(problem, DegToRad(options.sigma_start_deg), run.num_threads, cam_from_world);
  for (int k = 0; k < options.max_consensus_rounds && !run.monitor.StopRequested(); ++k) {
    if (!vote.RunRound()) break;
  }
}

}  // namespace cairn
