#include "two_view/decide/pair_outcome.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/geometry/epipolar.h"
#include "cairn/math/angles.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/median.h"
#include "cairn/solvers/homography.h"
#include "robust/match_errors.h"
#include "robust/pose_refinement.h"
#include "two_view/decide/evidence.h"
#include "two_view/decide/special_pairs.h"
#include "two_view/search/cheirality.h"
#include "two_view/search/guided_support.h"

namespace cairn::internal {
namespace {

// The standard deviation of matches that tells how well a pair determines its motion, thresholds.
constexpr double kNoise = 1.0 / 3.0;

// Matches that a model explains.
struct Support {
  MatchErrors errors;  // of all matches
  std::vector<int32_t> inliers;
  double score = 0.0;  // MSAC
};

class PairFinisher {
 public:
  PairFinisher(const PreparedPair& pair, const TwoViewOptions& options)
      : pair_(pair), options_(options), cheirality_(pair) {}

  void Run(const Rigid3d& start, PairReport* report) {
    Rigid3d pose = ChooseByCheirality(RefineToNoise(start));
    Support support = SupportOf(pose);
    FillSupport(support, report);
    report->status = Accept(pose, support);
    if (report->status != PairStatus::kVerified) return;
    report->may_have_wrong_focal = MayHaveWrongFocal(support);

    const double noise_px = NoiseScalePx(pair_, support.errors.values(), kSigmaOfMedian);
    const SpecialPair special = ClassifyPair(pair_, support.inliers, noise_px, options_);
    TwoViewConfig config = special.config;
    if (config == TwoViewConfig::kWatermark) {
      report->geometry.config = config;
      report->geometry.inlier_matches = pair_.Matches(support.inliers);
      return;
    }
    // Most of it far away, what is near tells the translation.
    if (config == TwoViewConfig::kPanoramic &&
        HasParallax(pair_, special.H, support.inliers, noise_px, options_.min_log10_evidence)) {
      config = TwoViewConfig::kCalibrated;
    }
    if (config == TwoViewConfig::kPlanar) {
      pose = BestMotionOfPlane(pose, special.H);
      support = SupportOf(pose);
      FillSupport(support, report);
    }
    Eigen::Quaterniond rotation = pose.rotation;
    const double max_sigma = DegToRad(options_.max_pose_sigma_deg);
    if (config == TwoViewConfig::kPanoramic) {
      rotation = Eigen::Quaterniond(special.H);
    } else {
      const double sigma_px = kNoise * pair_.max_error_px;
      const PoseSigmas sigmas = SigmasOfPose(pair_.points, pose, pair_.max_error_px);
      if (sigma_px * sigmas.rotation > max_sigma) {
        report->status = PairStatus::kDegenerate;
        return;
      }
      if (sigma_px * sigmas.translation > max_sigma) config = TwoViewConfig::kPanoramic;
    }
    if (config == TwoViewConfig::kPanoramic) {
      const Support turned = SupportOfRotation(rotation);
      if (PureRotationSigma(support.inliers) > max_sigma ||
          std::ssize(turned.inliers) < options_.min_num_inliers) {
        report->status = PairStatus::kDegenerate;
        return;
      }
      report->geometry.cam2_from_cam1 = Rigid3d(rotation.normalized(), Eigen::Vector3d::Zero());
      FillHomography(rotation.toRotationMatrix(), report);
      FillInliers(turned, report);
    } else {
      FillPose(pose, support, report);
      if (config == TwoViewConfig::kPlanar) FillHomography(special.H, report);
    }
    report->geometry.config = config;
  }

 private:
  // The most accurate pose near one refined at the threshold: a smooth robust loss whose scale
  // follows the noise of this pair. The threshold that separates inliers is some twice the
  // noise, and at that scale the loss would let their far ones pull.
  Rigid3d RefineToNoise(const Rigid3d& start) const {
    // Matches farther away have no weight.
    const MatchErrors errors(pair_.points, EssentialFromPose(start));
    GuidedSupport support;
    support.Learn(pair_, errors.values(), kReach * pair_.max_error_px);
    return support.Refine(start);
  }

  // Of the four poses of the essential matrix, the one with the most inliers in front.
  Rigid3d ChooseByCheirality(const Rigid3d& start) const {
    const MatchErrors errors(pair_.points, EssentialFromPose(start));
    return cheirality_.Choose(start, errors.Below(pair_.max_error_px)).pose;
  }

  // What a pose explains in front of both cameras.
  Support SupportOf(const Rigid3d& pose) const {
    Support support;
    support.errors.SetSampson(pair_.points, EssentialFromPose(pose));
    support.inliers = support.errors.Below(pair_.max_error_px);
    const CheiralityTest test = cheirality_.TestOf(pose);
    std::erase_if(support.inliers, [&](int32_t i) {
      return !test.IsInFront(pair_.points.Ray1(i), pair_.points.Ray2(i));
    });
    support.score = Msac(support, pair_.max_error_px);
    return support;
  }

  // What a rotation explains without a translation.
  Support SupportOfRotation(const Eigen::Quaterniond& rotation) const {
    Support support;
    support.errors.SetHomography(pair_.points, rotation.toRotationMatrix());
    const double max_error_px = MaxTransferErrorPx(0.5 * pair_.max_error_px);
    support.inliers = support.errors.Below(max_error_px);
    support.score = Msac(support, max_error_px);
    return support;
  }

  static double Msac(const Support& support, double max_error_px) {
    double score = 0.0;
    for (const int32_t i : support.inliers) {
      const double e = support.errors[i] / max_error_px;
      score += 1.0 - e * e;
    }
    return score;
  }

  PairStatus Accept(const Rigid3d& pose, const Support& support) const {
    const bool is_accepted = std::ssize(support.inliers) >= options_.min_num_inliers &&
                             Log10NumFalseAlarms(pair_, EssentialFromPose(pose), support.inliers,
                                                 kEssential) < -options_.min_log10_evidence;
    return is_accepted ? PairStatus::kVerified : PairStatus::kTooFewInliers;
  }

  // A model that is wrong by its focal lengths leaves many matches just outside the threshold.
  bool MayHaveWrongFocal(const Support& support) const {
    const double max_error_px = kOutside * pair_.max_error_px;
    const double by_chance = pair_.chance_per_px * max_error_px * pair_.size();
    return static_cast<double>(support.inliers.size()) <
           options_.min_calibrated_share * (support.errors.CountBelow(max_error_px) - by_chance);
  }

  // A plane leaves two motions; with points off the plane, they differ in support. Each is refined
  // on all points and compared with the pose so far.
  Rigid3d BestMotionOfPlane(const Rigid3d& pose, const Eigen::Matrix3d& H) const {
    PlaneMotion motions[4];
    const int num_motions = DecomposeHomography(H, motions);
    Rigid3d best = pose;
    double best_score = SupportOf(pose).score;
    for (int k = 0; k < num_motions; ++k) {
      if (motions[k].cam2_from_cam1.translation.norm() < 1e-6) continue;
      const Rigid3d refined =
          RefinePose(pair_.points, motions[k].cam2_from_cam1, {.scale_px = pair_.max_error_px});
      const double score = SupportOf(refined).score;
      if (score > best_score) {
        best_score = score;
        best = refined;
      }
    }
    return best;
  }

  // Largest standard deviation of a rotation that aligns the inliers' rays, radians.
  double PureRotationSigma(std::span<const int32_t> inliers) const {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (const int32_t i : inliers) {
      const Eigen::Vector3d ray = pair_.points.Ray2(i).normalized();
      information += Eigen::Matrix3d::Identity() - ray * ray.transpose();
    }
    const double smallest = SymmetricEigen(information).values[0];
    const double sigma = kNoise * pair_.max_error_px / pair_.points.focal2_px();
    return smallest > 0.0 ? sigma / std::sqrt(smallest) : std::numeric_limits<double>::infinity();
  }

  void FillSupport(const Support& support, PairReport* report) const {
    report->num_inliers = static_cast<int>(support.inliers.size());
    report->score = support.score;
  }

  void FillInliers(const Support& support, PairReport* report) const {
    FillSupport(support, report);
    report->geometry.inlier_matches = pair_.Matches(support.inliers);
    report->residual_px = support.errors.MedianOf(support.inliers);
  }

  void FillPose(const Rigid3d& pose, const Support& support, PairReport* report) const {
    FillInliers(support, report);
    TwoViewGeometry& geometry = report->geometry;
    geometry.cam2_from_cam1 = Rigid3d(pose.rotation.normalized(), pose.translation.normalized());
    const Eigen::Matrix3d E = EssentialFromPose(pose);
    geometry.E = E;
    // (Pixels of a wide pair have no fundamental matrix, nor a homography.)
    if (!pair_.points.is_wide()) {
      geometry.F = FundamentalFromEssential(E, pair_.input.camera1->CalibrationMatrix(),
                                            pair_.input.camera2->CalibrationMatrix());
    }
    // The median of the angles is that of their squared tangents (below a right angle).
    const Eigen::Matrix3d R = pose.RotationMatrix();
    std::vector<double> squared_tangents;
    for (const int32_t i : support.inliers) {
      const Eigen::Vector3d a = R * pair_.points.Ray1(i);
      const Eigen::Vector3d b = pair_.points.Ray2(i);
      const double dot = a.dot(b);
      squared_tangents.push_back(dot > 0.0
                                     ? static_cast<float>(a.cross(b).squaredNorm() / (dot * dot))
                                     : std::numeric_limits<float>::infinity());
    }
    report->triangulation_angle_deg =
        RadToDeg(std::atan(std::sqrt(UpperMedian(std::move(squared_tangents)))));
  }

  void FillHomography(const Eigen::Matrix3d& H, PairReport* report) const {
    if (pair_.points.is_wide()) return;
    report->geometry.H = pair_.input.camera2->CalibrationMatrix() * H *
                         pair_.input.camera1->CalibrationMatrix().inverse();
  }

  const PreparedPair& pair_;
  const TwoViewOptions& options_;
  const Cheirality cheirality_;
};

}  // namespace

void FinishPair(const PreparedPair& pair, const TwoViewOptions& options, const Rigid3d& pose,
                PairReport* report) {
  PairFinisher(pair, options).Run(pose, report);
}

}  // namespace cairn::internal
