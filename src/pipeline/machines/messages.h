#pragma once

#include <cstdint>
#include <string>

#include "base/bytes.h"
#include "cairn/features/features.h"
#include "cairn/image/bitmap.h"
#include "cairn/matching/matching.h"
#include "cairn/two_view/options.h"
#include "pipeline/pairs/feed.h"
#include "pipeline/pairs/verify.h"
#include "pipeline/stages/masks.h"

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

// What helpers compute with.
struct HelperSetup {
  uint64_t seed = 0;
  int num_threads = 0;  // of each; 0: all
  std::string verifier;
  FeatureOptions features;
  MatchingOptions matching;
  TwoViewOptions verification;
  int num_on_machine = 1;  // ranks that share the memory of its machine, itself included
};

// A photograph whose features are wanted.
struct PhotoTask {
  uint64_t item = 0;  // which it is, for rank 0
  PhotoPaths photo;
  ImageSize camera_size;
  uint64_t input_hash = 0;  // of the photograph and its mask (masks.h)
};

struct PhotoResult {
  uint64_t item = 0;
  std::string error;  // why there are none
  Features features;
};

struct MatchResult {
  image_pair_t pair_id = 0;
  FeatureMatches matches;
};

inline MatchResult MatchTask(const PairTask& task, const MatchingOptions& options) {
  const PairImage &image1 = *task.image1, &image2 = *task.image2;
  return {task.pair_id, MatchDescriptors({image1.descriptors, image1.polarities},
                                         {image2.descriptors, image2.polarities}, options)};
}

// The fields of messages (base/bytes.h).
void VisitBytes(auto& bytes, Is<HelperHello> auto& hello) {
  bytes(hello.build_hash, hello.num_threads, hello.host);
}
void VisitBytes(auto& bytes, Is<HelperSetup> auto& setup) {
  bytes(setup.seed, setup.num_threads, setup.verifier, setup.features, setup.matching,
        setup.verification, setup.num_on_machine);
}
void VisitBytes(auto& bytes, Is<PhotoTask> auto& task) {
  bytes(task.item, task.photo.path, task.photo.mask_path, task.camera_size, task.input_hash);
}
void VisitBytes(auto& bytes, Is<PhotoResult> auto& result) {
  bytes(result.item, result.error, result.features.keypoints, result.features.descriptors,
        result.features.polarities);
}
void VisitBytes(auto& bytes, Is<MatchResult> auto& result) {
  bytes(result.pair_id, result.matches);
}
// Without the images: whether there are any follows it.
void VisitBytes(auto& bytes, Is<PairTask> auto& task) {
  bytes(task.pair_id, task.matches, task.are_best_first, task.weigh_focals, task.input_hash);
}
void VisitBytes(auto& bytes, Is<Camera> auto& camera) {
  bytes(camera.camera_id, camera.model, camera.width, camera.height, camera.params,
        camera.has_prior_focal_length);
}
void VisitBytes(ByteSink& bytes, const Descriptors& descriptors);
void VisitBytes(ByteSource& bytes, Descriptors& descriptors);
void VisitBytes(auto& bytes, Is<PairImage> auto& image) {
  bytes(image.camera, image.keypoints, image.depth, image.descriptors, image.polarities);
}
// A matrix of fixed size.
template <class Matrix>
requires(Matrix::SizeAtCompileTime > 0) void VisitBytes(auto& bytes, Matrix& matrix) {
  for (Eigen::Index i = 0; i < matrix.size(); ++i) bytes(matrix.data()[i]);
}
void VisitBytes(auto& bytes, Is<Rigid3d> auto& pose) {
  bytes(pose.rotation.coeffs(), pose.translation);
}
void VisitBytes(auto& bytes, Is<TwoViewGeometry> auto& geometry) {
  bytes(geometry.config, geometry.cam2_from_cam1, geometry.E, geometry.F, geometry.H,
        geometry.inlier_matches);
}
// What is written of a run (WriteOutcome).
void VisitBytes(auto& bytes, Is<PairOutcome::Run> auto& run) {
  auto& report = run.report;
  bytes(run.verifier, run.step, run.seconds, report.status, report.geometry, report.num_inliers,
        report.num_iterations, report.score, report.residual_px, report.triangulation_angle_deg);
}
void VisitBytes(auto& bytes, Is<PairOutcome> auto& outcome) {
  bytes(outcome.pair_id, outcome.input_hash, outcome.num_matches, outcome.winner,
        outcome.focal_evidence, outcome.runs);
}

}  // namespace cairn
