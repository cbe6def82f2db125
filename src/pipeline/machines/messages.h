#pragma once

#include <cstdint>
#include <string>

#include "base/bytes.h"
#include "cairn/features/features.h"
#include "cairn/image/bitmap.h"
#include "cairn/matching/matching.h"
#include "cairn/two_view/options.h"
#include "pipeline/pairs/feed.h"
#include "pipeline/pairs/write.h"
#include "pipeline/stages/extract_photo.h"

namespace cairn {

// What rank 0 of a job and its helpers, all other ranks, tell each other. The first byte of a
// message is its kind; an empty message from rank 0 ends the job.
enum class MessageKind : uint8_t {
  kHello,    // helper: a HelperHello
  kSetup,    // rank 0: a HelperSetup, once
  kTasks,    // rank 0: a TaskKind, images to forget, images, tasks
  kResults,  // helper: results of tasks, in any order
  kError,    // helper: why it cannot go on
};
enum class TaskKind : uint8_t { kExtract, kMatch, kVerify };

// Read by rank 0 even of another build, and so the one message with a format that stays.
struct HelperHello {
  uint64_t build_hash = 0;  // of the program's file
  int num_threads = 0;      // of the machine
  std::string host;

  static HelperHello OfThisProcess();
};
void Put(ByteSink& sink, const HelperHello& hello);
HelperHello GetHello(ByteSource& source);

// What helpers compute with.
struct HelperSetup {
  uint64_t seed = 0;
  int num_threads = 0;  // of each; 0: all
  std::string verifier;
  FeatureOptions features;
  MatchingOptions matching;
  TwoViewOptions verification;
};
void Put(ByteSink& sink, HelperSetup setup);
HelperSetup GetSetup(ByteSource& source);

// A photograph whose features are wanted.
struct PhotoTask {
  uint64_t item = 0;  // which it is, for rank 0
  PhotoPaths photo;
  ImageSize camera_size;
  uint64_t input_hash = 0;  // of the photograph and its mask (masks.h)
};
void Put(ByteSink& sink, const PhotoTask& task);
PhotoTask GetPhotoTask(ByteSource& source);

struct PhotoResult {
  uint64_t item = 0;
  std::string error;  // why there are none
  Features features;
};
void Put(ByteSink& sink, const PhotoResult& result);
PhotoResult GetPhotoResult(ByteSource& source);

void Put(ByteSink& sink, const PairImage& image);
PairImage GetPairImage(ByteSource& source);

// Without the images, of which only is told whether there are any.
void Put(ByteSink& sink, const PairTask& task);
struct SentPairTask {
  PairTask task;
  bool has_images = false;
};
SentPairTask GetPairTask(ByteSource& source);

struct MatchResult {
  image_pair_t pair_id = 0;
  FeatureMatches matches;
};
void Put(ByteSink& sink, const MatchResult& result);
MatchResult GetMatchResult(ByteSource& source);

void Put(ByteSink& sink, const PairOutcome& outcome);
PairOutcome GetPairOutcome(ByteSource& source);

}  // namespace cairn
