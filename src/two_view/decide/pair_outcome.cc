#include "two_view/decide/pair_outcome.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/geometry/epipolar.h"
#include "cairn/math/angles.h"
#include "cairn/robust/pose_refinement.h"
#include "cairn/solvers/homography.h"
#include "two_view/decide/evidence.h"
#include "two_view/search/cheirality.h"

namespace cairn::internal {
namespace {

class PairFinisher {
 public:
  PairFinisher(const PairInput& input, const PreparedPair& pair, const TwoViewOptions& options,
               OutcomeScratch* scratch)
      : input_(input), pair_(pair), options_(options), scratch_(*scratch), cheirality_(pair) {}

  void Run(const Rigid3d& start, PairReport* report) {
    Rigid3d pose = ChooseByCheirality(RefineToNoise(start));
    CollectInliers(pose);
    SetSupport(pose, report);
    report->status = Accept(pose, *report);
    report->may_have_wrong_focal = MayHaveWrongFocal(*report);
    if (report->status != PairStatus::kVerified) return;

    const SpecialPair special =
        ClassifyPair(input_, pair_, scratch_.inliers, options_, &scratch_.special);
    TwoViewConfig config = special.config;
    if (config == TwoViewConfig::kWatermark) {
      report->geometry.config = config;
      FillInliers(report);
      return;
    }
    if (config == TwoViewConfig::kPlanar) {
      pose = BestMotionOfPlane(pose, special.H);
      CollectInliers(pose);
      SetSupport(pose, report);
    }
    Eigen::Quaterniond rotation = special.rotation;
    const double max_sigma = DegToRad(options_.max_pose_sigma_deg);
    if (config != TwoViewConfig::kPanoramic) {
      const auto [rotation_sigma, translation_sigma] = PoseSigmas(pose);
      if (rotation_sigma > max_sigma) {
        report->status = PairStatus::kDegenerate;
        return;
      }
      if (translation_sigma > max_sigma) {
        config = TwoViewConfig::kPanoramic;
        rotation = pose.rotation;
      }
    }
    if (config == TwoViewConfig::kPanoramic && PureRotationSigma() > max_sigma) {
      report->status = PairStatus::kDegenerate;
      return;
    }
    report->geometry.config = config;
    if (config == TwoViewConfig::kPanoramic) {
      FillPanoramic(rotation, report);
    } else {
      FillPose(pose, report);
      if (config == TwoViewConfig::kPlanar) FillHomography(special.H, report);
    }
    FillInliers(report);
  }

 private:
  // The most accurate pose near one refined at the threshold: a smooth robust loss whose scale
  // follows the noise of this pair. The threshold that separates inliers is several times the
  // noise, and at that scale the loss would let their far ones pull.
  Rigid3d RefineToNoise(const Rigid3d& start) {
    // Matches farther away have no weight.
    constexpr double kReach = 10.0;  // thresholds
    const double reach_px = kReach * pair_.max_error_px;
    FindSampsonInliers(EssentialFromPose(start), reach_px);
    scratch_.support.Learn(pair_, scratch_.errors, reach_px);
    return scratch_.support.Refine(start);
  }

  // Of the four poses of the essential matrix, the one with the most inliers in front.
  Rigid3d ChooseByCheirality(const Rigid3d& start) {
    FindSampsonInliers(EssentialFromPose(start), pair_.max_error_px);
    return cheirality_.Choose(start, scratch_.inliers).pose;
  }

  void FindSampsonInliers(const Eigen::Matrix3d& E, double max_error_px) {
    scratch_.errors.resize(pair_.points.num_blocks() * PointPairs::kBlock);
    SampsonErrors(pair_.points, E, scratch_.errors.data());
    scratch_.inliers.clear();
    for (int i = 0; i < pair_.size(); ++i) {
      if (scratch_.errors[i] < max_error_px) scratch_.inliers.push_back(i);
    }
  }

  void CollectInliers(const Rigid3d& pose) {
    FindSampsonInliers(EssentialFromPose(pose), pair_.max_error_px);
    const Eigen::Matrix3d R = pose.RotationMatrix();
    std::erase_if(scratch_.inliers, [&](int32_t i) { return !cheirality_.IsInFront(pose, R, i); });
  }

  void SetSupport(const Rigid3d& pose, PairReport* report) const {
    report->num_inliers = static_cast<int>(scratch_.inliers.size());
    report->score = 0.0;
    for (const int32_t i : scratch_.inliers) {
      const double e = scratch_.errors[i] / pair_.max_error_px;
      report->score += 1.0 - e * e;
    }
  }

  PairStatus Accept(const Rigid3d& pose, const PairReport& report) {
    if (report.num_inliers < options_.min_num_inliers) return PairStatus::kTooFewInliers;
    // Points in front of both cameras are half of those near their epipolar lines, or fewer.
    const double chance =
        0.5 * ChanceOfInlier(pair_, EssentialFromPose(pose), pair_.max_error_px, &scratch_.shifted);
    // Matches of the same two spots are one piece of evidence, however many there are.
    const int num_distinct = EstimateNumDistinct(pair_, scratch_.inliers, &scratch_.cells);
    constexpr int kSampleSize = 5, kNumModels = 10;
    const double log10_nfa = Log10NumFalseAlarms(pair_.size() - report.num_inliers + num_distinct,
                                                 num_distinct, kSampleSize, kNumModels, chance);
    return log10_nfa < -options_.min_log10_evidence ? PairStatus::kVerified
                                                    : PairStatus::kTooFewInliers;
  }

  // A model that is wrong by its focal lengths leaves many matches just outside the threshold.
  bool MayHaveWrongFocal(const PairReport& report) const {
    if (report.status != PairStatus::kVerified) return false;
    constexpr double kNear = 4.0;
    const double max_error_px = kNear * pair_.max_error_px;
    const auto num_near =
        std::count_if(scratch_.errors.begin(), scratch_.errors.begin() + pair_.size(),
                      [max_error_px](float error) { return error < max_error_px; });
    const double by_chance = pair_.chance_per_px * max_error_px * pair_.size();
    return report.num_inliers <
           options_.min_calibrated_share * (static_cast<double>(num_near) - by_chance);
  }

  // A plane leaves two motions; with points off the plane, they differ in support. Each is refined
  // on all points and compared with the pose so far.
  Rigid3d BestMotionOfPlane(const Rigid3d& pose, const Eigen::Matrix3d& H) {
    PlaneMotion motions[4];
    const int num_motions = DecomposeHomography(H, motions);
    Rigid3d best = pose;
    double best_score = ScoreInFront(pose);
    for (int k = 0; k < num_motions; ++k) {
      if (motions[k].cam2_from_cam1.translation.norm() < 1e-6) continue;
      const Rigid3d refined =
          RefinePose(pair_.points, motions[k].cam2_from_cam1, {.scale_px = pair_.max_error_px})
              .cam2_from_cam1;
      const double score = ScoreInFront(refined);
      if (score > best_score) {
        best_score = score;
        best = refined;
      }
    }
    return best;
  }

  double ScoreInFront(const Rigid3d& pose) {
    CollectInliers(pose);
    PairReport support;
    SetSupport(pose, &support);
    return support.score;
  }

  // Largest standard deviations of rotation and translation direction, radians, for errors of a
  // third of the threshold.
  std::pair<double, double> PoseSigmas(const Rigid3d& pose) const {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 5, 5>> eigen(
        PoseInformation(pair_.points, pose, pair_.max_error_px));
    const double floor = 1e-12 * eigen.eigenvalues()[4];
    const Eigen::Matrix<double, 5, 5> covariance =
        eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(floor).cwiseInverse().asDiagonal() *
        eigen.eigenvectors().transpose();
    auto largest = [](const auto& block) {
      return Eigen::SelfAdjointEigenSolver<std::decay_t<decltype(block)>>(block)
          .eigenvalues()
          .maxCoeff();
    };
    const double sigma_px = pair_.max_error_px / 3.0;
    const Eigen::Matrix3d rotation = covariance.topLeftCorner<3, 3>();
    const Eigen::Matrix2d translation = covariance.bottomRightCorner<2, 2>();
    return {sigma_px * std::sqrt(largest(rotation)), sigma_px * std::sqrt(largest(translation))};
  }

  // Largest standard deviation of a rotation that aligns the inliers' rays, radians.
  double PureRotationSigma() const {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (const int32_t i : scratch_.inliers) {
      const Eigen::Vector3d ray = pair_.points.Ray2(i).normalized();
      information += Eigen::Matrix3d::Identity() - ray * ray.transpose();
    }
    const double smallest =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information).eigenvalues()[0];
    const double sigma = pair_.max_error_px / 3.0 / pair_.points.focal2_px();
    return smallest > 0.0 ? sigma / std::sqrt(smallest) : std::numeric_limits<double>::infinity();
  }

  void FillPose(const Rigid3d& pose, PairReport* report) {
    TwoViewGeometry& geometry = report->geometry;
    geometry.cam2_from_cam1 = Rigid3d(pose.rotation.normalized(), pose.translation.normalized());
    const Eigen::Matrix3d E = EssentialFromPose(pose);
    geometry.E = E;
    // (Pixels of a wide pair have no fundamental matrix, nor a homography.)
    if (!pair_.points.is_wide()) {
      geometry.F = FundamentalFromEssential(E, input_.camera1->CalibrationMatrix(),
                                            input_.camera2->CalibrationMatrix());
    }
    std::vector<float>& values = scratch_.special.errors;
    values.clear();
    // The median of the angles is that of their squared tangents (below a right angle).
    const Eigen::Matrix3d R = pose.RotationMatrix();
    for (const int32_t i : scratch_.inliers) {
      const Eigen::Vector3d a = R * pair_.points.Ray1(i);
      const Eigen::Vector3d b = pair_.points.Ray2(i);
      const double dot = a.dot(b);
      values.push_back(dot > 0.0 ? static_cast<float>(a.cross(b).squaredNorm() / (dot * dot))
                                 : std::numeric_limits<float>::infinity());
    }
    report->triangulation_angle_deg = RadToDeg(std::atan(std::sqrt(Median(&values))));
    values.clear();
    for (const int32_t i : scratch_.inliers) values.push_back(scratch_.errors[i]);
    report->residual_px = Median(&values);
  }

  static double Median(std::vector<float>* values) {
    if (values->empty()) return 0.0;
    const auto middle = values->begin() + values->size() / 2;
    std::nth_element(values->begin(), middle, values->end());
    return *middle;
  }

  void FillHomography(const Eigen::Matrix3d& H, PairReport* report) const {
    if (pair_.points.is_wide()) return;
    report->geometry.H =
        input_.camera2->CalibrationMatrix() * H * input_.camera1->CalibrationMatrix().inverse();
  }

  // No translation: inliers are those of the rotation.
  void FillPanoramic(const Eigen::Quaterniond& rotation, PairReport* report) {
    report->geometry.cam2_from_cam1 = Rigid3d(rotation.normalized(), Eigen::Vector3d::Zero());
    FillHomography(rotation.toRotationMatrix(), report);
    scratch_.errors.resize(pair_.points.num_blocks() * PointPairs::kBlock);
    HomographyErrors(pair_.points, rotation.toRotationMatrix(), scratch_.errors.data());
    scratch_.inliers.clear();
    const double max_error = std::sqrt(2.0) * pair_.max_error_px;
    for (int i = 0; i < pair_.size(); ++i) {
      if (scratch_.errors[i] < max_error) scratch_.inliers.push_back(i);
    }
    SetSupport(*report->geometry.cam2_from_cam1, report);
    std::vector<float>& values = scratch_.special.errors;
    values.clear();
    for (const int32_t i : scratch_.inliers) values.push_back(scratch_.errors[i]);
    report->residual_px = Median(&values);
    report->triangulation_angle_deg = 0.0;
  }

  void FillInliers(PairReport* report) const {
    report->num_inliers = static_cast<int>(scratch_.inliers.size());
    report->geometry.inlier_matches.clear();
    report->geometry.inlier_matches.reserve(scratch_.inliers.size());
    for (const int32_t i : scratch_.inliers) {
      report->geometry.inlier_matches.push_back(input_.matches[pair_.match_index[i]]);
    }
  }

  const PairInput& input_;
  const PreparedPair& pair_;
  const TwoViewOptions& options_;
  OutcomeScratch& scratch_;
  Cheirality cheirality_;
};

}  // namespace

void FinishPair(const PairInput& input, const PreparedPair& pair, const TwoViewOptions& options,
                const Rigid3d& pose, OutcomeScratch* scratch, PairReport* report) {
  PairFinisher(input, pair, options, scratch).Run(pose, report);
}

}  // namespace cairn::internal
