#define OMPI_SKIP_MPICXX
#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <climits>
#include <deque>
#include <memory>
#include <thread>

#include "cairn/base/check.h"
#include "cairn/mpi/join_job.h"
#include "mpi/launch.h"

namespace cairn {
namespace {

// Open MPI's own waiting keeps a core busy. A task takes some milliseconds at least.
constexpr auto kPause = std::chrono::microseconds(500);
// Large messages travel in pieces, which move only within calls of MPI.
constexpr auto kPauseWhileSending = std::chrono::microseconds(50);

// Errors of MPI end the job with a message of its own, its default.
class MpiPeers : public Peers {
 public:
  MpiPeers() {
    int level = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &level);
    CAIRN_CHECK(level >= MPI_THREAD_SERIALIZED);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
  }

  // A rank that leaves sends an empty message. Rank 0 receives, and drops, the late results that
  // come before it, so that all can send what is left.
  ~MpiPeers() override {
    if (rank_ > 0) MpiPeers::Send(0, "");
    for (int to = 1; rank_ == 0 && to < size_; ++to) MpiPeers::Send(to, "");
    while (!unsent_.empty() || (rank_ == 0 && num_left_ + 1 < size_)) {
      MpiPeers::Pause();
      while (MpiPeers::Receive()) {
      }
    }
    MPI_Finalize();
  }

  int rank() const override { return rank_; }
  int size() const override { return size_; }

  void Send(int to, std::string bytes) override {
    CAIRN_CHECK_LE(bytes.size(), static_cast<size_t>(INT_MAX));
    unsent_.push_back(std::make_unique<Sending>());
    Sending& sending = *unsent_.back();
    sending.bytes = std::move(bytes);
    MPI_Isend(sending.bytes.data(), static_cast<int>(sending.bytes.size()), MPI_BYTE, to, 0,
              MPI_COMM_WORLD, &sending.request);
  }

  int64_t NumUnsentBytes() override {
    DropSent();
    int64_t sum = 0;
    for (const auto& sending : unsent_) sum += static_cast<int64_t>(sending->bytes.size());
    return sum;
  }

  std::optional<Message> Receive() override {
    int has_arrived = 0, num_bytes = 0;
    MPI_Message handle;
    MPI_Status status;
    MPI_Improbe(MPI_ANY_SOURCE, 0, MPI_COMM_WORLD, &has_arrived, &handle, &status);
    if (!has_arrived) return std::nullopt;
    MPI_Get_count(&status, MPI_BYTE, &num_bytes);
    Message message = {status.MPI_SOURCE, std::string(static_cast<size_t>(num_bytes), '\0')};
    MPI_Mrecv(message.bytes.data(), num_bytes, MPI_BYTE, &handle, MPI_STATUS_IGNORE);
    num_left_ += num_bytes == 0;
    return message;
  }

  void Pause() override {
    DropSent();
    std::this_thread::sleep_for(unsent_.empty() ? kPause : kPauseWhileSending);
  }

 private:
  struct Sending {
    std::string bytes;
    MPI_Request request;
  };

  void DropSent() {
    std::erase_if(unsent_, [](const std::unique_ptr<Sending>& sending) {
      int is_sent = 0;
      MPI_Test(&sending->request, &is_sent, MPI_STATUS_IGNORE);
      return is_sent != 0;
    });
  }

  int rank_ = 0, size_ = 1;
  int num_left_ = 0;  // of the others
  std::deque<std::unique_ptr<Sending>> unsent_;
};

}  // namespace

std::unique_ptr<Peers> JoinJob() {
  if (!IsLaunched()) return nullptr;
  return std::make_unique<MpiPeers>();
}

}  // namespace cairn
