#pragma once

#include <functional>
#include <memory>
#include <string>

#include "cairn/database/database.h"

namespace cairn {

// One thread that owns a connection and runs writes from a bounded queue, many in one transaction.
// Any number of threads may Push. Before each commit the queue's order is that of the pushes, so a
// task's rows appear together or not at all.
class DatabaseWriter {
 public:
  struct Options {
    int max_queue_size = 256;              // Push waits while so many tasks are waiting
    int tasks_per_transaction = 1024;      // commit after so many tasks,
    double seconds_per_transaction = 1.0;  // or after so long: what a crash can lose
  };
  explicit DatabaseWriter(const std::string& database_path);
  DatabaseWriter(const std::string& database_path, const Options& options);
  // Drops what is not committed, unless Finish was called.
  ~DatabaseWriter();

  // Throws the exception that ended the writer thread, if one did.
  void Push(std::function<void(Database&)> task);
  // Writes and commits everything, and ends the thread. Throws what a task threw; the transaction
  // in which it happened is rolled back, those before stay.
  void Finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cairn
