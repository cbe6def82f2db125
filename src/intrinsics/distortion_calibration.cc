#include "intrinsics/distortion_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "cairn/base/parallel.h"
#include "intrinsics/distorted_pair.h"
#include "intrinsics/sparse_normals.h"
#include "math/levenberg_marquardt.h"

namespace cairn {
namespace {

using internal::DistortedPair;
using internal::SparseNormals;

// The share by which distortion moves a point that undistorted is half a diagonal from the center.
// A lens of |k1| = 0.3 and 0.4 image widths has 0.7; below -4/27 the corners themselves are beyond
// the fold of the model, as those of a fisheye lens are.
constexpr std::array kScan = {0.0,  -0.02, -0.05, -0.09, -0.13, -0.18, -0.25,
                              0.02, 0.06,  0.12,  0.22,  0.4,   0.7};
constexpr size_t kFirstPositive = 7;
constexpr double kScanScale = 3.0;     // of the loss while scanning, scales of errors: halves of
                                       // verification's threshold, but at least 1 px
constexpr double kNoiseScale = 3.0;    // of the loss afterwards, standard deviations of the noise
constexpr int kScanIterations = 12;    // of F, from one value of the scan to the next
constexpr int kRefineIterations = 10;  // of F, from one step of k to the next
constexpr int kJudgeIterations = 20;   // of F, where distortion has gone
constexpr int kMaxSteps = 20;
constexpr double kMinRelativeGain = 1e-7;
constexpr double kMaxStep = 0.1;  // in units of the scan
constexpr double kSmallest = -0.4, kLargest = 1.0;
// The share of a match's error that is no noise but what no single parameter describes: tangential
// and higher terms, a rolling shutter, resampling. Photographs that are free of distortion (kitti,
// dtu_scan24, llff_horns) have 0.04 to 0.08 that k would take up; lund_door, whose k is -0.034,
// 0.2.
constexpr double kSystematic = 0.1;
constexpr int kMinPairs = 3;  // fewer have no scatter to be judged by
constexpr size_t kMinMatches = 20;
constexpr int kMaxFocalMatches = 500;  // of a pair; more make its F no surer than the model is

double HalfDiagonalPx(const Camera& camera) { return 0.5 * camera.DiagonalPx(); }

// k for a value of the scan.
double KOf(const Camera& camera, double relative) {
  return relative * std::pow(camera.MeanFocal() / HalfDiagonalPx(camera), 2);
}

struct Term {
  Term(DistortedPair p, FundamentalFactors fit) : pair(std::move(p)), F(std::move(fit)) {}
  DistortedPair pair;
  FundamentalFactors F;
  int variable1 = -1, variable2 = -1;
  double error_px = 1.0;
  double sigma_px = 1.0;
  bool tells_focal = true;
  std::array<double, kScan.size()> scan_costs = {};  // each match at most 1
  std::array<FundamentalFactors, kScan.size()> scan_fits;
};

// Distortions, as values of the scan by variable, and each term's F under them.
struct Distortions {
  Eigen::VectorXd x;
  std::vector<FundamentalFactors> F;
};

// The squared scale of the loss of a match, in units of its noise: costs of that loss times this
// are squared standard deviations, twice the negative logarithm of a likelihood.
constexpr double kChiSquares = kNoiseScale * kNoiseScale;

class Problem {
 public:
  Problem(const std::map<camera_t, Camera>& cameras, const std::set<camera_t>& constant,
          const SharedLenses& shared, std::span<const DistortionPair> pairs, int num_threads);

  DistortionCalibrationReport Solve();

  // Of Levenberg and Marquardt's method.
  using State = Distortions;
  SparseNormals Linearize(Distortions& at) { return Sum(Evaluate(at)); }
  Distortions Moved(const Distortions& from, const Eigen::VectorXd& step) const {
    return {(from.x + step).cwiseMax(kSmallest).cwiseMin(kLargest), from.F};
  }
  bool Solve(const SparseNormals& model, double damping, Eigen::VectorXd* step) const {
    return model.DampedStep(damping, kMaxStep, step);
  }

 private:
  template <class Function>
  void ForTerms(const Function& function) {
    ParallelFor(num_threads_, std::ssize(terms_), [&](int64_t i) { function(terms_[i]); });
  }
  int Variable(camera_t id);
  double K(int variable, double relative) const {
    return variable < 0 ? 0.0 : KOf(*cameras_[variable], relative);
  }
  void SetDistortion(Term& term, double relative1, double relative2) const {
    term.pair.SetDistortion(K(term.variable1, relative1), K(term.variable2, relative2));
  }
  double At(const Eigen::VectorXd& x, int variable) const {
    return variable < 0 ? 0.0 : x[variable];
  }

  void ScanTerm(Term& term) const;
  Eigen::VectorXd BestOfScan() const;
  Distortions StartFrom(Eigen::VectorXd x);
  // Every term's normal equations over its distortions, after its F has been refined under them.
  std::vector<NormalEquations<2>> Evaluate(Distortions& at);
  SparseNormals Sum(const std::vector<NormalEquations<2>>& terms) const;
  void Judge(Distortions at);
  DistortionCalibrationReport TakeSignificant(Distortions at);

  const std::map<camera_t, Camera>& all_cameras_;
  const std::set<camera_t>& constant_;
  const SharedLenses& shared_;
  const int num_threads_;
  std::map<camera_t, int> variable_of_;       // of all cameras
  std::map<camera_t, int> variable_of_lens_;  // by the cameras that stand for them
  std::vector<const Camera*> cameras_;        // these, by variable
  std::vector<CalibratedDistortion> found_;   // by variable
  std::vector<Term> terms_;
};

Problem::Problem(const std::map<camera_t, Camera>& cameras, const std::set<camera_t>& constant,
                 const SharedLenses& shared, std::span<const DistortionPair> pairs, int num_threads)
    : all_cameras_(cameras), constant_(constant), shared_(shared), num_threads_(num_threads) {
  for (const DistortionPair& pair : pairs) {
    auto F = FundamentalFactors::Of(pair.F);
    if (!F || pair.pixels1.size() < kMinMatches) continue;
    const Camera &camera1 = cameras.at(pair.camera_id1), &camera2 = cameras.at(pair.camera_id2);
    Term& term = terms_.emplace_back(DistortedPair(pair, camera1, camera2), std::move(*F));
    term.variable1 = Variable(pair.camera_id1);
    term.variable2 = Variable(pair.camera_id2);
    term.error_px = DefaultSigmaPx(camera1, camera2);
    term.tells_focal = pair.tells_focal;
  }
  found_.resize(cameras_.size());
}

int Problem::Variable(camera_t id) {
  const auto [of_camera, is_new] = variable_of_.try_emplace(id, -1);
  const Camera& camera = all_cameras_.at(id);
  if (is_new && constant_.count(id) == 0 && CanCalibrateDistortion(camera)) {
    const auto lens = shared_.find(id);
    const auto [of_lens, is_first] = variable_of_lens_.try_emplace(
        lens == shared_.end() ? id : lens->second, static_cast<int>(cameras_.size()));
    if (is_first) cameras_.push_back(&camera);
    of_camera->second = of_lens->second;
  }
  return of_camera->second;
}

// Both cameras together, from no distortion outwards, so that each F begins near its end.
void Problem::ScanTerm(Term& term) const {
  const double scale_px = kScanScale * term.error_px;
  FundamentalFactors F = term.F;
  for (size_t i = 0; i < kScan.size(); ++i) {
    if (i == kFirstPositive) F = term.scan_fits[0];
    SetDistortion(term, kScan[i], kScan[i]);
    term.scan_costs[i] = term.pair.Refine(scale_px, kScanIterations, &F);
    term.scan_fits[i] = F;
  }
}

Eigen::VectorXd Problem::BestOfScan() const {
  std::vector<std::array<double, kScan.size()>> costs(cameras_.size());
  for (auto& cost : costs) cost.fill(0.0);
  for (const Term& term : terms_) {
    for (const int v : {term.variable1, term.variable2}) {
      if (v < 0) continue;
      for (size_t i = 0; i < kScan.size(); ++i) costs[v][i] += term.scan_costs[i];
    }
  }
  Eigen::VectorXd x(std::ssize(costs));
  for (Eigen::Index v = 0; v < x.size(); ++v) {
    x[v] = kScan[std::min_element(costs[v].begin(), costs[v].end()) - costs[v].begin()];
  }
  return x;
}

Distortions Problem::StartFrom(Eigen::VectorXd x) {
  ForTerms([&](Term& term) {
    const double value = At(x, term.variable1 >= 0 ? term.variable1 : term.variable2);
    const auto index = std::find(kScan.begin(), kScan.end(), value) - kScan.begin();
    term.F = term.scan_fits[index];
    const double scale_px = kScanScale * term.error_px;
    SetDistortion(term, At(x, term.variable1), At(x, term.variable2));
    term.pair.Refine(scale_px, kRefineIterations, &term.F);
    term.sigma_px = scale_px / kNoiseScale;
  });
  Distortions start{std::move(x), {}};
  for (const Term& term : terms_) start.F.push_back(term.F);
  return start;
}

std::vector<NormalEquations<2>> Problem::Evaluate(Distortions& at) {
  std::vector<NormalEquations<2>> evaluations(terms_.size());
  ParallelFor(num_threads_, std::ssize(terms_), [&](int64_t i) {
    Term& term = terms_[i];
    const double scale_px = kNoiseScale * term.sigma_px;
    SetDistortion(term, At(at.x, term.variable1), At(at.x, term.variable2));
    term.pair.Refine(scale_px, kRefineIterations, &at.F[i]);
    const NormalEquations<2> equations = term.pair.Reduce(at.F[i], scale_px);
    // By values of the scan instead of k.
    const Eigen::Vector2d units(K(term.variable1, 1.0), K(term.variable2, 1.0));
    evaluations[i].cost = kChiSquares * equations.cost;
    evaluations[i].gradient = kChiSquares * units.cwiseProduct(equations.gradient);
    evaluations[i].hessian =
        kChiSquares * units.asDiagonal() * equations.hessian * units.asDiagonal();
  });
  return evaluations;
}

SparseNormals Problem::Sum(const std::vector<NormalEquations<2>>& terms) const {
  const std::ptrdiff_t n = std::ssize(cameras_);
  SparseNormals sum;
  sum.gradient = Eigen::VectorXd::Zero(n);
  std::vector<Eigen::Triplet<double>> entries;
  for (size_t i = 0; i < terms_.size(); ++i) {
    sum.cost += terms[i].cost;
    const int variables[] = {terms_[i].variable1, terms_[i].variable2};
    for (int a = 0; a < 2; ++a) {
      if (variables[a] < 0) continue;
      sum.gradient[variables[a]] += terms[i].gradient[a];
      for (int b = 0; b < 2; ++b) {
        if (variables[b] < 0) continue;
        entries.emplace_back(variables[a], variables[b], terms[i].hessian(a, b));
      }
    }
  }
  // Where no match determines it, the range of the scan.
  for (int v = 0; v < n; ++v) entries.emplace_back(v, v, 1.0);
  sum.hessian.resize(n, n);
  sum.hessian.setFromTriplets(entries.begin(), entries.end());
  return sum;
}

void Problem::Judge(Distortions at) {
  const std::vector<NormalEquations<2>> evaluations = Evaluate(at);
  // Without the distortion of one of its lenses.
  std::vector<std::array<double, 2>> costs(terms_.size());
  std::vector<int> num_explained(terms_.size());
  ParallelFor(num_threads_, std::ssize(terms_), [&](int64_t i) {
    Term& term = terms_[i];
    num_explained[i] = term.pair.NumExplained(at.F[i], kNoiseScale * term.sigma_px);
    const bool is_one = term.variable1 == term.variable2;
    for (int side = 0; side < (is_one ? 1 : 2); ++side) {
      SetDistortion(term, side == 0 || is_one ? 0.0 : At(at.x, term.variable1),
                    side == 1 || is_one ? 0.0 : At(at.x, term.variable2));
      double cost = INFINITY;
      for (FundamentalFactors F : {at.F[i], term.scan_fits[0]}) {
        cost = std::min(cost, term.pair.Refine(kNoiseScale * term.sigma_px, kJudgeIterations, &F));
      }
      costs[i][side] = kChiSquares * cost;
    }
  });
  const SparseNormals sum = Sum(evaluations);
  std::vector<double> scatter(cameras_.size(), 0.0), expected(cameras_.size(), 0.0);
  for (size_t i = 0; i < terms_.size(); ++i) {
    const Term& term = terms_[i];
    const bool is_one = term.variable1 == term.variable2;
    for (int side = 0; side < (is_one ? 1 : 2); ++side) {
      const int v = side == 0 ? term.variable1 : term.variable2;
      if (v < 0) continue;
      const auto& [hessian, gradient, cost] = evaluations[i];
      scatter[v] += std::pow(is_one ? gradient.sum() : gradient[side], 2);
      expected[v] += is_one ? hessian.sum() : hessian(side, side);
      found_[v].gain += 0.5 * (costs[i][side] - cost);
      found_[v].num_matches += num_explained[i];
      ++found_[v].num_pairs;
    }
  }
  for (size_t v = 0; v < found_.size(); ++v) {
    CalibratedDistortion& lens = found_[v];
    const double n = lens.num_pairs;
    const double excess =
        n < 2 ? 1.0 : std::max(1.0, n / (n - 1) * scatter[v] / std::max(expected[v], 1e-300));
    const auto index = static_cast<Eigen::Index>(v);
    lens.k = K(static_cast<int>(v), at.x[index]);
    lens.sigma = K(static_cast<int>(v), std::sqrt(excess * sum.LocalVariance(index)));
    const double num = std::max(1.0, static_cast<double>(lens.num_matches));
    lens.gain = (lens.gain - 0.5 * kSystematic * kSystematic * num) / excess;
    lens.cost = 0.5 * std::log(num);
    lens.is_significant = lens.num_pairs >= kMinPairs && lens.gain > lens.cost;
  }
}

DistortionCalibrationReport Problem::TakeSignificant(Distortions at) {
  DistortionCalibrationReport report;
  for (Eigen::Index v = 0; v < at.x.size(); ++v) {
    if (!found_[v].is_significant) at.x[v] = 0.0;
  }
  for (const auto& [id, variable] : variable_of_) {
    if (variable >= 0) report.cameras[id] = found_[variable];
  }
  for (const auto& [id, first] : shared_) {
    const auto lens = variable_of_lens_.find(first);
    if (lens != variable_of_lens_.end()) report.cameras[id] = found_[lens->second];
  }
  std::vector<FocalPair> pairs(terms_.size());
  ParallelFor(num_threads_, std::ssize(terms_), [&](int64_t i) {
    Term& term = terms_[i];
    if (!term.tells_focal) return;
    const double scale_px = kNoiseScale * term.sigma_px;
    SetDistortion(term, At(at.x, term.variable1), At(at.x, term.variable2));
    term.pair.Refine(scale_px, kJudgeIterations, &at.F[i]);
    pairs[i] = term.pair.Explained(at.F[i], scale_px, kMaxFocalMatches);
  });
  for (FocalPair& pair : pairs) {
    if (!pair.pixels1.empty()) report.pairs.push_back(std::move(pair));
  }
  return report;
}

DistortionCalibrationReport Problem::Solve() {
  if (terms_.empty()) return {};
  ForTerms([this](Term& term) { ScanTerm(term); });
  constexpr LevenbergMarquardtOptions kOptions{kMaxSteps, kMinRelativeGain};
  Distortions at = StartFrom(BestOfScan());
  Minimize(*this, kOptions, &at);
  for (size_t i = 0; i < terms_.size(); ++i) {
    terms_[i].sigma_px = terms_[i].pair.NoisePx(at.F[i], terms_[i].error_px);
  }
  Minimize(*this, kOptions, &at);
  Judge(at);
  return TakeSignificant(std::move(at));
}

}  // namespace

bool CanCalibrateDistortion(const Camera& camera) {
  if (camera.model != CameraModel::kSimpleRadial && camera.model != CameraModel::kRadial &&
      camera.model != CameraModel::kOpenCV) {
    return false;
  }
  const std::vector<int> indices = camera.DistortionIndices();
  return std::all_of(indices.begin(), indices.end(),
                     [&](int i) { return camera.params[i] == 0.0; });
}

DistortionCalibrationReport CalibrateDistortion(const std::map<camera_t, Camera>& cameras,
                                                const std::set<camera_t>& constant,
                                                const SharedLenses& shared,
                                                std::span<const DistortionPair> pairs,
                                                const RunContext& run) {
  return Problem(cameras, constant, shared, pairs, run.num_threads).Solve();
}

}  // namespace cairn
