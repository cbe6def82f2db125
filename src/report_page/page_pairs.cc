#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <tuple>

#include "report_page/page_parts.h"

namespace cairn {
namespace {

// Indices of the pairs that go into the page, by pair: those with the most inliers, then matches.
std::vector<size_t> SelectPairs(const PageScene& scene) {
  std::vector<size_t> selected(scene.pairs.size());
  std::iota(selected.begin(), selected.end(), 0);
  const auto size = static_cast<size_t>(std::max<int64_t>(0, scene.input.limits.pairs));
  if (selected.size() <= size) return selected;
  std::stable_sort(selected.begin(), selected.end(), [&](size_t a, size_t b) {
    const PagePair &p = scene.pairs[a], &q = scene.pairs[b];
    return std::tie(p.num_inliers, p.num_matches) > std::tie(q.num_inliers, q.num_matches);
  });
  selected.resize(size);
  std::sort(selected.begin(), selected.end());
  return selected;
}

// The largest number of matches that every pair can have (or all that it has), within the limit.
int ShareOfAll(const PageScene& scene, const std::vector<size_t>& selected) {
  constexpr int kMinMatches = 32, kMaxMatches = 400;  // more lines hide each other
  const auto fits = [&](int share) {
    int64_t sum = 0;
    for (const size_t i : selected) sum += std::min(share, scene.pairs[i].num_matches);
    return sum <= scene.input.limits.matches;
  };
  int share = kMaxMatches;
  while (share > kMinMatches && !fits(share)) --share;
  return share;
}

// How many matches of each selected pair go into the page; where the limit does not last for all,
// those with the most inliers have theirs.
std::vector<int> ShareMatches(const PageScene& scene, const std::vector<size_t>& selected) {
  const int share = ShareOfAll(scene, selected);
  std::vector<size_t> order(selected.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return scene.pairs[selected[a]].num_inliers > scene.pairs[selected[b]].num_inliers;
  });
  std::vector<int> shares(selected.size(), 0);
  int64_t left = scene.input.limits.matches;
  for (const size_t i : order) {
    shares[i] =
        static_cast<int>(std::min<int64_t>({share, scene.pairs[selected[i]].num_matches, left}));
    left -= shares[i];
  }
  return shares;
}

// Every so many-th of them.
FeatureMatches Sample(const FeatureMatches& matches, size_t size) {
  FeatureMatches sample;
  if (size >= matches.size()) return matches;
  for (size_t i = 0; i < size; ++i) sample.push_back(matches[i * matches.size() / size]);
  return sample;
}

// Keypoints as 16-bit fractions of the image's width and height.
class KeypointReader {
 public:
  explicit KeypointReader(const PageScene& scene) : scene_(scene), points_(scene.images.size()) {}

  const std::vector<std::array<uint16_t, 2>>& Of(int image) {
    if (points_[image]) return *points_[image];
    points_[image].emplace();
    const Image& of = scene_.images[image].image;
    const Camera& camera = scene_.cameras.at(of.camera_id).known.camera;
    const auto keypoints = scene_.database.ReadKeypoints(of.image_id);
    const auto fraction = [](double x, int size) {
      return static_cast<uint16_t>(std::clamp(65535.0 * x / std::max(1, size), 0.0, 65535.0));
    };
    for (const Keypoint& k : keypoints.value_or(std::vector<Keypoint>())) {
      points_[image]->push_back({fraction(k.x, camera.width), fraction(k.y, camera.height)});
    }
    return *points_[image];
  }

 private:
  const PageScene& scene_;
  std::vector<std::optional<std::vector<std::array<uint16_t, 2>>>> points_;
};

// Matches of the pair for its drawing: first inliers, then rejected ones, each four fractions.
struct DrawnMatches {
  std::vector<uint16_t> xyxy;
  int num_inliers = 0;
};
DrawnMatches DrawMatches(const PageScene& scene, const PagePair& pair, int share,
                         KeypointReader& keypoints) {
  FeatureMatches inliers;
  if (auto geometry = scene.database.ReadTwoViewGeometry(pair.pair_id)) {
    inliers = std::move(geometry->inlier_matches);
  }
  std::set<std::pair<point2D_t, point2D_t>> accepted;
  for (const FeatureMatch& match : inliers) accepted.insert({match.point1, match.point2});
  FeatureMatches rejected;
  for (const FeatureMatch& match :
       scene.database.ReadMatches(pair.pair_id).value_or(FeatureMatches())) {
    if (accepted.count({match.point1, match.point2}) == 0) rejected.push_back(match);
  }
  // In proportion, so that the drawing shows how many were rejected.
  const size_t total = std::max<size_t>(1, inliers.size() + rejected.size());
  const size_t num_inliers = std::min<size_t>(share, (inliers.size() * share + total - 1) / total);
  DrawnMatches drawn;
  const auto& points1 = keypoints.Of(pair.image1);
  const auto& points2 = keypoints.Of(pair.image2);
  const auto draw = [&](const FeatureMatches& matches) {
    int num = 0;
    for (const auto& [point1, point2] : matches) {
      if (point1 >= points1.size() || point2 >= points2.size()) continue;
      drawn.xyxy.insert(drawn.xyxy.end(), {points1[point1][0], points1[point1][1],
                                           points2[point2][0], points2[point2][1]});
      ++num;
    }
    return num;
  };
  drawn.num_inliers = draw(Sample(inliers, num_inliers));
  draw(Sample(rejected, share - num_inliers));
  return drawn;
}

Json MatchesJson(const PageScene& scene, const std::vector<size_t>& selected, PageBlocks& blocks) {
  const std::vector<int> shares = ShareMatches(scene, selected);
  KeypointReader keypoints(scene);
  std::vector<uint16_t> xyxy, num_inliers;
  std::vector<uint32_t> end;
  for (size_t i = 0; i < selected.size(); ++i) {
    DrawnMatches drawn;
    if (shares[i] > 0) {
      drawn = DrawMatches(scene, scene.pairs[selected[i]], shares[i], keypoints);
    }
    xyxy.insert(xyxy.end(), drawn.xyxy.begin(), drawn.xyxy.end());
    end.push_back(static_cast<uint32_t>(xyxy.size() / 4));
    num_inliers.push_back(static_cast<uint16_t>(drawn.num_inliers));
  }
  return {{"xyxy", blocks.Add(xyxy)},
          {"end", blocks.Add(end)},
          {"num_inliers", blocks.Add(num_inliers)}};
}

// The position of the text in the list, to which it is added if it is new.
uint8_t Position(const std::string& text, std::vector<std::string>& list) {
  const size_t position = std::find(list.begin(), list.end(), text) - list.begin();
  if (position == list.size() && list.size() < 255) list.push_back(text);
  return static_cast<uint8_t>(std::min<size_t>(position, 254));
}

// Columns of numbers, a row a pair; fractions in steps that the page knows.
struct PairColumns {
  std::vector<uint32_t> image1, image2;
  std::vector<uint8_t> state, verifier;
  std::vector<uint16_t> inliers, matches, residual, angle, time, explained;

  static uint16_t Steps(double value, double step) {
    return static_cast<uint16_t>(std::clamp(value / step + 0.5, 0.0, 65535.0));
  }
};

}  // namespace

Json PairsJson(const PageScene& scene, PageBlocks& blocks) {
  constexpr double kResidualStep = 0.001, kAngleStep = 0.01, kTimeStep = 0.01, kShareStep = 0.0001;
  const std::vector<size_t> selected = SelectPairs(scene);
  PairColumns columns;
  std::vector<std::string> states = {"in_use"}, verifiers = {""};
  for (const size_t i : selected) {
    const PagePair& pair = scene.pairs[i];
    columns.image1.push_back(pair.image1);
    columns.image2.push_back(pair.image2);
    columns.state.push_back(Position(pair.state, states));
    columns.verifier.push_back(Position(pair.verifier, verifiers));
    columns.inliers.push_back(PairColumns::Steps(pair.num_inliers, 1));
    columns.matches.push_back(PairColumns::Steps(pair.num_matches, 1));
    columns.residual.push_back(PairColumns::Steps(pair.residual_px, kResidualStep));
    columns.angle.push_back(PairColumns::Steps(pair.angle_deg, kAngleStep));
    columns.time.push_back(PairColumns::Steps(pair.milliseconds, kTimeStep));
    columns.explained.push_back(pair.support.num_matches > 0
                                    ? PairColumns::Steps(pair.support.Share(), kShareStep)
                                    : 65535);  // no model has both images
  }
  std::map<std::string, int64_t> counts;
  for (const PagePair& pair : scene.pairs) ++counts[pair.state];
  Json json = {{"total", scene.pairs.size()},
               {"shown", selected.size()},
               {"counts", counts},
               {"states", states},
               {"verifiers", verifiers}};
  json["image1"] = blocks.Add(columns.image1);
  json["image2"] = blocks.Add(columns.image2);
  json["state"] = blocks.Add(columns.state);
  json["verifier"] = blocks.Add(columns.verifier);
  json["inliers"] = blocks.Add(columns.inliers);
  json["matches"] = blocks.Add(columns.matches);
  json["residual"] = {{"block", blocks.Add(columns.residual)}, {"step", kResidualStep}};
  json["angle"] = {{"block", blocks.Add(columns.angle)}, {"step", kAngleStep}};
  json["time"] = {{"block", blocks.Add(columns.time)}, {"step", kTimeStep}};
  json["explained"] = {{"block", blocks.Add(columns.explained)}, {"step", kShareStep}};
  json["drawn"] = MatchesJson(scene, selected, blocks);
  return json;
}

}  // namespace cairn
