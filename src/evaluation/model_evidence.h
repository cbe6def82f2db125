#pragma once

#include <functional>
#include <map>
#include <set>
#include <span>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/scene/two_view_geometry.h"

namespace cairn {

// The inlier matches of a verified pair, whether or not it is in use in the view graph.
struct VerifiedPair {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  const FeatureMatches* matches = nullptr;
};

// How much of its verified matches a model explains: those whose keypoints lie in front of both
// cameras and near their epipolar lines under the model's poses and intrinsics.
struct Support {
  int64_t num_matches = 0;
  int64_t num_explained = 0;
  double nats = 0;  // that the explained ones save (ModelEvidence)

  // Most of them are not explained: an image is probably misplaced, a model wrong.
  bool IsContradicted() const { return 2 * num_explained < num_matches; }
  double Share() const { return num_matches > 0 ? double(num_explained) / num_matches : 0.0; }

  Support operator+(const Support& other) const {
    return {num_matches + other.num_matches, num_explained + other.num_explained,
            nats + other.nats};
  }
  Support operator-(const Support& other) const {
    return {num_matches - other.num_matches, num_explained - other.num_explained,
            nats - other.nats};
  }
};
inline constexpr const char* kMisplacedAdvice =
    "look at these photos in the report's 3D view and at their pairs; leave them out, or add "
    "photos "
    "that see the places between them and the others";

struct ModelEvidence {
  // What the model saves in the description of all given matches, nats. A match that lies e px from
  // its epipolar line is a normal error of standard deviation sigma instead of a uniform one over
  // the image: it saves log(width / (sigma sqrt(2 pi))) - e^2 / (2 sigma^2), and nothing where that
  // is negative or the point is behind a camera. The independent ones of the explained matches save
  // as much as these do on average: else a part that looks like another one, shown in its place,
  // would gain by all pairs of their images what is one coincidence a point. Of a track that the
  // model has points of, those count that join the keypoints of a point, and those near it that
  // the model's filters took away: pairs alone do not see that a shape is bent, its points fall
  // apart. An image costs the six parameters of its pose, a camera that is not constant its focal
  // lengths and distortions, each half the logarithm of its matches (Rissanen, "Modeling by
  // shortest data description", 1978). Models of the same images and matches can be compared by it,
  // whatever they were built from.
  double nats = 0;
  int64_t num_independent =
      0;  // of the explained matches (CountIndependent), that points agree with
  Support all;
  Support inside;                     // of pairs between images of the model
  int num_pairs = 0;                  // such pairs
  int num_contradicted = 0;           // of these, explained to less than half
  std::vector<Support> pairs;         // in the order of the input
  std::map<image_t, Support> images;  // of the model; a match counts for both of its images
};

// Of all matches, those that do not follow from others: n keypoints that matches join to a track
// have n - 1.
int64_t CountIndependent(std::span<const VerifiedPair> pairs, int num_threads = 1);

// The evidence for a model in verified pairs. Pairs with an image that the model lacks have nothing
// explained; they count in `all`, not in num_pairs. O(number of matches). The result does not
// depend on run.num_threads.
ModelEvidence EvaluateEvidence(const Reconstruction& model, std::span<const VerifiedPair> pairs,
                               const RunContext& run = {},
                               const std::set<camera_t>& constant_cameras = {});

// ModelEvidence::pairs alone, of pairs that are in memory a part at a time: `read` returns the next
// ones, none at the end.
using PairReader = std::function<std::span<const VerifiedPair>()>;
std::vector<Support> EvaluateSupports(const Reconstruction& model, const PairReader& read,
                                      const RunContext& run = {});

// How well the matches of pairs between images of a model agree with it: what they save, nats,
// without regard to which of them are independent, and to parameters. `sharp` is by a quarter of
// ModelEvidence's standard deviation, the noise of photographs in focus: it tells models apart that
// differ by less. The whole standard deviation tells what a sharp eye does not see, a shape that
// bends until its loops fall apart.
struct Agreement {
  double sharp_nats = 0;
  double whole_nats = 0;
  std::map<image_t, double> sharp_nats_of_images;  // a match counts for both of its images
};
Agreement EvaluateAgreement(const Reconstruction& model, std::span<const VerifiedPair> pairs,
                            const RunContext& run = {});
// How many more nats the matches of each image save in model 2 than in model 1, of the same images,
// together, in standard errors of that sum: how far it depends on which images there are (the
// jackknife; as in Vuong, "Likelihood ratio tests for model selection", 1989, without the number of
// parameters, which are few). By sharp nats, but no gain where whole ones are not gained.
double StandardErrorsOfGain(const Agreement& model1, const Agreement& model2);
// The deviate of the normal distribution that is as unlikely as t of Student's with so many degrees
// of freedom: few images tell a standard error badly (Wallace, "Bounds on normal approximations to
// Student's and the chi-square distributions", 1959).
double NormalDeviate(double t, double degrees);

// Those matches of each pair that the model explains; none where it lacks an image.
std::vector<FeatureMatches> ExplainedMatches(const Reconstruction& model,
                                             std::span<const VerifiedPair> pairs,
                                             const RunContext& run = {});

}  // namespace cairn
