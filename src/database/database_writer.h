#pragma once

#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "base/work_queue.h"
#include "cairn/database/database.h"

namespace cairn {

struct DatabaseWriterOptions {
  int max_queue_size = 256;              // Push waits while so many tasks are waiting
  int tasks_per_transaction = 1024;      // commit after so many tasks,
  double seconds_per_transaction = 1.0;  // or after so long: what a crash can lose
};

// One thread that owns a connection and runs writes from a bounded queue, many in one transaction.
// Any number of threads may Push. Before each commit the queue's order is that of the pushes, so a
// task's rows appear together or not at all.
class DatabaseWriter {
 public:
  using Task = std::function<void(Database&)>;

  explicit DatabaseWriter(const std::string& database_path,
                          const DatabaseWriterOptions& options = {});
  // Drops what is not committed, unless Finish was called.
  ~DatabaseWriter() { queue_.Stop(); }

  // Throws the exception that ended the writer thread, if one did.
  void Push(Task task) { queue_.Push(std::move(task)); }
  // Writes and commits everything, and ends the thread. Throws what a task threw; the transaction
  // in which it happened is rolled back, those before stay.
  void Finish();

 private:
  void Run();
  void RunTransaction(std::optional<Task> task);

  const DatabaseWriterOptions options_;
  Database database_;
  WorkQueue<Task> queue_;
  std::exception_ptr error_;
  std::jthread thread_;  // last: it uses the rest
};

}  // namespace cairn
