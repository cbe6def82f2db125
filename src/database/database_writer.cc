#include "database/database_writer.h"

#include <chrono>

namespace cairn {

DatabaseWriter::DatabaseWriter(const std::string& database_path,
                               const DatabaseWriterOptions& options)
    : options_(options),
      database_(database_path, Database::Mode::kOpenExisting),
      queue_(static_cast<size_t>(options.max_queue_size)),
      thread_([this] { Run(); }) {}

void DatabaseWriter::Finish() {
  queue_.Finish();
  if (thread_.joinable()) thread_.join();
  if (error_) std::rethrow_exception(error_);
}

void DatabaseWriter::Run() {
  try {
    while (std::optional<Task> task = queue_.Next()) RunTransaction(std::move(task));
  } catch (...) {
    error_ = std::current_exception();
    queue_.Stop(error_);
  }
}

// Runs this task and those that come until it is time to commit. The transaction opens with the
// first task, so that an idle writer locks nothing.
void DatabaseWriter::RunTransaction(std::optional<Task> task) {
  using Clock = std::chrono::steady_clock;
  const auto deadline =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(
                         std::chrono::duration<double>(options_.seconds_per_transaction));
  Database::Transaction transaction(database_);
  for (int num_done = 0; task;) {
    (*task)(database_);
    const bool is_last = ++num_done >= options_.tasks_per_transaction || Clock::now() >= deadline;
    task = is_last ? std::nullopt : queue_.Next(deadline);
  }
  if (queue_.IsStopped()) return;  // The destructor rolls back.
  transaction.Commit();
}

}  // namespace cairn
