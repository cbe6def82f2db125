#include <algorithm>
#include <functional>
#include <utility>

#include "mapper/image_nodes.h"
#include "mapper/stages.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

// Images, as indices, that the pairs with the most support join, and the pairs that lead out of
// them.
struct Group {
  std::vector<int> members;
  Support across;
  std::vector<MisplacedGroup> misplaced;  // the largest such groups within it
};

// The pairs between images of a model.
struct PairsWithin {
  ImageNodes images;
  std::vector<GraphEdge> edges;
  std::vector<Support> supports;
};

using SupportOfEdge = std::function<Support(size_t)>;

PairsWithin FindPairsWithin(const BuiltModel& built, const SupportOfEdge& support_of) {
  PairsWithin pairs{ImageNodes(built.model->images), {}, {}};
  for (size_t e = 0; e < built.graph.edges.size(); ++e) {
    const ViewEdge& edge = built.graph.edges[e];
    if (built.evidence.pairs[e].num_matches == 0 || !IsWithin(edge, *built.model)) continue;
    pairs.edges.push_back(pairs.images.EdgeOf(edge));
    pairs.supports.push_back(support_of(e));
  }
  return pairs;
}

// Whether the pairs that lead out of a group say that it is misplaced.
using Suspicion = std::function<bool(const Support&)>;

// Joins groups until no pair leads from one to another.
class Grouping {
 public:
  Grouping(const PairsWithin& pairs, Suspicion is_suspect)
      : pairs_(pairs),
        is_suspect_(std::move(is_suspect)),
        adjacency_(BuildAdjacency(pairs.images.size(), pairs.edges)) {
    const int num_images = pairs.images.size();
    groups_.resize(num_images);
    group_of_.resize(num_images);
    for (int i = 0; i < num_images; ++i) {
      group_of_[i] = i;
      groups_[i].members = {i};
      for (const int e : adjacency_.EdgesOf(i)) {
        groups_[i].across = groups_[i].across + pairs.supports[e];
      }
      Judge(groups_[i]);
    }
  }

  void JoinAll() {
    const auto key = [&](int e) { return -pairs_.supports[e].num_explained; };
    for (const int e : SortedOrder(pairs_.edges.size(), key)) {
      Join(group_of_[pairs_.edges[e].node1], group_of_[pairs_.edges[e].node2]);
    }
  }

  // The one with the most matches that are not explained first.
  std::vector<MisplacedGroup> Misplaced() const {
    std::vector<MisplacedGroup> misplaced;
    for (const Group& group : groups_) {
      misplaced.insert(misplaced.end(), group.misplaced.begin(), group.misplaced.end());
    }
    std::ranges::stable_sort(misplaced, std::greater<>(), &MisplacedGroup::num_contradicting);
    return misplaced;
  }

 private:
  void Join(int a, int b) {
    if (a == b) return;
    if (groups_[a].members.size() < groups_[b].members.size()) std::swap(a, b);
    Support between;
    for (const int i : groups_[b].members) {
      for (const int e : adjacency_.EdgesOf(i)) {
        const GraphEdge& edge = pairs_.edges[e];
        if (group_of_[edge.node1 == i ? edge.node2 : edge.node1] == a) {
          between = between + pairs_.supports[e];
        }
      }
    }
    Group& group = groups_[a];
    for (const int i : groups_[b].members) {
      group_of_[i] = a;
      group.members.push_back(i);
    }
    group.across = group.across + groups_[b].across - between - between;
    group.misplaced.insert(group.misplaced.end(), groups_[b].misplaced.begin(),
                           groups_[b].misplaced.end());
    groups_[b] = {};
    Judge(group);
  }

  // Of a group and the others, the fewer images are misplaced.
  void Judge(Group& group) {
    if (!is_suspect_(group.across) || 2 * std::ssize(group.members) >= pairs_.images.size()) {
      return;
    }
    MisplacedGroup misplaced;
    misplaced.images = pairs_.images.ImagesOf(group.members);
    misplaced.num_contradicting = group.across.num_matches - group.across.num_explained;
    group.misplaced = {std::move(misplaced)};
  }

  const PairsWithin& pairs_;
  const Suspicion is_suspect_;
  const GraphAdjacency adjacency_;
  std::vector<Group> groups_;
  std::vector<int> group_of_;
};

std::vector<MisplacedGroup> FindGroups(ModelStage& stage, const PairsWithin& pairs,
                                       size_t min_images, Suspicion is_suspect) {
  Grouping grouping(pairs, std::move(is_suspect));
  grouping.JoinAll();
  std::vector<MisplacedGroup> misplaced = grouping.Misplaced();
  std::erase_if(misplaced, [&](const auto& group) { return group.images.size() < min_images; });
  size_t num_images = 0;
  for (const MisplacedGroup& group : misplaced) num_images += group.images.size();
  stage.Add("groups", misplaced.size());
  stage.Add("images", num_images);
  return misplaced;
}

}  // namespace

std::vector<MisplacedGroup> FindMisplacedGroups(StageContext& context, const BuiltModel& built) {
  ModelStage stage(context, "misplaced_groups");
  const PairsWithin pairs =
      FindPairsWithin(built, [&](size_t e) { return built.evidence.pairs[e]; });
  return FindGroups(stage, pairs, 1, [](const Support& across) { return across.IsContradicted(); });
}

std::vector<MisplacedGroup> FindGroupsOfOwnScale(StageContext& context, const BuiltModel& built) {
  ModelStage stage(context, "groups_of_own_scale");
  const PairsWithin pairs = FindPairsWithin(built, [&](size_t e) {
    const FeatureMatches& matches = context.scene.matches.at(built.graph.edges[e].PairId());
    return Support{built.evidence.pairs[e].num_explained,
                   NumSharedPoints(built.graph.edges[e], matches, *built.model)};
  });
  Support all;
  for (const Support& support : pairs.supports) all = all + support;
  return FindGroups(stage, pairs, 2,
                    [&](const Support& across) { return 3 * across.Share() < 2 * all.Share(); });
}

}  // namespace cairn
