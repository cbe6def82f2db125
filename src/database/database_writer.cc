#include "database/database_writer.h"

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>

#include "cairn/base/timer.h"

namespace cairn {

struct DatabaseWriter::Impl {
  using Task = std::function<void(Database&)>;

  Impl(const std::string& path, const Options& options)
      : options(options), database(path, Database::Mode::kOpenExisting) {}

  Options options;
  Database database;
  std::mutex mutex;
  std::condition_variable task_arrived;
  std::condition_variable task_taken;
  std::deque<Task> queue;
  bool finish = false;   // No more tasks will come.
  bool abandon = false;  // Stop without committing.
  std::exception_ptr error;
  double busy_seconds = 0;
  std::thread thread;

  // The next task; an empty one when none will come, or none has come by `deadline`.
  Task Next(std::chrono::steady_clock::time_point deadline) {
    std::unique_lock<std::mutex> lock(mutex);
    task_arrived.wait_until(lock, deadline, [this] { return !queue.empty() || finish || abandon; });
    if (queue.empty() || abandon) return {};
    Task task = std::move(queue.front());
    queue.pop_front();
    lock.unlock();
    task_taken.notify_one();
    return task;
  }

  bool IsDone() {
    const std::lock_guard<std::mutex> lock(mutex);
    return abandon || (finish && queue.empty());
  }

  // Runs tasks until it is time to commit. The transaction opens with the first task, so that an
  // idle writer locks nothing.
  void RunTransaction() {
    Task task = Next(std::chrono::steady_clock::time_point::max());
    if (!task) return;
    const Timer since_begin;
    const auto deadline = std::chrono::steady_clock::now() +
                          std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                              std::chrono::duration<double>(options.seconds_per_transaction));
    Database::Transaction transaction(database);
    for (int i = 0; task; ++i) {
      const Timer timer;
      task(database);
      busy_seconds += timer.Seconds();
      if (i + 1 >= options.tasks_per_transaction ||
          since_begin.Seconds() >= options.seconds_per_transaction) {
        break;
      }
      task = Next(deadline);
    }
    {
      const std::lock_guard<std::mutex> lock(mutex);
      if (abandon) return;  // The destructor rolls back.
    }
    const Timer timer;
    transaction.Commit();
    busy_seconds += timer.Seconds();
  }

  void Run() {
    try {
      while (!IsDone()) RunTransaction();
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      error = std::current_exception();
      abandon = true;
    }
    task_taken.notify_all();
  }

  void Join() {
    task_arrived.notify_all();
    if (thread.joinable()) thread.join();
  }
};

DatabaseWriter::DatabaseWriter(const std::string& database_path)
    : DatabaseWriter(database_path, Options()) {}

DatabaseWriter::DatabaseWriter(const std::string& database_path, const Options& options)
    : impl_(std::make_unique<Impl>(database_path, options)) {
  impl_->thread = std::thread([impl = impl_.get()] { impl->Run(); });
}

DatabaseWriter::~DatabaseWriter() {
  {
    const std::lock_guard<std::mutex> lock(impl_->mutex);
    if (!impl_->finish) impl_->abandon = true;
  }
  impl_->Join();
}

void DatabaseWriter::Push(std::function<void(Database&)> task) {
  std::unique_lock<std::mutex> lock(impl_->mutex);
  impl_->task_taken.wait(lock, [this] {
    return impl_->error || impl_->queue.size() < static_cast<size_t>(impl_->options.max_queue_size);
  });
  if (impl_->error) std::rethrow_exception(impl_->error);
  impl_->queue.push_back(std::move(task));
  lock.unlock();
  impl_->task_arrived.notify_one();
}

void DatabaseWriter::Finish() {
  {
    const std::lock_guard<std::mutex> lock(impl_->mutex);
    impl_->finish = true;
  }
  impl_->Join();
  if (impl_->error) std::rethrow_exception(impl_->error);
}

double DatabaseWriter::busy_seconds() const { return impl_->busy_seconds; }

}  // namespace cairn
