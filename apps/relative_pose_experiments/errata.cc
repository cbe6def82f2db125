#include "relative_pose_experiments/errata.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "relative_pose_experiments/solver_runs.h"
#include "relative_pose_experiments/statistics.h"

namespace cairn::experiments {
namespace {

using Matrix32 = Eigen::Matrix<double, 3, 2>;

// The paper's algorithm 1, as printed.
Eigen::Matrix3d Orthonorm(const Matrix32& Y) {
  const Eigen::Vector3d x = Y.col(0).cross(Y.col(1)).normalized();
  const Eigen::Vector3d z = Y.col(1).normalized();
  Eigen::Matrix3d frame;
  frame << x, z.cross(x), z;
  return frame;
}

// The derivative of lambda q(x) along the frame's axes, in the given form.
Matrix32 FrameDerivative(const Eigen::Vector3d& q, const Matrix32& dq, const AffineObservation& o,
                         PaperForm form) {
  const Eigen::RowVector2d& g = o.depth_gradient;
  if (form == PaperForm::kChainRule) {
    Matrix32 A;
    for (int k = 0; k < 2; ++k) A.col(k) = g[k] * q + o.depth * dq.col(k) * o.shape(k, k);
    return A;
  }
  const Eigen::RowVector2d along_axes = form == PaperForm::kGradientPerPixel ? g : g * o.shape;
  return q * along_axes + o.depth * dq * o.shape;
}

struct View {
  Eigen::Vector3d point;
  Matrix32 derivative;
};

View MakeView(const Camera& camera, const AffineObservation& o, PaperForm form) {
  Eigen::Matrix2d J;
  const auto uv = camera.CamFromImg(o.pixel, &J);
  CAIRN_CHECK(uv.has_value());
  Matrix32 dq = Matrix32::Zero();
  dq.topRows<2>() = J;
  const Eigen::Vector3d q = uv->homogeneous();
  return {o.depth * q, FrameDerivative(q, dq, o, form)};
}

struct Errors {
  double rotation_deg, translation_deg, scale;
};

Errors ErrorsOfForm(const Instance& instance, PaperForm form) {
  const PaperPose pose = SolveInPaperForm(instance, 0, form);
  const Rigid3d cam2_from_cam1 = ToCam2FromCam1(pose);
  const PoseErrors errors = ErrorsOf(cam2_from_cam1, instance);
  const double true_scale = instance.depth1_unit / instance.depth2_unit;
  return {errors.rotation_deg, errors.translation_deg, std::abs(pose.scale / true_scale - 1.0)};
}

ErratumFigures FiguresOf(PaperForm form, const std::vector<Errors>& errors) {
  std::vector<double> rotation, translation, scale;
  for (const Errors& e : errors) {
    rotation.push_back(e.rotation_deg);
    translation.push_back(e.translation_deg);
    scale.push_back(e.scale);
  }
  return {.form = form,
          .rotation_median_deg = Median(rotation),
          .rotation_max_deg = Quantile(rotation, 1.0),
          .translation_median_deg = Median(translation),
          .translation_max_deg = Quantile(translation, 1.0),
          .scale_median = Median(scale),
          .scale_max = Quantile(scale, 1.0)};
}

// Angles between the columns of A and of R B, degrees.
Eigen::Vector2d AxisAngles(const Instance& noisy) {
  const Eigen::Matrix3d R = SolveInPaperForm(noisy, 0, PaperForm::kCorrected).R;
  const Matrix32 A = MakeView(noisy.camera, noisy.view1[0], PaperForm::kCorrected).derivative;
  const Matrix32 B = MakeView(noisy.camera, noisy.view2[0], PaperForm::kCorrected).derivative;
  Eigen::Vector2d angles;
  for (int k = 0; k < 2; ++k) {
    angles[k] = RadToDeg(AngleBetween(Eigen::Vector3d(A.col(k)), Eigen::Vector3d(R * B.col(k))));
  }
  return angles;
}

}  // namespace

std::string_view PaperFormName(PaperForm form) {
  static constexpr std::array<std::string_view, kPaperForms.size()> kNames = {
      "corrected", "rotation", "scale", "translation", "chain_rule", "gradient_per_pixel"};
  return kNames[static_cast<int>(form)];
}

PaperPose SolveInPaperForm(const Instance& instance, int i, PaperForm form) {
  const auto [a, A] = MakeView(instance.camera, instance.view1[i], form);
  const auto [b, B] = MakeView(instance.camera, instance.view2[i], form);
  const Eigen::Matrix3d R_A = Orthonorm(A);
  const Eigen::Matrix3d R_B = Orthonorm(B);
  PaperPose pose;
  pose.R = form == PaperForm::kRotation ? Eigen::Matrix3d(R_A.transpose() * R_B)
                                        : Eigen::Matrix3d(R_A * R_B.transpose());
  pose.scale = (A.transpose() * pose.R * B).trace() / (B.transpose() * B).trace();
  if (form == PaperForm::kScale) pose.scale = -pose.scale;
  pose.t = a - pose.scale * (pose.R * b);
  if (form == PaperForm::kTranslation) pose.t = -pose.t;
  return pose;
}

Rigid3d ToCam2FromCam1(const PaperPose& pose) {
  // X1 = scale R X2 + t, each in the unit of its depth map; scale X2 is in the unit of the first.
  return Inverse(Rigid3d(pose.R, pose.t));
}

ErrataReport RunErrata(uint64_t seed, int64_t num_instances, int num_threads) {
  const std::vector<Instance> instances = MakeInstances(seed, num_instances, num_threads);
  ErrataReport report;
  for (const PaperForm form : kPaperForms) {
    std::vector<Errors> errors(num_instances);
    ParallelFor(
        num_threads, num_instances,
        [&](int64_t i) { errors[i] = ErrorsOfForm(instances[i], form); }, 64);
    report.figures.push_back(FiguresOf(form, errors));
  }
  std::vector<double> first(num_instances), second(num_instances);
  ParallelFor(
      num_threads, num_instances,
      [&](int64_t i) {
        const Eigen::Vector2d angles =
            AxisAngles(WithNoise(instances[i], {.affine = 0.05}, seed, i));
        first[i] = angles[0];
        second[i] = angles[1];
      },
      64);
  report.first_axis_median_deg = Median(first);
  report.second_axis_median_deg = Median(second);
  return report;
}

Table ToTable(const ErrataReport& report) {
  Table table({"form", "rotation_median_deg", "rotation_max_deg", "translation_median_deg",
               "translation_max_deg", "scale_median", "scale_max"});
  for (const ErratumFigures& f : report.figures) {
    table.Row()
        .Add(PaperFormName(f.form))
        .Add(f.rotation_median_deg)
        .Add(f.rotation_max_deg)
        .Add(f.translation_median_deg)
        .Add(f.translation_max_deg)
        .Add(f.scale_median)
        .Add(f.scale_max);
  }
  return table;
}

std::vector<FigureCheck> Checks(const ErrataReport& report) {
  const auto& f = report.figures;
  const auto at = [&](PaperForm form) { return f[static_cast<int>(form)]; };
  return {
      {"errata.corrected.rotation_max_deg", f[0].rotation_max_deg, 0, 1e-4},
      {"errata.corrected.translation_max_deg", f[0].translation_max_deg, 0, 1e-4},
      {"errata.corrected.scale_max", f[0].scale_max, 0, 1e-6},
      {"errata.rotation.median_deg", at(PaperForm::kRotation).rotation_median_deg, 10, 180},
      {"errata.scale.median", at(PaperForm::kScale).scale_median, 1.9, 2.1},
      {"errata.translation.median_deg", at(PaperForm::kTranslation).translation_median_deg, 179,
       180.001},
      {"errata.chain_rule.median_deg", at(PaperForm::kChainRule).rotation_median_deg, 1, 180},
      {"errata.gradient_per_pixel.median_deg", at(PaperForm::kGradientPerPixel).rotation_median_deg,
       1, 180},
      {"errata.first_axis_median_deg", report.first_axis_median_deg, 0.1, 90},
      {"errata.second_axis_median_deg", report.second_axis_median_deg, 0, 1e-9},
  };
}

}  // namespace cairn::experiments
