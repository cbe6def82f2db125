#include <algorithm>
#include <cmath>

#include "cairn/base/parallel.h"
#include "cairn/graph/union_find.h"
#include "cairn/math/angles.h"
#include "pipeline/reconstruct_stages.h"

namespace cairn {
namespace {

// Cells of an image's longer side.
constexpr int kCells = 10;
// Points of an image that are looked at.
constexpr size_t kMaxPoints = 400;
// A point should look the same from the other camera: directions and distances are similar.
const double kMinCosine = std::cos(DegToRad(25.0));
constexpr double kMaxDistanceRatio = 1.6;
// Points of either image that a cell must have to say anything.
constexpr int kMinInCell = 3;
// Comparable points that a pair must have to say anything, and the share of them that lies in cells
// without any match, beyond what the pair's matching rate explains, from which it contradicts.
constexpr double kMinEvidence = 30;
constexpr double kMaxConflict = 0.1;

// Images that make a place.
constexpr int kMinGroup = 3;

// An image, ready to be compared with others.
struct View {
  const RegisteredImage* image = nullptr;
  const Camera* camera = nullptr;
  Eigen::Vector3d center;
  int columns = 0;
  int rows = 0;
  std::vector<point3D_t> seen;                                 // all of its points, ascending
  std::vector<std::pair<point3D_t, Eigen::Vector3d>> samples;  // at most kMaxPoints of them
  std::vector<int> present;                                    // points in each cell

  int CellOf(const Eigen::Vector2d& pixel) const {
    if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < camera->width &&
          pixel.y() < camera->height)) {
      return -1;
    }
    return static_cast<int>(pixel.y() * rows / camera->height) * columns +
           static_cast<int>(pixel.x() * columns / camera->width);
  }
};

View MakeView(const Reconstruction& model, const RegisteredImage& image) {
  View view;
  view.image = &image;
  view.camera = &model.CameraOf(image);
  view.center = image.cam_from_world.Center();
  const double cell =
      static_cast<double>(std::max(view.camera->width, view.camera->height)) / kCells;
  view.columns = std::max(1, static_cast<int>(std::lround(view.camera->width / cell)));
  view.rows = std::max(1, static_cast<int>(std::lround(view.camera->height / cell)));
  view.present.assign(static_cast<size_t>(view.columns) * view.rows, 0);
  for (size_t k = 0; k < image.point3D_ids.size(); ++k) {
    if (image.point3D_ids[k] == kInvalidPoint3DId) continue;
    view.seen.push_back(image.point3D_ids[k]);
    const int cell = view.CellOf(image.points2D[k]);
    if (cell >= 0) ++view.present[cell];
  }
  const size_t num_samples = std::min(view.seen.size(), kMaxPoints);
  for (size_t k = 0; k < num_samples; ++k) {
    const point3D_t id = view.seen[k * view.seen.size() / num_samples];
    view.samples.emplace_back(id, model.points3D.at(id).xyz);
  }
  std::sort(view.seen.begin(), view.seen.end());
  return view;
}

// What two views say about each other: the more comparable points, the more it counts.
struct Comparison {
  double evidence = 0;
  double conflict = 0;  // share of the evidence, 0 to 1
};

// The rate at which expected points are matched, from cells that have a match (binomial without
// zero: a cell of n points has n rate / (1 - (1 - rate)^n) matches on average).
double MatchingRate(const std::vector<std::pair<int, int>>& matched) {
  double common = 0;
  for (const auto& [n, c] : matched) common += c;
  double rate = 0.95;
  for (int iteration = 0; iteration < 30; ++iteration) {
    double expected = 0;
    for (const auto& [n, c] : matched) {
      expected += n / std::max(1e-6, 1 - std::pow(1 - rate, n));
    }
    rate = std::min(0.95, common / expected);
  }
  return rate;
}

// Points of `a` that `b` should see as well, against those that it does, cell by cell. A pair that
// matches badly misses points everywhere; one of twin places matches in some cells as well as any,
// and in others, where both have points, not at all.
Comparison CompareInto(const View& a, const View& b) {
  struct Cell {
    int expected = 0, present = 0, common = 0;
  };
  std::vector<Cell> cells(b.present.size());
  for (size_t k = 0; k < cells.size(); ++k) cells[k].present = b.present[k];
  for (const auto& [id, xyz] : a.samples) {
    const Eigen::Vector3d from_a = xyz - a.center;
    const Eigen::Vector3d from_b = xyz - b.center;
    const double distance_a = from_a.norm();
    const double distance_b = from_b.norm();
    if (from_a.dot(from_b) < kMinCosine * distance_a * distance_b) continue;
    if (distance_a > kMaxDistanceRatio * distance_b) continue;
    if (distance_b > kMaxDistanceRatio * distance_a) continue;
    const auto pixel = b.camera->ImgFromRay(b.image->cam_from_world * xyz);
    if (!pixel) continue;
    const int cell = b.CellOf(*pixel);
    if (cell < 0) continue;
    ++cells[cell].expected;
    cells[cell].common += std::binary_search(b.seen.begin(), b.seen.end(), id);
  }
  std::vector<std::pair<int, int>> matched;  // expected and common points of cells with matches
  for (const Cell& cell : cells) {
    if (cell.common > 0) matched.emplace_back(cell.expected, cell.common);
  }
  Comparison result;
  if (matched.empty()) return result;
  // A cell without matches is no surprise where few are expected.
  const double rate = MatchingRate(matched);
  for (const Cell& cell : cells) {
    if (cell.expected < kMinInCell || cell.present < kMinInCell) continue;
    const double weight = std::min(cell.expected, cell.present);
    const double chance = std::pow(1 - rate, weight);  // of no match
    result.evidence += weight;
    result.conflict += weight * ((cell.common == 0 ? 1.0 : 0.0) - chance);
  }
  if (result.evidence > 0) result.conflict = std::max(0.0, result.conflict / result.evidence);
  return result;
}

Comparison Compare(const View& a, const View& b) {
  const Comparison ab = CompareInto(a, b);
  const Comparison ba = CompareInto(b, a);
  return {std::min(ab.evidence, ba.evidence), std::min(ab.conflict, ba.conflict)};
}

// A pair of registered images, by their indices.
struct Pair {
  size_t edge = 0;  // in the graph
  int image1 = 0, image2 = 0;
  Comparison comparison;

  // +1: they look at one place, -1: at two, 0: they do not show enough in common to tell.
  int Vote() const {
    if (comparison.evidence < kMinEvidence) return 0;
    return comparison.conflict > kMaxConflict ? -1 : 1;
  }
};

std::vector<Pair> ComparePairs(const Reconstruction& model, const ViewGraph& graph,
                               int num_threads) {
  std::vector<View> views;
  std::map<image_t, int> index_of;
  for (const auto& [id, image] : model.images) {
    index_of[id] = static_cast<int>(views.size());
    views.push_back(MakeView(model, image));
  }
  std::vector<Pair> pairs;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const ViewEdge& edge = graph.edges[e];
    const auto image1 = index_of.find(edge.image_id1);
    const auto image2 = index_of.find(edge.image_id2);
    if (!edge.IsActive() || image1 == index_of.end() || image2 == index_of.end()) continue;
    pairs.push_back({e, image1->second, image2->second, {}});
  }
  ParallelFor(num_threads, static_cast<int64_t>(pairs.size()), [&](int64_t i) {
    pairs[i].comparison = Compare(views[pairs[i].image1], views[pairs[i].image2]);
  });
  return pairs;
}

// Groups of images, joined along the surest pairs first, but not where more of the pairs between
// two groups see two places than see one.
class Groups {
 public:
  Groups(int num_images, const std::vector<Pair>& pairs)
      : pairs_(pairs), sets_(num_images), pairs_of_(num_images) {
    std::vector<int> order;
    for (size_t k = 0; k < pairs.size(); ++k) {
      order.push_back(static_cast<int>(k));
      pairs_of_[pairs[k].image1].push_back(static_cast<int>(k));
      pairs_of_[pairs[k].image2].push_back(static_cast<int>(k));
    }
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
      return std::make_pair(-pairs[a].Vote(), pairs[a].comparison.conflict) <
             std::make_pair(-pairs[b].Vote(), pairs[b].comparison.conflict);
    });
    for (const int k : order) {
      if (Balance(Root(pairs[k].image1), Root(pairs[k].image2)) >= 0) JoinPair(pairs[k]);
    }
    // An image or two that fit nowhere are not a place: they go where most of their pairs lead.
    for (const int k : order) {
      const Pair& pair = pairs[k];
      if (std::min(sets_.SizeOf(pair.image1), sets_.SizeOf(pair.image2)) < kMinGroup) {
        JoinPair(pair);
      }
    }
  }

  int Root(int i) { return sets_.Find(i); }

 private:
  // Votes of the pairs between two groups.
  int Balance(int root1, int root2) {
    if (root1 == root2) return 0;
    if (pairs_of_[root1].size() > pairs_of_[root2].size()) std::swap(root1, root2);
    int balance = 0;
    for (const int k : pairs_of_[root1]) {
      const int end1 = Root(pairs_[k].image1);
      const int end2 = Root(pairs_[k].image2);
      if ((end1 == root1 && end2 == root2) || (end1 == root2 && end2 == root1)) {
        balance += pairs_[k].Vote();
      }
    }
    return balance;
  }
  void JoinPair(const Pair& pair) {
    const int root1 = Root(pair.image1);
    const int root2 = Root(pair.image2);
    if (!sets_.Union(root1, root2)) return;
    const int root = Root(root1);
    std::vector<int>& absorbed = pairs_of_[root == root1 ? root2 : root1];
    pairs_of_[root].insert(pairs_of_[root].end(), absorbed.begin(), absorbed.end());
    absorbed = {};
  }

  const std::vector<Pair>& pairs_;
  UnionFind sets_;
  std::vector<std::vector<int>> pairs_of_;  // of roots
};

}  // namespace

std::vector<size_t> EdgesBetweenTwins(const Reconstruction& model, const ViewGraph& graph,
                                      int num_threads) {
  const std::vector<Pair> pairs = ComparePairs(model, graph, num_threads);
  Groups groups(static_cast<int>(model.images.size()), pairs);
  std::vector<size_t> between;
  for (const Pair& pair : pairs) {
    if (groups.Root(pair.image1) != groups.Root(pair.image2)) between.push_back(pair.edge);
  }
  return between;
}

}  // namespace cairn
