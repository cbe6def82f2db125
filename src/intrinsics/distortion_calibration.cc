#include "cairn/intrinsics/distortion_calibration.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>

#include "cairn/base/parallel.h"
#include "intrinsics/distorted_pair.h"
#include "intrinsics/focal_problem.h"

namespace cairn {
namespace {

using internal::DistortedPair;
using internal::FundamentalFit;

// The share by which distortion moves a point that undistorted is half a diagonal from the center.
// A lens of |k1| = 0.3 and 0.4 image widths has 0.7; below -4/27 the corners themselves are beyond
// the fold of the model, as those of a fisheye lens are.
constexpr std::array kScan = {0.0,  -0.02, -0.05, -0.09, -0.13, -0.18, -0.25,
                              0.02, 0.06,  0.12,  0.22,  0.4,   0.7};
constexpr size_t kFirstPositive = 7;
constexpr double kScanScale = 3.0;     // of the loss while scanning, thresholds of verification
constexpr double kNoiseScale = 3.0;    // of the loss afterwards, standard deviations of the noise
constexpr int kScanIterations = 6;     // of F, from one value of the scan to the next
constexpr int kRefineIterations = 10;  // of F, from one step of k to the next
constexpr int kMaxSteps = 20;
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
  Term(DistortedPair p, FundamentalFit fit) : pair(std::move(p)), F(std::move(fit)) {}
  DistortedPair pair;
  FundamentalFit F;
  int variable1 = -1, variable2 = -1;
  double threshold_px = 1.0;
  double sigma_px = 1.0;
  std::array<double, kScan.size()> scan_costs = {};  // each match at most 1
  std::array<FundamentalFit, kScan.size()> scan_fits;
};

// What a term says at the present distortions, in nats.
struct Evaluation {
  FundamentalFit F;
  double cost = 0;
  DistortedPair::Reduced reduced;
};

class Problem {
 public:
  Problem(const std::map<camera_t, Camera>& cameras, const std::set<camera_t>& held,
          std::span<const DistortionPair> pairs, int num_threads);

  DistortionCalibrationReport Solve();

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
  double At(const std::vector<double>& x, int variable) const {
    return variable < 0 ? 0.0 : x[variable];
  }

  void Scan();
  void ScanTerm(Term& term) const;
  std::vector<double> BestOfScan() const;
  void StartFrom(const std::vector<double>& x);
  std::vector<Evaluation> Evaluate(const std::vector<double>& x);
  void Refine(std::vector<double>& x);
  std::vector<double> Normals(const std::vector<Evaluation>& at,
                              Eigen::SparseMatrix<double>* H) const;
  void Judge(const std::vector<double>& x);
  void TakeSignificant(std::vector<double> x);

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
    auto F = internal::DecomposeFundamental(pair.F);
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
  FundamentalFit F = term.F;
  for (size_t i = 0; i < kScan.size(); ++i) {
    if (i == kFirstPositive) F = term.scan_fits[0];
    SetDistortion(term, kScan[i], kScan[i]);
    term.scan_costs[i] = term.pair.Refine(scale_px, kScanIterations, &F) / (scale_px * scale_px);
    term.scan_fits[i] = F;
  }
}

void Problem::Scan() {
  ForTerms([this](Term& term) { ScanTerm(term); });
}

std::vector<double> Problem::BestOfScan() const {
  std::vector<std::array<double, kScan.size()>> costs(camera_ids_.size());
  for (auto& cost : costs) cost.fill(0.0);
  for (const Term& term : terms_) {
    for (const int v : {term.variable1, term.variable2}) {
      if (v < 0) continue;
      for (size_t i = 0; i < kScan.size(); ++i) costs[v][i] += term.scan_costs[i];
    }
  }
  std::vector<double> x;
  for (const auto& cost : costs) {
    x.push_back(kScan[std::min_element(cost.begin(), cost.end()) - cost.begin()]);
  }
  return x;
}

void Problem::StartFrom(const std::vector<double>& x) {
  ForTerms([&](Term& term) {
    const double value = At(x, term.variable1 >= 0 ? term.variable1 : term.variable2);
    const auto index = std::find(kScan.begin(), kScan.end(), value) - kScan.begin();
    term.F = term.scan_fits[index];
    const double scale_px = kScanScale * term.threshold_px;
    SetDistortion(term, At(x, term.variable1), At(x, term.variable2));
    term.pair.Refine(scale_px, kRefineIterations, &term.F);
    term.sigma_px = scale_px / kNoiseScale;
  });
}

std::vector<Evaluation> Problem::Evaluate(const std::vector<double>& x) {
  std::vector<Evaluation> evaluations(terms_.size());
  ParallelFor(num_threads_, std::ssize(terms_), [&](int64_t i) {
    Term& term = terms_[i];
    Evaluation& at = evaluations[i];
    at.F = term.F;
    const double scale_px = kNoiseScale * term.sigma_px;
    const double precision = 1.0 / (term.sigma_px * term.sigma_px);
    SetDistortion(term, At(x, term.variable1), At(x, term.variable2));
    at.cost = 0.5 * precision * term.pair.Refine(scale_px, kRefineIterations, &at.F);
    at.reduced = term.pair.Reduce(at.F, scale_px);
    // By values of the scan instead of k.
    const Eigen::Vector2d units(K(term.variable1, 1.0), K(term.variable2, 1.0));
    at.reduced.gradient = precision * units.cwiseProduct(at.reduced.gradient);
    at.reduced.hessian = precision * units.asDiagonal() * at.reduced.hessian * units.asDiagonal();
  });
  return evaluations;
}

std::vector<double> Problem::Normals(const std::vector<Evaluation>& at,
                                     Eigen::SparseMatrix<double>* H) const {
  std::vector<double> gradient(camera_ids_.size(), 0.0);
  std::vector<Eigen::Triplet<double>> entries;
  for (size_t i = 0; i < terms_.size(); ++i) {
    const int variables[] = {terms_[i].variable1, terms_[i].variable2};
    for (int a = 0; a < 2; ++a) {
      if (variables[a] < 0) continue;
      gradient[variables[a]] += at[i].reduced.gradient[a];
      for (int b = 0; b < 2; ++b) {
        if (variables[b] < 0) continue;
        entries.emplace_back(variables[a], variables[b], at[i].reduced.hessian(a, b));
      }
    }
  }
  // Where no match tells, the range of the scan.
  for (size_t v = 0; v < camera_ids_.size(); ++v) {
    entries.emplace_back(static_cast<int>(v), static_cast<int>(v), 1.0);
  }
  const auto n = static_cast<Eigen::Index>(camera_ids_.size());
  H->resize(n, n);
  H->setFromTriplets(entries.begin(), entries.end());
  return gradient;
}

double SumOfCosts(const std::vector<Evaluation>& at) {
  double sum = 0;
  for (const Evaluation& evaluation : at) sum += evaluation.cost;
  return sum;
}

void Problem::Refine(std::vector<double>& x) {
  constexpr double kMinGain = 1e-3;  // nats
  Eigen::SparseMatrix<double> H;
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver;
  std::vector<Evaluation> present = Evaluate(x);
  double damping = 1e-4;
  for (int step = 0; step < kMaxSteps && damping < 1e4; ++step) {
    std::vector<double> g = Normals(present, &H);
    const Eigen::Map<Eigen::VectorXd> gradient(g.data(), std::ssize(g));
    H.diagonal() *= 1.0 + damping;
    solver.compute(H);
    const Eigen::VectorXd move = (-solver.solve(gradient)).cwiseMin(kMaxStep).cwiseMax(-kMaxStep);
    std::vector<double> moved = x;
    for (size_t v = 0; v < x.size(); ++v) {
      moved[v] = std::clamp(x[v] + move[static_cast<Eigen::Index>(v)], kSmallest, kLargest);
    }
    std::vector<Evaluation> next = Evaluate(moved);
    const double gain = SumOfCosts(present) - SumOfCosts(next);
    if (!(gain > 0)) {
      damping = std::max(10.0 * damping, 1e-2);
      continue;
    }
    x = std::move(moved);
    present = std::move(next);
    for (size_t i = 0; i < terms_.size(); ++i) terms_[i].F = present[i].F;
    damping = 0.1 * damping;
    if (gain < kMinGain) break;
  }
}

void Problem::Judge(const std::vector<double>& x) {
  const std::vector<Evaluation> at = Evaluate(x);
  // Without the distortion of one of its cameras.
  std::vector<std::array<double, 2>> costs(terms_.size());
  std::vector<int> num_explained(terms_.size());
  ParallelFor(num_threads_, std::ssize(terms_), [&](int64_t i) {
    Term& term = terms_[i];
    num_explained[i] = term.pair.NumExplained(at[i].F, kNoiseScale * term.sigma_px);
    const double precision = 1.0 / (term.sigma_px * term.sigma_px);
    const bool is_one = term.variable1 == term.variable2;
    for (int side = 0; side < 2; ++side) {
      SetDistortion(term, side == 0 || is_one ? 0.0 : At(x, term.variable1),
                    side == 1 || is_one ? 0.0 : At(x, term.variable2));
      double cost = INFINITY;
      for (FundamentalFit F : {at[i].F, term.scan_fits[0]}) {
        cost = std::min(cost, term.pair.Refine(kNoiseScale * term.sigma_px, 20, &F));
      }
      costs[i][side] = 0.5 * precision * cost;
    }
  });
  Eigen::SparseMatrix<double> H;
  Normals(at, &H);
  std::vector<double> scatter(camera_ids_.size(), 0.0), expected(camera_ids_.size(), 0.0);
  std::vector<CalibratedDistortion> found(camera_ids_.size());
  for (size_t i = 0; i < terms_.size(); ++i) {
    const Term& term = terms_[i];
    const bool is_one = term.variable1 == term.variable2;
    for (int side = 0; side < (is_one ? 1 : 2); ++side) {
      const int v = side == 0 ? term.variable1 : term.variable2;
      if (v < 0) continue;
      const auto& [hessian, gradient] = at[i].reduced;
      scatter[v] += std::pow(is_one ? gradient.sum() : gradient[side], 2);
      expected[v] += is_one ? hessian.sum() : hessian(side, side);
      found[v].gain += costs[i][side] - at[i].cost;
      found[v].num_matches += num_explained[i];
      ++found[v].num_pairs;
    }
  }
  for (size_t v = 0; v < found.size(); ++v) {
    CalibratedDistortion& camera = found[v];
    const double n = camera.num_pairs;
    const double excess =
        n < 2 ? 1.0 : std::max(1.0, n / (n - 1) * scatter[v] / std::max(expected[v], 1e-300));
    camera.k = K(static_cast<int>(v), x[v]);
    camera.sigma = K(static_cast<int>(v), std::sqrt(excess * internal::LocalVariance(H, v)));
    camera.gain /= excess;
    const double num = std::max(1.0, static_cast<double>(camera.num_matches));
    camera.cost = 0.5 * std::log(num) + 0.5 * kSystematic * kSystematic * num;
    camera.is_significant = camera.num_pairs >= kMinPairs && camera.gain > camera.cost;
    report_.cameras[camera_ids_[v]] = camera;
  }
}

void Problem::TakeSignificant(std::vector<double> x) {
  for (size_t v = 0; v < x.size(); ++v) {
    if (!report_.cameras.at(camera_ids_[v]).is_significant) x[v] = 0.0;
  }
  std::vector<FocalPair> pairs(terms_.size());
  ParallelFor(num_threads_, std::ssize(terms_), [&](int64_t i) {
    Term& term = terms_[i];
    const double scale_px = kNoiseScale * term.sigma_px;
    SetDistortion(term, At(x, term.variable1), At(x, term.variable2));
    term.pair.Refine(scale_px, 20, &term.F);
    pairs[i] = term.pair.Explained(term.F, scale_px, kMaxFocalMatches);
  });
  for (FocalPair& pair : pairs) {
    if (!pair.pixels1.empty()) report_.pairs.push_back(std::move(pair));
  }
}

DistortionCalibrationReport Problem::Solve() {
  if (terms_.empty()) return {};
  Scan();
  std::vector<double> x = BestOfScan();
  StartFrom(x);
  Refine(x);
  ForTerms([](Term& term) { term.sigma_px = term.pair.NoisePx(term.F, term.threshold_px); });
  Refine(x);
  Judge(x);
  TakeSignificant(std::move(x));
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
                                                int num_threads) {
  return Problem(cameras, held, pairs, num_threads).Solve();
}

}  // namespace cairn
