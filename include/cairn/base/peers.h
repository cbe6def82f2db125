#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace cairn {

// The processes of one job on one or several machines, as one of them sees the others. They
// exchange messages of bytes; those from one to another arrive in the order in which they were
// sent. Rank 0 leads: when it leaves the job, each other gets an empty message. Not for several
// threads at once.
class Peers {
 public:
  struct Message {
    int from = 0;  // rank
    std::string bytes;
  };

  virtual ~Peers() = default;

  virtual int rank() const = 0;
  virtual int size() const = 0;
  // Returns at once; the bytes travel when they can.
  virtual void Send(int to, std::string bytes) = 0;
  // Bytes that were given to Send and are not on their way yet.
  virtual int64_t NumUnsentBytes() = 0;
  // The next message that has arrived; nullopt: none has.
  virtual std::optional<Message> Receive() = 0;
  // Waits a moment, for who has nothing to send or to do.
  virtual void Pause() = 0;
};

}  // namespace cairn
