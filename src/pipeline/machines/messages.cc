#include "pipeline/machines/messages.h"

#include <unistd.h>

#include <thread>

#include "base/hash.h"

namespace cairn {
namespace {

template <class Matrix>
void PutOptionalMatrix(ByteSink& sink, const std::optional<Matrix>& matrix) {
  sink.Add(matrix.has_value());
  if (matrix) sink.AddArray(std::span(matrix->data(), static_cast<size_t>(matrix->size())));
}

std::optional<Eigen::Matrix3d> GetOptionalMatrix(ByteSource& source) {
  if (!source.Get<bool>()) return std::nullopt;
  const std::vector<double> values = source.GetVector<double>();
  CAIRN_CHECK_EQ(values.size(), 9u);
  return Eigen::Matrix3d(values.data());
}

void PutPose(ByteSink& sink, const std::optional<Rigid3d>& pose) {
  sink.Add(pose.has_value());
  if (!pose) return;
  const Eigen::Quaterniond& q = pose->rotation;
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) sink.Add(value);
  for (const double value : pose->translation) sink.Add(value);
}

std::optional<Rigid3d> GetPose(ByteSource& source) {
  if (!source.Get<bool>()) return std::nullopt;
  double v[7];
  for (double& value : v) value = source.Get<double>();
  return Rigid3d(Eigen::Quaterniond(v[0], v[1], v[2], v[3]), Eigen::Vector3d(v[4], v[5], v[6]));
}

void PutGeometry(ByteSink& sink, const TwoViewGeometry& geometry) {
  sink.Add(geometry.config);
  PutPose(sink, geometry.cam2_from_cam1);
  PutOptionalMatrix(sink, geometry.E);
  PutOptionalMatrix(sink, geometry.F);
  PutOptionalMatrix(sink, geometry.H);
  sink.AddVector(geometry.inlier_matches);
}

TwoViewGeometry GetGeometry(ByteSource& source) {
  TwoViewGeometry geometry;
  geometry.config = source.Get<TwoViewConfig>();
  geometry.cam2_from_cam1 = GetPose(source);
  geometry.E = GetOptionalMatrix(source);
  geometry.F = GetOptionalMatrix(source);
  geometry.H = GetOptionalMatrix(source);
  geometry.inlier_matches = source.GetVector<FeatureMatch>();
  return geometry;
}

void PutEvidence(ByteSink& sink, const std::optional<FocalEvidence>& evidence) {
  sink.Add(evidence.has_value());
  if (evidence) sink.Add(*evidence);
}

std::optional<FocalEvidence> GetEvidence(ByteSource& source) {
  if (!source.Get<bool>()) return std::nullopt;
  return source.Get<FocalEvidence>();
}

// What is written of a run (WriteOutcome).
void PutRun(ByteSink& sink, const PairOutcome::Run& run) {
  const PairReport& report = run.report;
  sink.AddText(run.verifier);
  sink.AddText(run.step);
  sink.Add(run.seconds);
  sink.Add(report.status);
  PutGeometry(sink, report.geometry);
  sink.Add(report.num_inliers);
  sink.Add(report.num_iterations);
  sink.Add(report.score);
  sink.Add(report.residual_px);
  sink.Add(report.triangulation_angle_deg);
}

PairOutcome::Run GetRun(ByteSource& source) {
  PairOutcome::Run run;
  run.verifier = source.GetText();
  run.step = source.GetText();
  run.seconds = source.Get<double>();
  PairReport& report = run.report;
  report.status = source.Get<PairStatus>();
  report.geometry = GetGeometry(source);
  report.num_inliers = source.Get<int>();
  report.num_iterations = source.Get<int64_t>();
  report.score = source.Get<double>();
  report.residual_px = source.Get<double>();
  report.triangulation_angle_deg = source.Get<double>();
  return run;
}

void PutDescriptors(ByteSink& sink, std::span<const uint8_t> values, int64_t num_columns) {
  sink.Add(num_columns);
  sink.AddArray(values);
}

Descriptors GetDescriptors(ByteSource& source) {
  const auto num_columns = source.Get<int64_t>();
  const std::vector<uint8_t> values = source.GetVector<uint8_t>();
  const int64_t num_rows = num_columns > 0 ? std::ssize(values) / num_columns : 0;
  return Eigen::Map<const Descriptors>(values.data(), num_rows, num_columns);
}

}  // namespace

HelperHello HelperHello::OfThisProcess() {
  char host[256] = "";
  gethostname(host, sizeof(host) - 1);
  return {HashFile("/proc/self/exe"), static_cast<int>(std::thread::hardware_concurrency()), host};
}

void Put(ByteSink& sink, const HelperHello& hello) {
  sink.Add(hello.build_hash);
  sink.Add(hello.num_threads);
  sink.AddText(hello.host);
}

HelperHello GetHello(ByteSource& source) {
  HelperHello hello;
  hello.build_hash = source.Get<uint64_t>();
  hello.num_threads = source.Get<int>();
  hello.host = source.GetText();
  return hello;
}

void Put(ByteSink& sink, HelperSetup setup) {
  sink.Add(setup.seed);
  sink.Add(setup.num_threads);
  sink.AddText(setup.verifier);
  OptionSaver saver(sink);
  setup.features.VisitFields(saver);
  setup.matching.VisitFields(saver);
  setup.verification.VisitFields(saver);
}

HelperSetup GetSetup(ByteSource& source) {
  HelperSetup setup;
  setup.seed = source.Get<uint64_t>();
  setup.num_threads = source.Get<int>();
  setup.verifier = source.GetText();
  OptionLoader loader(source);
  setup.features.VisitFields(loader);
  setup.matching.VisitFields(loader);
  setup.verification.VisitFields(loader);
  return setup;
}

void Put(ByteSink& sink, const PhotoTask& task) {
  sink.Add(task.item);
  sink.AddText(task.photo.path);
  sink.AddText(task.photo.mask_path);
  sink.Add(task.camera_size);
  sink.Add(task.input_hash);
}

PhotoTask GetPhotoTask(ByteSource& source) {
  PhotoTask task;
  task.item = source.Get<uint64_t>();
  task.photo.path = source.GetText();
  task.photo.mask_path = source.GetText();
  task.camera_size = source.Get<ImageSize>();
  task.input_hash = source.Get<uint64_t>();
  return task;
}

void Put(ByteSink& sink, const PhotoResult& result) {
  const Descriptors& descriptors = result.features.descriptors;
  sink.Add(result.item);
  sink.AddText(result.error);
  sink.AddVector(result.features.keypoints);
  PutDescriptors(sink, {descriptors.data(), static_cast<size_t>(descriptors.size())},
                 descriptors.cols());
}

PhotoResult GetPhotoResult(ByteSource& source) {
  PhotoResult result;
  result.item = source.Get<uint64_t>();
  result.error = source.GetText();
  result.features.keypoints = source.GetVector<Keypoint>();
  result.features.descriptors = GetDescriptors(source);
  return result;
}

void Put(ByteSink& sink, const PairImage& image) {
  const Camera& camera = image.camera;
  sink.Add(camera.camera_id);
  sink.Add(camera.model);
  sink.Add(camera.width);
  sink.Add(camera.height);
  sink.AddVector(camera.params);
  sink.Add(camera.has_prior_focal_length);
  sink.AddVector(image.keypoints ? *image.keypoints : std::vector<Keypoint>());
  sink.AddVector(image.depth);
  const int num_descriptors = image.descriptors.size();
  const uint8_t* const rows = num_descriptors > 0 ? image.descriptors.Row(0) : nullptr;
  PutDescriptors(sink, {rows, static_cast<size_t>(num_descriptors) * 128}, 128);
}

PairImage GetPairImage(ByteSource& source) {
  PairImage image;
  Camera& camera = image.camera;
  camera.camera_id = source.Get<camera_t>();
  camera.model = source.Get<CameraModel>();
  camera.width = source.Get<int>();
  camera.height = source.Get<int>();
  camera.params = source.GetVector<double>();
  camera.has_prior_focal_length = source.Get<bool>();
  image.keypoints = std::make_shared<const std::vector<Keypoint>>(source.GetVector<Keypoint>());
  image.depth = source.GetVector<DepthSample>();
  image.descriptors = PreparedDescriptors(GetDescriptors(source));
  return image;
}

void Put(ByteSink& sink, const PairTask& task) {
  sink.Add(task.pair_id);
  sink.Add(task.image1 != nullptr);
  sink.AddVector(task.matches);
  sink.Add(task.are_best_first);
  sink.Add(task.weigh_focals);
  sink.Add(task.input_hash);
}

SentPairTask GetPairTask(ByteSource& source) {
  SentPairTask sent;
  PairTask& task = sent.task;
  task.pair_id = source.Get<image_pair_t>();
  sent.has_images = source.Get<bool>();
  task.matches = source.GetVector<FeatureMatch>();
  task.are_best_first = source.Get<bool>();
  task.weigh_focals = source.Get<bool>();
  task.input_hash = source.Get<uint64_t>();
  return sent;
}

void Put(ByteSink& sink, const MatchResult& result) {
  sink.Add(result.pair_id);
  sink.AddVector(result.matches);
}

MatchResult GetMatchResult(ByteSource& source) {
  MatchResult result;
  result.pair_id = source.Get<image_pair_t>();
  result.matches = source.GetVector<FeatureMatch>();
  return result;
}

void Put(ByteSink& sink, const PairOutcome& outcome) {
  sink.Add(outcome.pair_id);
  sink.Add(outcome.input_hash);
  sink.Add(outcome.num_matches);
  sink.Add(outcome.winner);
  PutEvidence(sink, outcome.focal_evidence);
  sink.Add(static_cast<uint64_t>(outcome.runs.size()));
  for (const PairOutcome::Run& run : outcome.runs) PutRun(sink, run);
}

PairOutcome GetPairOutcome(ByteSource& source) {
  PairOutcome outcome;
  outcome.pair_id = source.Get<image_pair_t>();
  outcome.input_hash = source.Get<uint64_t>();
  outcome.num_matches = source.Get<int>();
  outcome.winner = source.Get<int>();
  outcome.focal_evidence = GetEvidence(source);
  const auto num_runs = source.Get<uint64_t>();
  for (uint64_t i = 0; i < num_runs; ++i) outcome.runs.push_back(GetRun(source));
  return outcome;
}

}  // namespace cairn
