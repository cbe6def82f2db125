#include <algorithm>
#include <functional>
#include <limits>

#include "math/sorted_order.h"
#include "report_page/page_parts.h"

namespace cairn {
namespace {

using Pairs = std::vector<const PagePair*>;

// The pairs that go into the page, in their order: those with the most inliers, then matches.
Pairs SelectPairs(const PageScene& scene) {
  Pairs selected;
  for (const PagePair& pair : scene.pairs) selected.push_back(&pair);
  const auto size = static_cast<size_t>(std::max<int64_t>(0, scene.input.limits.pairs));
  if (selected.size() <= size) return selected;
  std::ranges::stable_sort(selected, std::greater<>(), [](const PagePair* pair) {
    return std::pair(pair->num_inliers, pair->num_matches);
  });
  selected.resize(size);
  std::sort(selected.begin(), selected.end());
  return selected;
}

// The largest number of matches that every pair can have (or all that it has), within the limit.
int ShareOfAll(const Pairs& selected, int64_t limit) {
  constexpr int kMinMatches = 32, kMaxMatches = 400;  // more lines hide each other
  const auto fits = [&](int share) {
    int64_t sum = 0;
    for (const PagePair* pair : selected) sum += std::min(share, pair->num_matches);
    return sum <= limit;
  };
  int share = kMaxMatches;
  while (share > kMinMatches && !fits(share)) --share;
  return share;
}

// How many matches of each selected pair go into the page; where the limit does not last for all,
// those with the most inliers have theirs.
std::vector<int> ShareMatches(const Pairs& selected, int64_t limit) {
  const int share = ShareOfAll(selected, limit);
  std::vector<int> shares(selected.size(), 0);
  const auto key = [&](int i) { return -selected[i]->num_inliers; };
  for (const int i : SortedOrder(selected.size(), key)) {
    shares[i] = static_cast<int>(std::min<int64_t>({share, selected[i]->num_matches, limit}));
    limit -= shares[i];
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
    const auto keypoints = ReadOrEmpty([&] { return scene_.database.ReadKeypoints(of.image_id); });
    const auto fraction = [](double x, int size) {
      return static_cast<uint16_t>(std::clamp(65535.0 * x / std::max(1, size), 0.0, 65535.0));
    };
    for (const Keypoint& k : keypoints) {
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
  const FeatureMatches inliers =
      ReadOrEmpty([&] { return scene.database.ReadTwoViewGeometry(pair.pair_id); }).inlier_matches;
  FeatureMatches accepted = inliers;
  std::sort(accepted.begin(), accepted.end());
  FeatureMatches rejected = ReadOrEmpty([&] { return scene.database.ReadMatches(pair.pair_id); });
  std::erase_if(rejected, [&](const FeatureMatch& match) {
    return std::binary_search(accepted.begin(), accepted.end(), match);
  });
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

Json MatchesJson(const PageScene& scene, const Pairs& selected, PageBlocks& blocks) {
  const std::vector<int> shares = ShareMatches(selected, scene.input.limits.matches);
  KeypointReader keypoints(scene);
  std::vector<uint16_t> xyxy, num_inliers;
  std::vector<uint32_t> end;
  for (size_t i = 0; i < selected.size(); ++i) {
    DrawnMatches drawn;
    if (shares[i] > 0) drawn = DrawMatches(scene, *selected[i], shares[i], keypoints);
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

// A block with a number of each pair: of a field, or what a function gives.
template <class T, class Get>
int AddColumn(const Pairs& pairs, const Get& get, PageBlocks& blocks) {
  std::vector<T> column;
  for (const PagePair* pair : pairs) column.push_back(static_cast<T>(std::invoke(get, *pair)));
  return blocks.Add(column);
}

// The same as 16-bit numbers of steps; the largest one stands for all beyond it.
template <class Get>
int AddSteps(const Pairs& pairs, double step, const Get& get, PageBlocks& blocks) {
  const auto steps = [&](const PagePair& pair) {
    return std::clamp(std::invoke(get, pair) / step + 0.5, 0.0, 65535.0);
  };
  return AddColumn<uint16_t>(pairs, steps, blocks);
}

}  // namespace

Json PairsJson(const PageScene& scene, PageBlocks& blocks) {
  const Pairs selected = SelectPairs(scene);
  std::map<std::string, int64_t> counts;
  for (const PagePair& pair : scene.pairs) ++counts[pair.state];
  std::vector<std::string> states = {"in_use"}, verifiers = {""};
  const auto state = [&](const PagePair& pair) { return Position(pair.state, states); };
  const auto verifier = [&](const PagePair& pair) { return Position(pair.verifier, verifiers); };
  const auto explained = [](const PagePair& pair) {  // infinite: no model has both images
    return pair.support.num_matches > 0 ? pair.support.Share()
                                        : std::numeric_limits<double>::infinity();
  };
  const auto fractions = [&](double step, const auto& get) -> Json {
    return {{"block", AddSteps(selected, step, get, blocks)}, {"step", step}};
  };
  Json json = {{"total", scene.pairs.size()},
               {"shown", selected.size()},
               {"counts", counts},
               {"states", nullptr},  // filled below
               {"verifiers", nullptr}};
  json["image1"] = AddColumn<uint32_t>(selected, &PagePair::image1, blocks);
  json["image2"] = AddColumn<uint32_t>(selected, &PagePair::image2, blocks);
  json["state"] = AddColumn<uint8_t>(selected, state, blocks);
  json["verifier"] = AddColumn<uint8_t>(selected, verifier, blocks);
  json["inliers"] = AddSteps(selected, 1, &PagePair::num_inliers, blocks);
  json["matches"] = AddSteps(selected, 1, &PagePair::num_matches, blocks);
  json["residual"] = fractions(0.001, &PagePair::residual_px);
  json["angle"] = fractions(0.01, &PagePair::angle_deg);
  json["time"] = fractions(0.01, &PagePair::milliseconds);
  json["explained"] = fractions(0.0001, explained);
  json["states"] = states;
  json["verifiers"] = verifiers;
  json["drawn"] = MatchesJson(scene, selected, blocks);
  return json;
}

}  // namespace cairn
