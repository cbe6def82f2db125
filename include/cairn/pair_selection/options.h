#pragma once

#include <string>
#include <vector>

#include "cairn/base/options.h"

namespace cairn {

// What photographs of a sequence are ordered by.
enum class PhotoOrder { kName, kTime };
inline constexpr NamedValue<PhotoOrder> kPhotoOrders[] = {{PhotoOrder::kName, "name"},
                                                          {PhotoOrder::kTime, "time"}};

struct PairSelectionOptions {
  PhotoOrder order = PhotoOrder::kName;
  int overlap = 10;
  bool quadratic_overlap = true;
  int spatial_neighbors = 20;
  double spatial_radius_m = 100.0;
  int num_words = 64;
  int retrieval_neighbors = 8;
  int max_rounds = 10;
  int min_shared_points = 60;

  void VisitFields(OptionVisitor& v) {
    v.Choice("order", order, kPhotoOrders, "sequential: photographs follow each other by this");
    v.Int("overlap", overlap, {1, 1000}, "sequential: pairs with so many next photographs");
    v.Bool("quadratic_overlap", quadratic_overlap,
           "sequential: also with those 2, 4, 8, ... photographs away, up to 2^overlap");
    v.Int("spatial_neighbors", spatial_neighbors, {1, 1000},
          "spatial: pairs with so many nearest photographs");
    v.Double("spatial_radius_m", spatial_radius_m, {0.0, 1e7},
             "spatial: none farther away than that, meters");
    v.Int("num_words", num_words, {1, 4096}, "retrieval: visual words of the collection");
    v.Int("retrieval_neighbors", retrieval_neighbors, {1, 1000},
          "retrieval: pairs with so many most similar photographs");
    v.Int("max_rounds", max_rounds, {0, 100},
          "rounds in which verified pairs propose further ones; 0: none");
    v.Int("min_shared_points", min_shared_points, {1, 100000},
          "points that a third photograph must share with both, for a pair to be proposed");
  }
};

// Ways of choosing pairs, as users name them in --pairs.
enum class PairWay { kExhaustive, kSequential, kSpatial, kRetrieval, kAuto };
inline constexpr NamedValue<PairWay> kPairWays[] = {{PairWay::kExhaustive, "exhaustive"},
                                                    {PairWay::kSequential, "sequential"},
                                                    {PairWay::kSpatial, "spatial"},
                                                    {PairWay::kRetrieval, "retrieval"},
                                                    {PairWay::kAuto, "auto"}};

// "sequential,retrieval" -> these, in the order of kPairWays. Throws ConfigError for a name that is
// none, for none at all, and where exhaustive or auto stand beside others.
std::vector<PairWay> ParsePairWays(const std::string& text);

}  // namespace cairn
