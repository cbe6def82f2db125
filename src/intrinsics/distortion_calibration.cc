#include "cairn/intrinsics/distortion_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "cairn/base/parallel.h"
#include "cairn/math/levenberg_marquardt.h"
#include "intrinsics/distorted_pair.h"
#include "intrinsics/sparse_normals.h"

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
constexpr double kScanScale = 3.0;     // of the loss while scanning, thresholds of verification
constexpr double kNoiseScale = 3.0;    // of the loss afterwards, standard deviations of the noise
constexpr int kScanIterations = 12;    // of F, from one value of the scan to the next
constexpr int kRefineIterations = 10;  // of F, from one step of k to the next
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
  double threshold_px = 1.0;
  double sigma_px = 1.0;
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
  Problem(const std::map<camera_t, Camera>& cameras, const std::set<camera_t>& held,
          std::span<const DistortionPair> pairs, int num_threads);

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

  void Scan();
  void ScanTerm(Term& term) const;
  Eigen::VectorXd BestOfScan() const;
  Distortions StartFrom(Eigen::VectorXd x);
  // Every term's normal equations over its distortions, after its F has been refined under them.
  std::vector<NormalEquations<2>> Evaluate(Distortions& at);
  SparseNormals Sum(const std::vector<NormalEquations<2>>& terms) const;
  void Judge(Distortions at);
  void TakeSignificant(Distortions at);

  const std::map<camera_t, Camera>& all_cameras_;
  const std::set<camera_t>& held_;
  const int num_threads_;
  std::map<camera_t, int> variable_of_;
  std::vector<camera_t> camera_ids_;  // by variable
  std::vector<const Camera*> cameras_;
  std::vector<Term> terms_;
  DistortionCalibrationReport report_;
};

Problem::Problem(const std::map<camera_t, Camera>& cameras, const std::set<camera_t>& held,
                 std::span<const DistortionPair> pairs, int num_threads)
    : all_cameras_(cameras), held_(held), num_threads_(num_threads) {
  for (const DistortionPair& pair : pairs) {
    auto F = FundamentalFactors::Of(pair.F);
    if (!F || pair.pixels1.size() < kMinMatches) continue;
    const Camera &camera1 = cameras.at(pair.camera_id1), &camera2 = cameras.at(pair.camera_id2);
    Term& term = terms_.emplace_back(DistortedPair(pair, camera1, camera2), std::move(*F));
    term.variable1 = Variable(pair.camera_id1);
    term.variable2 = Variable(pair.camera_id2);
    term.threshold_px = DefaultMaxErrorPx(camera1, camera2);
  }
}

int Problem::Variable(camera_t id) {
  const auto [it, is_new] = variable_of_.try_emplace(id, -1);
  const Camera& camera = all_cameras_.at(id);
  if (is_new && held_.count(id) == 0 && CanCalibrateDistortion(camera)) {
    it->second = static_cast<int>(camera_ids_.size());
    camera_ids_.push_back(id);
    cameras_.push_back(&camera);
  }
  return it->second;
}

// Both cameras together, from no distortion outwards, so that each F begins near its end.
void Problem::ScanTerm(Term& term) const {
  const double scale_px = kScanScale * term.threshold_px;
  FundamentalFactors F = term.F;
  for (size_t i = 0; i < kScan.size(); ++i) {
    if (i == kFirstPositive) F = term.scan_fits[0];
    SetDistortion(term, kScan[i], kScan[i]);
    term.scan_costs[i] = term.pair.Refine(scale_px, kScanIterations, &F);
    term.scan_fits[i] = F;
  }
}

void Problem::Scan() {
  ForTerms([this](Term& term) { ScanTerm(term); });
}

Eigen::VectorXd Problem::BestOfScan() const {
  std::vector<std::array<double, kScan.size()>> costs(camera_ids_.size());
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
    const double scale_px = kScanScale * term.threshold_px;
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
  const std::ptrdiff_t n = std::ssize(camera_ids_);
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
  // Where no match tells, the range of the scan.
  for (int v = 0; v < n; ++v) entries.emplace_back(v, v, 1.0);
  sum.hessian.resize(n, n);
  sum.hessian.setFromTriplets(entries.begin(), entries.end());
  return sum;
}

void Problem::Judge(Distortions at) {
  const std::vector<NormalEquations<2>> evaluations = Evaluate(at);
  // Without the distortion of one of its cameras.
  std::vector<std::array<double, 2>> costs(terms_.size());
  std::vector<int> num_explained(terms_.size());
  ParallelFor(num_threads_, std::ssize(terms_), [&](int64_t i) {
    Term& term = terms_[i];
    num_explained[i] = term.pair.NumExplained(at.F[i], kNoiseScale * term.sigma_px);
    const bool is_one = term.variable1 == term.variable2;
    for (int side = 0; side < 2; ++side) {
      SetDistortion(term, side == 0 || is_one ? 0.0 : At(at.x, term.variable1),
                    side == 1 || is_one ? 0.0 : At(at.x, term.variable2));
      double cost = INFINITY;
      for (FundamentalFactors F : {at.F[i], term.scan_fits[0]}) {
        cost = std::min(cost, term.pair.Refine(kNoiseScale * term.sigma_px, 20, &F));
      }
      costs[i][side] = kChiSquares * cost;
    }
  });
  const SparseNormals sum = Sum(evaluations);
  std::vector<double> scatter(camera_ids_.size(), 0.0), expected(camera_ids_.size(), 0.0);
  std::vector<CalibratedDistortion> found(camera_ids_.size());
  for (size_t i = 0; i < terms_.size(); ++i) {
    const Term& term = terms_[i];
    const bool is_one = term.variable1 == term.variable2;
    for (int side = 0; side < (is_one ? 1 : 2); ++side) {
      const int v = side == 0 ? term.variable1 : term.variable2;
      if (v < 0) continue;
      const auto& [hessian, gradient, cost] = evaluations[i];
      scatter[v] += std::pow(is_one ? gradient.sum() : gradient[side], 2);
      expected[v] += is_one ? hessian.sum() : hessian(side, side);
      found[v].gain += 0.5 * (costs[i][side] - cost);
      found[v].num_matches += num_explained[i];
      ++found[v].num_pairs;
    }
  }
  for (size_t v = 0; v < found.size(); ++v) {
    CalibratedDistortion& camera = found[v];
    const double n = camera.num_pairs;
    const double excess =
        n < 2 ? 1.0 : std::max(1.0, n / (n - 1) * scatter[v] / std::max(expected[v], 1e-300));
    camera.k = K(static_cast<int>(v), at.x[static_cast<Eigen::Index>(v)]);
    camera.sigma =
        K(static_cast<int>(v), std::sqrt(excess * sum.LocalVariance(static_cast<Eigen::Index>(v))));
    camera.gain /= excess;
    const double num = std::max(1.0, static_cast<double>(camera.num_matches));
    camera.cost = 0.5 * std::log(num) + 0.5 * kSystematic * kSystematic * num;
    camera.is_significant = camera.num_pairs >= kMinPairs && camera.gain > camera.cost;
    report_.cameras[camera_ids_[v]] = camera;
  }
}

void Problem::TakeSignificant(Distortions at) {
  for (Eigen::Index v = 0; v < at.x.size(); ++v) {
    if (!report_.cameras.at(camera_ids_[v]).is_significant) at.x[v] = 0.0;
  }
  std::vector<FocalPair> pairs(terms_.size());
  ParallelFor(num_threads_, std::ssize(terms_), [&](int64_t i) {
    Term& term = terms_[i];
    const double scale_px = kNoiseScale * term.sigma_px;
    SetDistortion(term, At(at.x, term.variable1), At(at.x, term.variable2));
    term.pair.Refine(scale_px, 20, &at.F[i]);
    pairs[i] = term.pair.Explained(at.F[i], scale_px, kMaxFocalMatches);
  });
  for (FocalPair& pair : pairs) {
    if (!pair.pixels1.empty()) report_.pairs.push_back(std::move(pair));
  }
}

DistortionCalibrationReport Problem::Solve() {
  if (terms_.empty()) return {};
  Scan();
  constexpr LevenbergMarquardtOptions kOptions{kMaxSteps, kMinRelativeGain};
  Distortions at = StartFrom(BestOfScan());
  Minimize(*this, kOptions, &at);
  for (size_t i = 0; i < terms_.size(); ++i) {
    terms_[i].sigma_px = terms_[i].pair.NoisePx(at.F[i], terms_[i].threshold_px);
  }
  Minimize(*this, kOptions, &at);
  Judge(at);
  TakeSignificant(std::move(at));
  return std::move(report_);
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
                                                const std::set<camera_t>& held,
                                                std::span<const DistortionPair> pairs,
                                                const RunContext& run) {
  return Problem(cameras, held, pairs, run.num_threads).Solve();
}

}  // namespace cairn
