#include "bench/pair_truth.h"

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "cairn/base/error.h"
#include "cairn/evaluation/error_statistics.h"
#include "cairn/io/model.h"
#include "cairn/math/angles.h"

namespace cairn::bench {
namespace {

// Names without '_' are of one scene.
std::string SceneOf(const std::string& name) {
  const size_t cut = name.rfind('_');
  return cut == std::string::npos ? "" : name.substr(0, cut);
}

std::string SiteOf(const std::string& scene) {
  const std::string site = scene.substr(0, scene.find('-'));
  return site == "entry" || site == "castle" ? "fountain" : site;
}

}  // namespace

std::map<std::string, Rigid3d> ReadTruePoses(const std::string& path) {
  std::map<std::string, Rigid3d> poses;
  for (const auto& [id, image] : ReadModel(path, {.read_points = false}).images) {
    poses[image.image.name] = image.cam_from_world;
  }
  return poses;
}

PairKind KindOfPair(const std::string& name1, const std::string& name2) {
  const std::string scene1 = SceneOf(name1), scene2 = SceneOf(name2);
  if (scene1 == scene2) return PairKind::kTrue;
  return SiteOf(scene1) == SiteOf(scene2) ? PairKind::kUnknown : PairKind::kFalse;
}

constexpr double kWrongDeg = 20.0;

Scores ScoreResults(const std::map<std::string, Rigid3d>& truth, int min_inliers,
                    std::vector<PairResult>* results) {
  Scores scores;
  std::vector<double> errors, ms_true, ms_false;
  for (PairResult& result : *results) {
    scores.all_seconds += result.seconds;
    const bool accepted = result.cam2_from_cam1 && result.num_inliers >= min_inliers;
    if (result.kind == PairKind::kUnknown) continue;
    if (truth.count(result.name1) == 0 || truth.count(result.name2) == 0) continue;
    scores.total_seconds += result.seconds;
    if (result.kind == PairKind::kFalse) {
      ++scores.num_false;
      scores.accepted_false += accepted;
      ms_false.push_back(1e3 * result.seconds);
      continue;
    }
    ++scores.num_true;
    scores.accepted_true += accepted;
    ms_true.push_back(1e3 * result.seconds);
    result.error_deg = 180.0;
    if (accepted) {
      const Rigid3d expected = truth.at(result.name2) * Inverse(truth.at(result.name1));
      result.error_deg = RadToDeg(
          std::max(AngleBetween(expected.rotation, result.cam2_from_cam1->rotation),
                   AngleBetween(expected.translation, result.cam2_from_cam1->translation)));
    }
    scores.num_wrong += accepted && result.error_deg > kWrongDeg;
    errors.push_back(result.error_deg);
  }
  scores.auc1 = 100.0 * RecallAuc(errors, 1.0);
  scores.auc5 = 100.0 * RecallAuc(errors, 5.0);
  scores.auc10 = 100.0 * RecallAuc(errors, 10.0);
  scores.auc20 = 100.0 * RecallAuc(errors, 20.0);
  scores.median_ms_true = Median(ms_true);
  scores.median_ms_false = Median(ms_false);
  return scores;
}

std::string ScoresHeader() {
  return "verifier, depth                         AUC@1    @5   @10   @20  true acc. wrong  false "
         "acc.  "
         "ms true  ms false  total s  all s";
}

std::string FormatScores(const std::string& label, const Scores& s) {
  char line[256];
  std::snprintf(
      line, sizeof(line),
      "%-38s %6.2f %5.2f %5.2f %5.2f  %4d / %-4d %4d   %3d / %-3d  %7.3f  %8.3f  %7.3f %6.3f",
      label.c_str(), s.auc1, s.auc5, s.auc10, s.auc20, s.accepted_true, s.num_true, s.num_wrong,
      s.accepted_false, s.num_false, s.median_ms_true, s.median_ms_false, s.total_seconds,
      s.all_seconds);
  return line;
}

void WriteCsv(const std::string& path, const std::vector<PairResult>& results) {
  std::ofstream file(path);
  if (!file) throw IoError(path, "cannot be written");
  file << "name1,name2,matches,inliers,iterations,ms,qw,qx,qy,qz,tx,ty,tz,error_deg,note\n";
  file.precision(10);
  for (const PairResult& r : results) {
    const Rigid3d pose = r.cam2_from_cam1.value_or(Rigid3d());
    const auto& q = pose.rotation;
    const auto& t = pose.translation;
    file << r.name1 << ',' << r.name2 << ',' << r.num_matches << ','
         << (r.cam2_from_cam1 ? r.num_inliers : 0) << ',' << r.num_iterations << ','
         << 1e3 * r.seconds << ',' << q.w() << ',' << q.x() << ',' << q.y() << ',' << q.z() << ','
         << t.x() << ',' << t.y() << ',' << t.z() << ',' << r.error_deg << ',' << r.note << '\n';
  }
}

}  // namespace cairn::bench
