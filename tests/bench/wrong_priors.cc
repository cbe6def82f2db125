// What becomes of pairs whose trusted focal lengths are wrong: multiplies those of one image of
// every pair, or of both, by some factors and verifies the pairs again. Counted are the pairs that
// have the right pose with the focal lengths as they are. README.md has the commands.
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

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
  std::string judged_path;
  bool is_trusted = true;

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "keypoints and matches");
    v.String("truth_path", truth_path, "folder of Strecha's .camera files");
    v.String("verifier", verifier, "cairn's");
    v.String("judged_path", judged_path,
             "the same images and matches, verified with other cameras: counts what is there");
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

// A pair of the database, with its truth.
struct TruePair {
  PairInput input;
  std::string name1, name2;
  bool is_false = false;
  Rigid3d expected;
  Eigen::Matrix3d true_F;
};

std::vector<TruePair> FindPairs(const PairData& data, const std::string& truth_path) {
  const auto truth = ReadTruePoses(truth_path);
  std::vector<TruePair> pairs;
  for (size_t k = 0; k < data.pairs.size(); ++k) {
    const auto [id1, id2] = PairIdToImagePair(data.pairs[k].first);
    TruePair pair;
    pair.input = data.Input(k, 0);
    pair.name1 = data.images.at(id1).name;
    pair.name2 = data.images.at(id2).name;
    const PairKind kind = KindOfPair(pair.name1, pair.name2);
    if (kind == PairKind::kUnknown || truth.count(pair.name1) + truth.count(pair.name2) < 2) {
      continue;
    }
    pair.is_false = kind == PairKind::kFalse;
    pair.expected = truth.at(pair.name2) * Inverse(truth.at(pair.name1));
    pair.expected.translation.normalize();
    pair.true_F = FundamentalFromEssential(EssentialFromPose(pair.expected),
                                           pair.input.camera1->CalibrationMatrix(),
                                           pair.input.camera2->CalibrationMatrix());
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

Outcome Judge(const PairReport& report, const TruePair& pair) {
  return Judge(report, pair.input, pair.expected, pair.true_F);
}

using Counts = std::array<int, kNumOutcomes>;

void Print(const std::string& label, const Counts& counts) {
  std::printf("%-16s", label.c_str());
  for (const int count : counts) std::printf(" %10d", count);
  std::puts("");
}

void PrintHeader() {
  std::printf("%-16s", "");
  for (const char* name : kOutcomeNames) std::printf(" %10s", name);
  std::puts("");
}

// What is stored of the pairs of which a camera has changed, where the pair has the right pose with
// the right cameras.
void CountStored(const std::vector<TruePair>& pairs, const Options& options,
                 PairVerifier& verifier) {
  const Database database(options.judged_path, Database::Mode::kReadOnly);
  std::map<camera_t, double> focal_of;
  for (const Camera& camera : database.ReadCameras()) {
    focal_of[camera.camera_id] = camera.MeanFocal();
  }
  std::map<image_t, double> focals;
  for (const Image& image : database.ReadImages()) {
    focals[image.image_id] = focal_of.at(image.camera_id);
  }
  Counts counts = {};
  for (const TruePair& pair : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair.input.pair_id);
    constexpr double kEqual = 0.01;
    const bool is_changed =
        std::abs(focals.at(id1) / pair.input.camera1->MeanFocal() - 1.0) > kEqual ||
        std::abs(focals.at(id2) / pair.input.camera2->MeanFocal() - 1.0) > kEqual;
    if (!is_changed || pair.is_false || Judge(verifier.Verify(pair.input), pair) != kPose) continue;
    PairReport stored;
    if (auto geometry = database.ReadTwoViewGeometry(pair.input.pair_id)) {
      stored.geometry = std::move(*geometry);
      if (!stored.geometry.inlier_matches.empty()) stored.status = PairStatus::kVerified;
    }
    ++counts[Judge(stored, pair)];
  }
  PrintHeader();
  Print("stored", counts);
}

// Verifies every pair with wrong focal lengths.
void CountWrong(const std::vector<TruePair>& pairs, const Options& options,
                PairVerifier& verifier) {
  std::map<std::pair<int, double>, Counts> table;
  std::map<double, int> num_false_accepted;
  for (const TruePair& pair : pairs) {
    if (!pair.is_false && Judge(verifier.Verify(pair.input), pair) != kPose) continue;
    for (const double factor : kFactors) {
      for (const Which which : {kFirst, kSecond, kBoth}) {
        if (factor == 1.0 && which != kBoth) continue;
        Camera camera1 = *pair.input.camera1, camera2 = *pair.input.camera2;
        for (const auto& [camera, other] : {std::pair(&camera1, kSecond), {&camera2, kFirst}}) {
          if (which == other) continue;
          camera->SetMeanFocal(factor * camera->MeanFocal());
          camera->has_prior_focal_length = options.is_trusted;
        }
        PairInput input = pair.input;
        input.camera1 = &camera1;
        input.camera2 = &camera2;
        const Outcome outcome = Judge(verifier.Verify(input), input, pair.expected, pair.true_F);
        if (pair.is_false) {
          num_false_accepted[factor] += outcome != kRejected;
        } else {
          ++table.try_emplace({which, factor}).first->second[outcome];
        }
      }
    }
  }
  PrintHeader();
  for (const auto& [key, counts] : table) {
    char factor[16];
    std::snprintf(factor, sizeof(factor), " %.2f", key.second);
    Print(kWhichNames[key.first] + std::string(factor), counts);
  }
  for (const auto& [factor, count] : num_false_accepted) {
    std::printf("false pairs accepted at %.2f: %d\n", factor, count);
  }
}

int Run(const Options& options, const TwoViewOptions& verification) {
  const PairData data = ReadPairData(options.database_path);
  const std::vector<TruePair> pairs = FindPairs(data, options.truth_path);
  const auto verifier = MakePairVerifier(VerifierKindFromName(options.verifier), verification);
  if (options.judged_path.empty()) {
    CountWrong(pairs, options, *verifier);
  } else {
    CountStored(pairs, options, *verifier);
  }
  return 0;
}

}  // namespace
}  // namespace cairn::bench

int main(int argc, char** argv) {
  using namespace cairn;
  return RunMain([&] {
    Program program("wrong_priors", "Measures what becomes of pairs with wrong focal lengths");
    bench::Options options;
    TwoViewOptions verification;
    Command& command = program.MainCommand();
    command.AddOptions("", options);
    command.AddOptions("verification", verification);
    command.SetRun([&] { return bench::Run(options, verification); });
    return program.Run(argc, argv);
  });
}
