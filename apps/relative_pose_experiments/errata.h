#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "relative_pose_experiments/paper_setup.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

// The paper's "1AC+D (Proposed)" in its own notation, a, A of view 1 and b, B of view 2, so that
// (R, Lambda, t) maps view 2 into view 1: corrected, or with one passage as printed (ERRATA.md).
enum class PaperForm : int {
  kCorrected = 0,
  kRotation,          // R = R_A^T R_B, with frames returned as columns (eq. 12, algorithm 1)
  kScale,             // Lambda = -tr(A^T R B) / tr(B^T B) (eq. 14, algorithm 1)
  kTranslation,       // t = Lambda R b - a (substitution below eq. 8)
  kChainRule,         // column k of A is d_k lambda q + lambda d_k q d_k x (eq. 3), with dx = M
  kGradientPerPixel,  // A = q grad(lambda) + lambda grad(q) M (eq. 4), grad(lambda) per pixel
};
inline constexpr std::array<PaperForm, 6> kPaperForms = {
    PaperForm::kCorrected,   PaperForm::kRotation,  PaperForm::kScale,
    PaperForm::kTranslation, PaperForm::kChainRule, PaperForm::kGradientPerPixel};
std::string_view PaperFormName(PaperForm form);

struct PaperPose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  // view 1 from view 2
  Eigen::Vector3d t = Eigen::Vector3d::Zero();      // in the unit of the first depth map
  double scale = 1.0;                               // unit of the first depth map over the second
};
// From the instance's correspondence i. Rejects nothing.
PaperPose SolveInPaperForm(const Instance& instance, int i, PaperForm form);
// cam2_from_cam1, in the unit of the first depth map.
Rigid3d ToCam2FromCam1(const PaperPose& pose);

struct ErratumFigures {
  PaperForm form = PaperForm::kCorrected;
  double rotation_median_deg = 0, rotation_max_deg = 0;
  double translation_median_deg = 0, translation_max_deg = 0;
  double scale_median = 0, scale_max = 0;  // |Lambda / true Lambda - 1|
};
struct ErrataReport {
  std::vector<ErratumFigures> figures;  // in the order of kPaperForms
  // "biased towards the first columns, providing perfect alignment of those two axes": with frames
  // 5 % wrong, the median angle between A's column and R times B's, for the first and the second.
  double first_axis_median_deg = 0, second_axis_median_deg = 0;
};

ErrataReport RunErrata(uint64_t seed, int64_t num_instances, int num_threads);
Table ToTable(const ErrataReport& report);
std::vector<FigureCheck> Checks(const ErrataReport& report);

}  // namespace cairn::experiments
