#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <thread>

#include "base/hash.h"
#include "base/memory.h"
#include "base/work_queue.h"
#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/pipeline/build_pipeline.h"
#include "features/plane_memory.h"
#include "pipeline/machines/memory_gate.h"
#include "pipeline/machines/messages.h"

namespace cairn {
namespace {

// Threads that compute tasks, each with the verifiers that it needs.
class TaskThreads {
 public:
  // A task gives its result as bytes.
  using Task = std::function<std::string(TaskVerifier& verifier)>;

  explicit TaskThreads(const HelperSetup& setup)
      : verifiers_(MakeVerifiers(setup.verifier, setup.verification)), seed_(setup.seed) {
    try {
      const int num_threads = EffectiveNumThreads(setup.num_threads);
      while (std::ssize(threads_) < num_threads) threads_.emplace_back([this] { Run(); });
    } catch (const std::system_error&) {  // These are all that the system lets start.
      if (threads_.empty()) throw;
    }
  }

  // What is waiting is dropped.
  ~TaskThreads() {
    tasks_.Stop();
    for (std::thread& thread : threads_) thread.join();
  }

  void Push(Task task) { tasks_.Push(std::move(task)); }

  // The results since the last call. Throws what a task threw.
  std::vector<std::string> TakeResults() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
    return std::exchange(results_, {});
  }

 private:
  void Run() {
    TaskVerifier verifier(verifiers_, seed_);
    while (const std::optional<Task> task = tasks_.Next()) {
      std::string result;
      std::exception_ptr error;
      try {
        result = (*task)(verifier);
      } catch (...) {
        error = std::current_exception();
      }
      const std::lock_guard<std::mutex> lock(mutex_);
      if (error) error_ = error;
      results_.push_back(std::move(result));
    }
  }

  const std::vector<NamedVerifier> verifiers_;
  const uint64_t seed_;
  WorkQueue<Task> tasks_;
  std::mutex mutex_;  // of what follows
  std::vector<std::string> results_;
  std::exception_ptr error_;
  std::vector<std::thread> threads_;
};

template <class Result>
std::string ToBytes(const Result& result) {
  ByteSink sink;
  sink(result);
  return sink.Take();
}

std::string Extract(const PhotoTask& task, const FeatureOptions& options) {
  PhotoResult result{task.item, "", {}};
  try {
    const auto& [path, mask_path] = task.photo;
    if (FeatureInputHash(HashFile(path), mask_path) != task.input_hash) {
      throw IoError(path, "is not the file that rank 0 has, or its mask is not");
    }
    result.features = ExtractPhoto(task.photo, task.camera_size, options);
  } catch (const IoError& error) {
    result.error = error.reason();
  }
  return ToBytes(result);
}

// What this machine can still allocate; no limit where that is unknown.
int64_t AvailableBytes() {
  const int64_t available = ReadMemoryUse().available;
  return available < 0 ? std::numeric_limits<int64_t>::max() : available;
}

// The way of features: planes that wait for the next photograph, and no more photographs at a time
// than there is memory for.
struct Extraction {
  explicit Extraction(int num_on_machine) : memory(AvailableBytes() / num_on_machine) {}

  PlaneReuse reuse;
  MemoryGate memory;
};

// What one helper has: the setup, and images for pairs to come.
class Helper {
 public:
  explicit Helper(Peers& peers) : peers_(peers) {}

  // Until rank 0 leaves.
  void Run() {
    Send(MessageKind::kHello, ToBytes(HelperHello::OfThisProcess()));
    while (true) {
      bool is_idle = true;
      while (const auto message = peers_.Receive()) {
        if (message->bytes.empty()) return;
        is_idle = false;
        Try([&] { Handle(message->bytes); });
      }
      Try([&] { is_idle &= !SendResults(); });
      if (is_idle) peers_.Pause();
    }
  }

 private:
  // Rank 0 ends the job when it hears of an error.
  template <class Action>
  void Try(const Action& action) {
    try {
      action();
    } catch (const std::bad_alloc&) {
      SendError("out of memory");
    } catch (const std::exception& error) {
      SendError(error.what());
    }
  }

  void Send(MessageKind kind, const std::string& content) {
    ByteSink message;
    message(kind);
    message.Append(content);
    peers_.Send(0, message.Take());
  }

  void SendError(std::string_view reason) {
    ByteSink text;
    text.AddText(reason);
    Send(MessageKind::kError, text.Take());
  }

  bool SendResults() {
    if (!threads_) return false;
    const std::vector<std::string> results = threads_->TakeResults();
    if (results.empty()) return false;
    ByteSink sink;
    for (const std::string& result : results) sink.AddText(result);
    Send(MessageKind::kResults, sink.Take());
    return true;
  }

  void Handle(const std::string& bytes) {
    ByteSource source(bytes);
    if (source.Get<MessageKind>() == MessageKind::kSetup) {
      setup_ = source.Get<HelperSetup>();
      threads_ = std::make_unique<TaskThreads>(setup_);
      return;
    }
    const auto kind = source.Get<TaskKind>();
    if (kind != TaskKind::kExtract) {
      extraction_.reset();
    } else if (!extraction_) {
      extraction_ = std::make_shared<Extraction>(setup_.num_on_machine);
    }
    for (const image_t id : source.Get<std::vector<image_t>>()) images_.erase(id);
    for (auto num = source.Get<int64_t>(); num > 0; --num) {
      const auto id = source.Get<image_t>();
      images_[id] = std::make_shared<const PairImage>(source.Get<PairImage>());
    }
    for (auto num = source.Get<int64_t>(); num > 0; --num) threads_->Push(MakeTask(kind, source));
  }

  TaskThreads::Task MakeTask(TaskKind kind, ByteSource& source) const {
    if (kind == TaskKind::kExtract) {
      return [task = source.Get<PhotoTask>(), &options = setup_.features,
              extraction = extraction_](TaskVerifier&) {
        const MemoryGate::Pass pass(extraction->memory, ExtractionBytes(task.camera_size, options));
        return Extract(task, options);
      };
    }
    const PairTask task = GetTask(source);
    if (kind == TaskKind::kVerify) {
      return [task](TaskVerifier& verifier) { return ToBytes(verifier.Run(task)); };
    }
    return [task, &options = setup_.matching](TaskVerifier&) {
      return ToBytes(MatchTask(task, options));
    };
  }

  PairTask GetTask(ByteSource& source) const {
    auto task = source.Get<PairTask>();
    if (source.Get<bool>()) {  // it has images
      const auto [id1, id2] = PairIdToImagePair(task.pair_id);
      task.image1 = images_.at(id1);
      task.image2 = images_.at(id2);
    }
    return task;
  }

  Peers& peers_;
  HelperSetup setup_;
  std::map<image_t, std::shared_ptr<const PairImage>> images_;
  std::shared_ptr<Extraction> extraction_;  // while photographs come
  std::unique_ptr<TaskThreads> threads_;    // last: its tasks use the rest
};

}  // namespace

void HelpToBuild(Peers& peers) { Helper(peers).Run(); }

}  // namespace cairn
