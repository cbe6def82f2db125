#include "cairn/evaluation/alignment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/base/check.h"
#include "cairn/base/rng.h"
#include "cairn/evaluation/error_statistics.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"

namespace cairn {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr int kMaxTriples = 3000;
constexpr int kNumReweightings = 20;

// Umeyama over the points given by `indices`.
std::optional<Sim3d> Align(const Points& src, const Points& dst, const std::vector<double>& weights,
                           const std::vector<uint32_t>& indices) {
  double total = 0;
  Eigen::Vector3d mean_src = Eigen::Vector3d::Zero(), mean_dst = Eigen::Vector3d::Zero();
  for (const uint32_t i : indices) {
    total += weights[i];
    mean_src += weights[i] * src[i];
    mean_dst += weights[i] * dst[i];
  }
  mean_src /= total;
  mean_dst /= total;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double variance_src = 0;
  for (const uint32_t i : indices) {
    const Eigen::Vector3d centered = src[i] - mean_src;
    covariance += weights[i] / total * (dst[i] - mean_dst) * centered.transpose();
    variance_src += weights[i] / total * centered.squaredNorm();
  }
  if (!(variance_src > 0) || !covariance.allFinite()) return std::nullopt;
  const Svd3 svd = SingularValuesWithRotations(covariance);
  const Eigen::Matrix3d R = svd.U * svd.V.transpose();
  Sim3d dst_from_src;
  dst_from_src.rotation = Eigen::Quaterniond(R).normalized();
  dst_from_src.scale = (R.transpose() * covariance).trace() / variance_src;
  if (!(dst_from_src.scale > 0) || !std::isfinite(dst_from_src.scale)) return std::nullopt;
  dst_from_src.translation = mean_dst - dst_from_src.scale * (dst_from_src.rotation * mean_src);
  return dst_from_src;
}

std::vector<double> Residuals(const Sim3d& dst_from_src, const Points& src, const Points& dst) {
  const Eigen::Matrix3d sR = dst_from_src.scale * dst_from_src.rotation.toRotationMatrix();
  std::vector<double> residuals(src.size());
  for (size_t i = 0; i < src.size(); ++i) {
    residuals[i] = (sR * src[i] + dst_from_src.translation - dst[i]).norm();
  }
  return residuals;
}

std::optional<Sim3d> LeastMedianOfTriples(const Points& src, const Points& dst, uint64_t seed) {
  const std::vector<double> ones(src.size(), 1.0);
  std::optional<Sim3d> best;
  double best_median = std::numeric_limits<double>::infinity();
  for (const auto& triple : SampleTriples(static_cast<uint32_t>(src.size()), seed)) {
    const std::optional<Sim3d> candidate = Align(src, dst, ones, {triple.begin(), triple.end()});
    if (!candidate) continue;
    const double median = Median(Residuals(*candidate, src, dst));
    if (median < best_median) {
      best_median = median;
      best = candidate;
    }
  }
  return best;
}

// One step of Weiszfeld's iteration towards the geometric median, in the tangent space at `q`; an
// estimate that coincides with q is treated as by Vardi and Zhang (2000), so that the iteration
// leaves it unless it is the median.
Eigen::Vector3d WeiszfeldStep(const Eigen::Quaterniond& q,
                              const std::vector<Eigen::Quaterniond>& estimates) {
  constexpr double kCoincident = 1e-13;
  Eigen::Vector3d pull = Eigen::Vector3d::Zero();
  double total_weight = 0;
  int num_coincident = 0;
  for (const Eigen::Quaterniond& estimate : estimates) {
    const Eigen::Vector3d v = LogSO3(q.conjugate() * estimate);
    const double angle = v.norm();
    if (angle < kCoincident) {
      ++num_coincident;
    } else {
      pull += v / angle;
      total_weight += 1.0 / angle;
    }
  }
  if (pull.norm() <= num_coincident) return Eigen::Vector3d::Zero();
  return (1.0 - num_coincident / pull.norm()) / total_weight * pull;
}

}  // namespace

std::vector<std::array<uint32_t, 3>> SampleTriples(uint32_t n, uint64_t seed) {
  std::vector<std::array<uint32_t, 3>> triples;
  if (uint64_t{n} * (n - 1) * (n - 2) / 6 <= kMaxTriples) {
    for (uint32_t i = 0; i < n; ++i) {
      for (uint32_t j = i + 1; j < n; ++j) {
        for (uint32_t k = j + 1; k < n; ++k) triples.push_back({i, j, k});
      }
    }
    return triples;
  }
  Rng rng(seed, "align_similarity");
  triples.resize(kMaxTriples);
  for (auto& triple : triples) rng.Sample(n, 3, triple.data());
  return triples;
}

std::optional<Sim3d> AlignSimilarity(const Points& src, const Points& dst,
                                     const std::vector<double>& weights) {
  CAIRN_CHECK_EQ(src.size(), dst.size());
  CAIRN_CHECK(weights.empty() || weights.size() == src.size());
  if (src.size() < 2) return std::nullopt;
  std::vector<uint32_t> all(src.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<uint32_t>(i);
  return Align(src, dst, weights.empty() ? std::vector<double>(src.size(), 1.0) : weights, all);
}

std::optional<Sim3d> AlignSimilarityRobust(const Points& src, const Points& dst, uint64_t seed) {
  CAIRN_CHECK_EQ(src.size(), dst.size());
  if (src.size() < 3) return std::nullopt;
  std::optional<Sim3d> best = LeastMedianOfTriples(src, dst, seed);
  // (Without one of three, the other two leave the rotation about their line open.)
  if (!best || src.size() == 3) return best;
  for (int iteration = 0; iteration < kNumReweightings; ++iteration) {
    const std::vector<double> residuals = Residuals(*best, src, dst);
    const double median = Median(residuals);
    std::vector<double> weights(src.size());
    std::vector<uint32_t> kept;
    for (uint32_t i = 0; i < src.size(); ++i) {
      weights[i] = 1.0 / std::max(residuals[i], 1e-3 * median + 1e-12);
      if (residuals[i] <= 3.0 * median + 1e-15) kept.push_back(i);
    }
    const std::optional<Sim3d> refined = Align(src, dst, weights, kept);
    if (!refined) break;
    best = refined;
  }
  return best;
}

std::optional<Eigen::Quaterniond> AlignRotationsL1(const std::vector<Eigen::Quaterniond>& src,
                                                   const std::vector<Eigen::Quaterniond>& dst) {
  CAIRN_CHECK_EQ(src.size(), dst.size());
  if (src.empty()) return std::nullopt;
  std::vector<Eigen::Quaterniond> estimates;
  for (size_t k = 0; k < src.size(); ++k) estimates.push_back(dst[k].conjugate() * src[k]);
  const auto cost = [&](const Eigen::Quaterniond& q) {
    double sum = 0;
    for (const Eigen::Quaterniond& estimate : estimates) sum += AngleBetween(q, estimate);
    return sum;
  };
  constexpr size_t kMaxStarts = 100;
  const size_t step = 1 + (estimates.size() - 1) / kMaxStarts;
  Eigen::Quaterniond best = estimates[0];
  double best_cost = cost(best);
  for (size_t k = step; k < estimates.size(); k += step) {
    const double candidate_cost = cost(estimates[k]);
    if (candidate_cost < best_cost) {
      best_cost = candidate_cost;
      best = estimates[k];
    }
  }
  for (int iteration = 0; iteration < 200; ++iteration) {
    const Eigen::Vector3d step_rad = WeiszfeldStep(best, estimates);
    best = (best * ExpSO3(step_rad)).normalized();
    if (step_rad.norm() < 1e-12) break;
  }
  return best;
}

}  // namespace cairn
