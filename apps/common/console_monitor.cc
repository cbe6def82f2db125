#include "common/console_monitor.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/time.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>

#include "common/program.h"

namespace cairn {
namespace {

// Written by the signal handler, so it has to be reachable from a plain function.
volatile std::sig_atomic_t stop_requested = 0;

// A stage that takes longer to stop is ended: what is in the database is complete at any time, and
// results are written as a whole or not at all.
constexpr suseconds_t kMaxMicrosecondsToStop = 900'000;

// Of a stage that ends. (The report has the times of all.)
constexpr double kSecondsWorthALine = 1;

void HandleStop(int signal) {
  if (stop_requested) _exit(128 + signal);
  stop_requested = 1;
  itimerval timer = {};
  timer.it_value.tv_usec = kMaxMicrosecondsToStop;
  setitimer(ITIMER_REAL, &timer, nullptr);
}

void HandleTimeIsUp(int) {
  constexpr char kMessage[] = "error: stopped by the user; run it again\n";
  [[maybe_unused]] const ssize_t ignored = write(STDERR_FILENO, kMessage, sizeof(kMessage) - 1);
  _exit(kExitNoUsableResult);
}

}  // namespace

std::string FormatDuration(double seconds) {
  if (seconds < 100) return fmt::format("{:.0f} s", seconds);
  if (seconds < 100 * 60) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

ConsoleMonitor::ConsoleMonitor() : is_terminal_(isatty(STDERR_FILENO) != 0) {
  std::signal(SIGINT, HandleStop);
  std::signal(SIGTERM, HandleStop);
  std::signal(SIGALRM, HandleTimeIsUp);
}

ConsoleMonitor::~ConsoleMonitor() {
  ClearLine();
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);  // a timer that runs goes on: what follows is to end in time, too
}

void ConsoleMonitor::ClearLine() {
  if (line_is_open_) std::fputs("\r\033[K", stderr);
  line_is_open_ = false;
}

void ConsoleMonitor::ShowProgress(Clock::time_point now) {
  const double seconds = std::chrono::duration<double>(now - stage_start_).count();
  std::string text = stage_;
  if (total_ > 0) {
    text += fmt::format(": {}/{} ({:.0f} %)", done_, total_, 100.0 * done_ / total_);
    if (done_ > 0 && done_ < total_) {
      text += ", " + FormatDuration(seconds * (total_ - done_) / done_) + " left";
    }
  } else {
    text += fmt::format(": {}", done_);
  }
  if (is_terminal_) {
    std::fprintf(stderr, "\r\033[K%s", text.c_str());
    line_is_open_ = true;
  } else {
    spdlog::info("{}", text);
  }
  last_shown_ = now;
}

void ConsoleMonitor::BeginStage(const std::string& name, int64_t total) {
  const std::lock_guard<std::mutex> lock(mutex_);
  stage_ = name;
  total_ = total;
  done_ = 0;
  stage_start_ = last_shown_ = Clock::now();
  if (is_terminal_) ShowProgress(stage_start_);
}

void ConsoleMonitor::Advance(int64_t num_done) {
  const std::lock_guard<std::mutex> lock(mutex_);
  done_ += num_done;
  const auto now = Clock::now();
  const auto interval = is_terminal_ ? std::chrono::milliseconds(200) : std::chrono::seconds(10);
  if (now - last_shown_ >= interval) ShowProgress(now);
}

void ConsoleMonitor::EndStage() {
  const std::lock_guard<std::mutex> lock(mutex_);
  ClearLine();
  const double seconds = std::chrono::duration<double>(Clock::now() - stage_start_).count();
  if (seconds >= kSecondsWorthALine) spdlog::info("{}: done in {:.1f} s", stage_, seconds);
}

void ConsoleMonitor::Info(const std::string& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ClearLine();
  spdlog::info("{}", message);
}

void ConsoleMonitor::Warning(const std::string& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ClearLine();
  spdlog::warn("{}", message);
}

bool ConsoleMonitor::StopRequested() const { return stop_requested != 0; }

}  // namespace cairn
