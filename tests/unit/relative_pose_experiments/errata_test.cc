#include "relative_pose_experiments/errata.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "cairn/math/angles.h"
#include "relative_pose_experiments/solver_runs.h"
#include "relative_pose_experiments/stability.h"

namespace cairn::experiments {
namespace {

constexpr int kNumInstances = 2000;

// The figures over 2,000 instances, computed once.
const ErrataReport& Report() {
  static const ErrataReport report = RunErrata(1, kNumInstances, 1);
  return report;
}
const ErratumFigures& Figures(PaperForm form) {
  return Report().figures.at(static_cast<int>(form));
}

TEST(Errata, TheCorrectedFormIsExact) {
  const ErratumFigures& corrected = Figures(PaperForm::kCorrected);
  EXPECT_LT(corrected.rotation_median_deg, 1e-12);
  EXPECT_LT(corrected.translation_median_deg, 1e-12);
  EXPECT_LT(corrected.scale_median, 1e-13);
  EXPECT_LT(DegToRad(corrected.rotation_max_deg), 1e-9);
  EXPECT_LT(DegToRad(corrected.translation_max_deg), 1e-9);
  EXPECT_LT(corrected.scale_max, 1e-9);
}

TEST(Errata, ThePrintedRotationMissesByRadians) {
  EXPECT_GT(DegToRad(Figures(PaperForm::kRotation).rotation_median_deg), 1.0);
}

TEST(Errata, ThePrintedScaleHasTheWrongSign) {
  EXPECT_NEAR(Figures(PaperForm::kScale).scale_median, 2.0, 1e-9);
  EXPECT_NEAR(Figures(PaperForm::kScale).scale_max, 2.0, 1e-9);
  EXPECT_GT(DegToRad(Figures(PaperForm::kScale).translation_median_deg), 1.0);
  EXPECT_LT(DegToRad(Figures(PaperForm::kScale).rotation_max_deg), 1e-9);
}

TEST(Errata, ThePrintedTranslationPointsBackward) {
  EXPECT_NEAR(Figures(PaperForm::kTranslation).translation_median_deg, 180.0, 1e-6);
}

TEST(Errata, ThePrintedDerivativesMissByRadians) {
  EXPECT_GT(DegToRad(Figures(PaperForm::kChainRule).rotation_median_deg), 1.0);
  EXPECT_GT(DegToRad(Figures(PaperForm::kGradientPerPixel).rotation_median_deg), 0.5);
}

TEST(Errata, TheAlgorithmKeepsTheSecondAxisAndNotTheFirst) {
  EXPECT_GT(Report().first_axis_median_deg, 1.0);
  EXPECT_LT(Report().second_axis_median_deg, 1e-12);
}

TEST(Errata, TheCorrectedFormIsTheLibrarysSolver) {
  for (int i = 0; i < 200; ++i) {
    const Instance noisy =
        WithNoise(MakeInstance(2, i), {.image_px = 1, .affine = 0.02, .depth = 0.02}, 2, i);
    const auto solved = EstimatePose(Solver::kProposed, noisy);
    if (!solved) continue;
    // The library maps view 1 into view 2: the same rotation; noise makes the two scales differ.
    const PaperPose paper = SolveInPaperForm(noisy, 0, PaperForm::kCorrected);
    EXPECT_LT(AngleBetween(ToCam2FromCam1(paper).rotation, solved->rotation), 1e-7);
  }
}

// The bounds that the quick mode's figures are checked against: the library's solvers hold them,
// and every printed form breaks them.
TEST(Errata, ThePrintedFormsBreakTheBoundsOfTheExperiments) {
  const std::vector<Instance> instances = MakeInstances(3, 300, 1);
  for (const PaperForm form : kPaperForms) {
    const auto figures = MeasureStability(
        std::string(PaperFormName(form)),
        [form](const Instance& instance) {
          return ToCam2FromCam1(SolveInPaperForm(instance, 0, form));
        },
        instances, 1);
    const auto checks = Checks({figures});
    const bool all_hold =
        std::all_of(checks.begin(), checks.end(), [](const auto& c) { return c.Holds(); });
    EXPECT_EQ(all_hold, form == PaperForm::kCorrected) << PaperFormName(form);
  }
}

}  // namespace
}  // namespace cairn::experiments
