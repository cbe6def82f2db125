// What becomes of pairs whose trusted focal lengths are wrong: multiplies those of one image of
// every pair, or of both, by some factors and verifies the pairs again. Counted are the pairs that
// have the right pose with the focal lengths as they are. README.md has the commands.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <set>

#include "bench/pair_data.h"
#include "bench/pair_truth.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/math/angles.h"
#include "cairn/two_view/pair_verifier.h"
#include "common/program.h"

namespace cairn::bench {
namespace {

struct Options {
  std::string database_path;
  std::string truth_path;
  std::string verifier = "cascade";
  std::string csv;
  bool is_trusted = true;

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "keypoints and matches");
    v.String("truth_path", truth_path, "folder of Strecha's .camera files");
    v.String("verifier", verifier, "cairn's");
    v.String("csv", csv, "every pair");
    v.Bool("is_trusted", is_trusted, "wrong focal lengths are trusted; else known to be wrong");
  }
};

constexpr double kMaxPoseErrorDeg = 5.0;
constexpr double kFactors[] = {0.4, 0.5, 0.67, 1.0, 1.5, 2.0, 2.5};

enum Outcome {
  kPose,
  kWrongPose,
  kFundamental,
  kWrongFundamental,
  kNoPose,
  kRejected,
  kNumOutcomes
};
constexpr const char* kOutcomeNames[] = {"pose",    "wrong pose", "F",
                                         "wrong F", "no pose",    "rejected"};

double PoseErrorDeg(const Rigid3d& expected, const Rigid3d& pose) {
  return RadToDeg(std::max(AngleBetween(expected.rotation, pose.rotation),
                           AngleBetween(expected.translation, pose.translation)));
}

// Of the matches that follow the true F, most follow this one.
bool IsRight(const Eigen::Matrix3d& F, const Eigen::Matrix3d& true_F, const PairInput& input) {
  constexpr double kMaxErrorPx = 2.0, kMaxDistancePx = 3.0, kMinShare = 0.8;
  int num_true = 0, num_right = 0;
  for (const FeatureMatch& match : input.matches) {
    const Eigen::Vector2d x1 = input.keypoints1[match.point1].Position();
    const Eigen::Vector2d x2 = input.keypoints2[match.point2].Position();
    if (std::sqrt(SquaredSampsonError(true_F, x1, x2)) > kMaxErrorPx) continue;
    ++num_true;
    num_right += std::sqrt(SquaredSampsonError(F, x1, x2)) < kMaxDistancePx;
  }
  return num_right >= kMinShare * num_true;
}

Outcome Judge(const PairReport& report, const PairInput& input, const Rigid3d& expected,
              const Eigen::Matrix3d& true_F) {
  const TwoViewGeometry& geometry = report.geometry;
  if (report.status != PairStatus::kVerified) return kRejected;
  if (geometry.config == TwoViewConfig::kUncalibrated) {
    return IsRight(*geometry.F, true_F, input) ? kFundamental : kWrongFundamental;
  }
  if (!geometry.cam2_from_cam1 || geometry.cam2_from_cam1->translation.isZero()) return kNoPose;
  return PoseErrorDeg(expected, *geometry.cam2_from_cam1) < kMaxPoseErrorDeg ? kPose : kWrongPose;
}

// Which image of a pair has the wrong focal length.
enum Which { kFirst, kSecond, kBoth };
constexpr const char* kWhichNames[] = {"first", "second", "both"};

int Run(const Options& options, const TwoViewOptions& verification) {
  const PairData data = ReadPairData(options.database_path);
  const auto truth = ReadStrechaPoses(options.truth_path);
  const auto verifier = MakePairVerifier(VerifierKindFromName(options.verifier), verification);
  std::ofstream csv;
  if (!options.csv.empty()) csv.open(options.csv);
  csv << "name1,name2,factor,which,outcome,status,config,step,matches,inliers,good_inliers,error_"
         "deg\n";
  std::map<std::pair<int, double>, std::array<int, kNumOutcomes>> table;
  std::map<double, int> num_false_accepted;
  int num_false = 0;
  for (size_t k = 0; k < data.pairs.size(); ++k) {
    const PairInput right = data.Input(k, 0);
    const auto [id1, id2] = PairIdToImagePair(data.pairs[k].first);
    const std::string& name1 = data.images.at(id1).name;
    const std::string& name2 = data.images.at(id2).name;
    const PairKind kind = KindOfPair(name1, name2);
    if (kind == PairKind::kUnknown || truth.count(name1) + truth.count(name2) < 2) continue;
    Rigid3d expected = truth.at(name2) * Inverse(truth.at(name1));
    expected.translation.normalize();
    const Eigen::Matrix3d true_F =
        FundamentalFromEssential(EssentialFromPose(expected), right.camera1->CalibrationMatrix(),
                                 right.camera2->CalibrationMatrix());
    const PairReport good = verifier->Verify(right);
    const bool is_false = kind == PairKind::kFalse;
    num_false += is_false;
    if (!is_false && Judge(good, right, expected, true_F) != kPose) continue;
    for (const double factor : kFactors) {
      for (const Which which : {kFirst, kSecond, kBoth}) {
        if (factor == 1.0 && which != kBoth) continue;
        Camera camera1 = *right.camera1, camera2 = *right.camera2;
        for (const auto& [camera, other] : {std::pair(&camera1, kSecond), {&camera2, kFirst}}) {
          if (which == other) continue;
          camera->SetMeanFocal(factor * camera->MeanFocal());
          camera->has_prior_focal_length = options.is_trusted;
        }
        PairInput input = right;
        input.camera1 = &camera1;
        input.camera2 = &camera2;
        const PairReport report = verifier->Verify(input);
        const Outcome outcome = Judge(report, input, expected, true_F);
        if (is_false) {
          num_false_accepted[factor] += outcome != kRejected;
        } else {
          ++table.try_emplace({which, factor}).first->second[outcome];
        }
        const auto& pose = report.geometry.cam2_from_cam1;
        csv << name1 << ',' << name2 << ',' << factor << ',' << kWhichNames[which] << ','
            << (is_false ? "false pair " : "") << kOutcomeNames[outcome] << ','
            << PairStatusName(report.status) << ',' << TwoViewConfigName(report.geometry.config)
            << ',' << report.verifier << ',' << input.matches.size() << ',' << report.num_inliers
            << ',' << good.num_inliers << ',' << (pose ? PoseErrorDeg(expected, *pose) : 180.0)
            << '\n';
      }
    }
  }
  std::printf("wrong   factor");
  for (const char* name : kOutcomeNames) std::printf(" %10s", name);
  std::puts("");
  for (const auto& [key, counts] : table) {
    std::printf("%-7s %6.2f", kWhichNames[key.first], key.second);
    for (const int count : counts) std::printf(" %10d", count);
    std::puts("");
  }
  for (const auto& [factor, count] : num_false_accepted) {
    std::printf("false pairs accepted at %.2f: %d of %d\n", factor, count, num_false);
  }
  return 0;
}

}  // namespace
}  // namespace cairn::bench

int main(int argc, char** argv) {
  using namespace cairn;
  Program program("wrong_priors", "Measures what becomes of pairs with wrong focal lengths");
  bench::Options options;
  TwoViewOptions verification;
  Command& command = program.MainCommand();
  command.AddOptions("", options);
  command.AddOptions("verification", verification);
  command.SetRun([&] { return bench::Run(options, verification); });
  return program.Run(argc, argv);
}
