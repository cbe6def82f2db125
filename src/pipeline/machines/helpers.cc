#include "pipeline/machines/helpers.h"

#include <algorithm>

#include "cairn/base/error.h"

namespace cairn {
namespace {

// A message is sent when it is as large: an image's descriptors have a megabyte.
constexpr int64_t kMaxBatchBytes = 16 << 20;
// Each thread of the job takes the work that is left in so many steps: the first are large, so that
// tasks of one batch share images, and the last ones small, so that all threads end together.
constexpr int64_t kStepsPerThread = 4;
// Seconds of work, of pairs that take milliseconds.
constexpr int64_t kMaxPairsPerThread = 256;

}  // namespace

Helpers::Helpers(Peers& peers, HelperSetup setup, int64_t max_image_bytes, const RunContext& run)
    : peers_(peers),
      max_unsent_bytes_(max_image_bytes / 4),
      helpers_(static_cast<size_t>(peers.size() - 1),
               Helper{"", "", 1, HeldImages(max_image_bytes)}) {
  for (int num_known = 1; num_known < peers.size() && !run.monitor.StopRequested();) {
    const auto message = peers.Receive();
    if (message) {
      ReceiveHello(*message, run.num_threads);
      ++num_known;
    } else {
      peers.Pause();
    }
  }
  if (!wrong_build_.empty()) {
    throw ConfigError("mpirun", wrong_build_ +
                                    " runs another build of the program than rank 0; "
                                    "install the same one on all machines");
  }
  for (int rank = 1; rank < peers.size(); ++rank) {
    const Helper& helper = helpers_[rank - 1];
    run.monitor.Info(helper.name + " helps, with " + std::to_string(helper.num_threads) +
                     (helper.num_threads == 1 ? " thread" : " threads"));
    setup.num_on_machine = num_on_host_.at(helper.host);
    ByteSink message;
    message(MessageKind::kSetup, setup);
    peers.Send(rank, message.Take());
  }
}

void Helpers::ReceiveHello(const Peers::Message& message, int num_threads) {
  const std::string rank = "rank " + std::to_string(message.from);
  if (message.bytes.empty()) throw IoError(rank, "left the job");
  ByteSource source(message.bytes);
  CAIRN_CHECK(source.Get<MessageKind>() == MessageKind::kHello);
  const HelperHello hello = source.Get<HelperHello>();
  Helper& helper = helpers_[message.from - 1];
  helper.host = hello.host;
  ++num_on_host_[hello.host];
  helper.name = rank + " on " + hello.host;
  helper.num_threads = std::max(1, num_threads > 0 ? num_threads : hello.num_threads);
  if (hello.build_hash != own_hello_.build_hash) wrong_build_ = helper.name;
}

HelperLoop::HelperLoop(Helpers* helpers, HelperWork work, const RunContext& run)
    : helpers_(helpers), work_(std::move(work)), run_(run) {
  if (helpers_ == nullptr) return;
  num_threads_ = EffectiveNumThreads(run.num_threads);
  for (Helpers::Helper& helper : helpers_->helpers_) {
    num_threads_ += helper.num_threads;
    helper.images.Clear();
  }
  thread_ = std::thread([this] { Run(); });
}

HelperLoop::~HelperLoop() {
  is_dropped_ = true;
  if (thread_.joinable()) thread_.join();
}

void HelperLoop::Finish() {
  if (thread_.joinable()) thread_.join();
  if (error_) std::rethrow_exception(error_);
}

void HelperLoop::Run() {
  const auto is_waited_for = [](const Helpers::Helper& helper) { return helper.num_waiting > 0; };
  std::vector<Helpers::Helper>& helpers = helpers_->helpers_;
  try {
    while (!is_dropped_ && !run_.monitor.StopRequested()) {
      const bool has_received = ReceiveResults();
      for (int rank = 1; rank < helpers_->peers_.size(); ++rank) SendTasks(rank);
      if (!has_more_ && std::none_of(helpers.begin(), helpers.end(), is_waited_for)) return;
      if (!has_received) helpers_->peers_.Pause();
    }
  } catch (...) {
    error_ = std::current_exception();
    work_.stop();
  }
}

bool HelperLoop::ReceiveResults() {
  bool has_received = false;
  while (const auto message = helpers_->peers_.Receive()) {
    has_received = true;
    Helpers::Helper& helper = helpers_->helpers_[message->from - 1];
    if (message->bytes.empty()) throw IoError(helper.name, "left the job");
    ByteSource source(message->bytes);
    if (source.Get<MessageKind>() == MessageKind::kError) {
      throw IoError(helper.name, std::string(source.GetText()));
    }
    while (!source.IsAtEnd()) {
      ByteSource result(source.GetText());
      work_.accept(result, helper.name);
      --helper.num_waiting;
    }
  }
  return has_received;
}

// A helper has a batch in reserve while it computes another.
void HelperLoop::SendTasks(int rank) {
  Peers& peers = helpers_->peers_;
  Helpers::Helper& helper = helpers_->helpers_[rank - 1];
  const int64_t max_tasks = BatchSize(helper);
  while (has_more_ && helper.num_waiting <= max_tasks &&
         peers.NumUnsentBytes() <= helpers_->max_unsent_bytes_) {
    TaskBatch batch(work_.kind, helper.images);
    while (has_more_ && batch.num_tasks() < max_tasks && batch.NumBytes() < kMaxBatchBytes) {
      has_more_ = work_.add_next(batch);
    }
    if (batch.num_tasks() == 0) return;
    helper.num_waiting += batch.num_tasks();
    peers.Send(rank, batch.Finish());
  }
}

int64_t HelperLoop::BatchSize(const Helpers::Helper& helper) const {
  const int64_t share = work_.num_left() * helper.num_threads / (num_threads_ * kStepsPerThread);
  const int64_t most = work_.kind == TaskKind::kExtract ? 1 : kMaxPairsPerThread;
  return std::clamp<int64_t>(share, helper.num_threads, most * helper.num_threads);
}

}  // namespace cairn
