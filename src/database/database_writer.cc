#include "database/database_writer.h"

#include <exception>
#include <thread>

#include "base/work_queue.h"

namespace cairn {

struct DatabaseWriter::Impl {
  using Task = std::function<void(Database&)>;
  using Clock = std::chrono::steady_clock;

  Impl(const std::string& path, const Options& options)
      : options(options),
        database(path, Database::Mode::kOpenExisting),
        queue(static_cast<size_t>(options.max_queue_size)),
        thread([this] { Run(); }) {}

  // Runs this task and those that come until it is time to commit. The transaction opens with the
  // first task, so that an idle writer locks nothing.
  void RunTransaction(std::optional<Task> task) {
    const auto deadline =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(
                           std::chrono::duration<double>(options.seconds_per_transaction));
    Database::Transaction transaction(database);
    for (int num_done = 0; task;) {
      (*task)(database);
      const bool is_last = ++num_done >= options.tasks_per_transaction || Clock::now() >= deadline;
      task = is_last ? std::nullopt : queue.Next(deadline);
    }
    if (queue.IsStopped()) return;  // The destructor rolls back.
    transaction.Commit();
  }

  void Run() {
    try {
      while (std::optional<Task> task = queue.Next()) RunTransaction(std::move(task));
    } catch (...) {
      error = std::current_exception();
      queue.Stop(error);
    }
  }

  void Join() {
    if (thread.joinable()) thread.join();
  }

  const Options options;
  Database database;
  WorkQueue<Task> queue;
  std::exception_ptr error;
  std::thread thread;
};

DatabaseWriter::DatabaseWriter(const std::string& database_path)
    : DatabaseWriter(database_path, Options()) {}

DatabaseWriter::DatabaseWriter(const std::string& database_path, const Options& options)
    : impl_(std::make_unique<Impl>(database_path, options)) {}

DatabaseWriter::~DatabaseWriter() {
  impl_->queue.Stop();
  impl_->Join();
}

void DatabaseWriter::Push(std::function<void(Database&)> task) {
  impl_->queue.Push(std::move(task));
}

void DatabaseWriter::Finish() {
  impl_->queue.Finish();
  impl_->Join();
  if (impl_->error) std::rethrow_exception(impl_->error);
}

}  // namespace cairn
