#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include "cairn/base/named_value.h"
#include "cairn/base/types.h"
#include "cairn/geometry/gps.h"
#include "cairn/matching/matching.h"
#include "cairn/pair_selection/options.h"
#include "cairn/scene/features.h"
#include "cairn/scene/image.h"

// Which pairs of photographs are worth matching. Each way is a function of values; what they are
// read from, and the record of what was chosen, is the pipeline's.
namespace cairn {

// Why a pair was chosen, as the database has it.
enum class PairReason {
  kExhaustive,  // all pairs are
  kSequential,  // the photographs follow each other
  kSpatial,     // they were taken near each other
  kRetrieval,   // they look alike
  kTwoEdges,    // a third photograph sees points that both see
  kLoop,        // they look alike, and are far from each other in the view graph
  kWeak,        // one of them has few verified pairs, or its part of the view graph is small
};
inline constexpr NamedValue<PairReason> kPairReasons[] = {{PairReason::kExhaustive, "exhaustive"},
                                                          {PairReason::kSequential, "sequential"},
                                                          {PairReason::kSpatial, "spatial"},
                                                          {PairReason::kRetrieval, "retrieval"},
                                                          {PairReason::kTwoEdges, "two_edges"},
                                                          {PairReason::kLoop, "loop"},
                                                          {PairReason::kWeak, "weak"}};

// ---- sequential

// The images of each folder in the order of their names, in which numbers count as numbers (a9
// before a10).
std::vector<std::vector<image_t>> SequencesByName(std::vector<Image> images);
// The images of each folder that have a time, in its order, those of one time by name.
std::vector<std::vector<image_t>> SequencesByTime(const std::vector<Image>& images,
                                                  const std::map<image_t, double>& taken_at_s);
// Each image with the `overlap` next ones of its sequence, and, if quadratic, with those 2, 4, 8,
// ... 2^overlap further on. Ascending.
std::vector<image_pair_t> SequentialPairs(const std::vector<std::vector<image_t>>& sequences,
                                          int overlap, bool quadratic);

// ---- spatial

// Each image with its `neighbors` nearest ones, none farther than radius_m (of the straight line
// between positions on WGS84; altitudes, which GPS knows badly, do not count), and with as many of
// the same position: a receiver without a fix repeats its last one. Ascending.
std::vector<image_pair_t> SpatialPairs(const std::map<image_t, GpsPosition>& positions,
                                       int neighbors, double radius_m, int num_threads);

// ---- retrieval

using FloatRows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Descriptors as unit vectors: every k-th one, so that at most max_rows are taken.
FloatRows SampleDescriptors(const Descriptors& descriptors, int max_rows);

// Visual words: Lloyd's k-means of the samples (rows), from rows that are drawn with a fixed seed.
// With fewer samples than words, the samples. The same for any number of threads.
FloatRows TrainWords(const FloatRows& samples, int num_words, int num_threads);

// An image's descriptors as one unit vector (words x 128): VLAD (Jegou et al., CVPR 2010) of
// residuals of unit length (Delhumeau et al., ACM MM 2013), so that each feature counts alike, and
// each word's sum scaled to unit length (Arandjelovic and Zisserman, CVPR 2013), so that a word of
// many features, a burst, counts no more than one of few. Zero without descriptors.
Eigen::RowVectorXf DescribeImage(const Descriptors& descriptors, const FloatRows& words);

// Images as retrieval knows them: ids ascending, descriptions as rows.
struct DescribedImages {
  std::vector<image_t> ids;
  FloatRows descriptions;
  std::vector<Descriptors> largest_features;
};

// An image that asks for candidates.
struct CandidateQuery {
  std::vector<image_t> left_out;  // ascending
  // Left out, too: ascending, one list of all images that have it; null: none.
  std::shared_ptr<const std::vector<image_t>> part = nullptr;
};
using Queries = std::map<image_t, CandidateQuery>;

// For each image that asks, the `num` ones with the largest products of descriptions, best first,
// of equal ones the first. All are compared: 10^4 images of 64 words take a minute of one core.
std::vector<std::vector<image_t>> MostSimilar(const DescribedImages& images, const Queries& queries,
                                              int num, int num_threads);

// The `num` descriptors of the features with the largest areas, of equal ones the first.
Descriptors LargestFeatures(const std::vector<Keypoint>& keypoints, const Descriptors& descriptors,
                            int num);

// An image that looks like another one.
struct Candidate {
  image_t image_id = 0;
  int num_matches = 0;  // of their largest features
  bool operator==(const Candidate&) const = default;
};
using Candidates = std::map<image_t, std::vector<Candidate>>;
// For each image that asks the candidates, best first: the num_candidates most similar ones by
// description, in the order of their matches of largest features, which is what decides; of equal
// ones the more similar first.
Candidates FindCandidates(const DescribedImages& images, const Queries& queries, int num_candidates,
                          int num_threads);

// Each image with its first `neighbors` candidates. Ascending.
std::vector<image_pair_t> RetrievalPairs(const Candidates& candidates, int neighbors);

// ---- rounds

// What is known after a round: pairs that were matched, and those of them that are verified.
struct PairEvidence {
  std::set<image_t> images;
  std::set<image_pair_t> matched;
  std::map<image_pair_t, FeatureMatches> verified;  // inliers
};

// Pairs that were not matched, of images that a third one is verified with, where at least
// min_shared_points keypoints of the one lead through inliers to keypoints of the other. Each image
// asks for those with the most such keypoints, until it has max_neighbors with its verified pairs;
// a pair that either image asks for is taken. Ascending.
std::vector<image_pair_t> PairsTwoEdgesApart(const PairEvidence& evidence, int min_shared_points,
                                             int max_neighbors, int num_threads);
// Each image asks for those that it was not matched with and that are more than two edges away in
// the view graph.
Queries AskForLoops(const PairEvidence& evidence, int num_threads);
// Of what they found the best, if it has at least as many matches of largest features as tell those
// of the first candidates that are verified from others that were matched (the count that errs
// least often). Ascending.
std::vector<image_pair_t> PairsClosingLoops(const PairEvidence& evidence, const Candidates& first,
                                            const Candidates& found);
// Images with fewer than kFewPairs verified pairs (with two, one wrong pair cannot be told from the
// right one) ask for those that they were not matched with; those outside of the largest part of
// the view graph, for images outside of their own part.
inline constexpr int kFewPairs = 3;
Queries AskForWeakImages(const PairEvidence& evidence);

}  // namespace cairn
