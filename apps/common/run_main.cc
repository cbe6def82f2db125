#include <malloc.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <iostream>
#include <new>
#include <string_view>
#include <system_error>

#include "base/sanitized.h"
#include "cairn/base/error.h"
#include "common/program.h"

namespace cairn {
namespace {

int Say(std::string_view message, int exit_code) {
  spdlog::error("{}", message);
  return exit_code;
}

bool IsShortage(const std::error_code& code) {
  return code == std::errc::resource_unavailable_try_again || code == std::errc::not_enough_memory;
}

// For the exception that is being handled: one line, and its exit code.
int ReportException() noexcept {
  try {
    throw;
  } catch (const ConfigError& error) {
    return Say(error.what(), kExitUsage);
  } catch (const IoError& error) {
    return Say(error.what(), kExitIo);
  } catch (const std::bad_alloc&) {
    return Say("out of memory", kExitIo);
  } catch (const std::filesystem::filesystem_error& error) {
    return Say(error.path1().string() + ": " + error.code().message(), kExitIo);
  } catch (const std::system_error& error) {
    if (IsShortage(error.code())) return Say("out of memory, or of threads", kExitIo);
    return Say(std::string("internal error: ") + error.what(), kExitBug);
  } catch (const std::exception& error) {
    return Say(std::string("internal error: ") + error.what(), kExitBug);
  } catch (...) {
    return Say("internal error: an exception of unknown type", kExitBug);
  }
}

// An exception that leaves a thread, or a destructor, of a library. GCC 12 does not tell which left
// a destructor; they throw for want of memory alone.
[[noreturn]] void HandleTerminate() {
  if (std::current_exception()) _exit(ReportException());
  if (std::uncaught_exceptions() > 0) _exit(Say("out of memory, or of threads", kExitIo));
  _exit(Say("internal error", kExitBug));
}

bool main_has_returned = false;

// Without the exit handlers of libraries, of which OpenBLAS's waits for ever for threads that could
// not be made. A library that ends the program before main does (OpenMP) is short of memory.
[[maybe_unused]] void EndProcess(int exit_code, void*) {
  std::fflush(nullptr);
  _exit(main_has_returned ? exit_code : kExitIo);
}

// Before main, where nothing of ours is ready.
[[noreturn, maybe_unused]] void EndBeforeMain() {
  constexpr char kMessage[] = "error: out of memory, or of threads\n";
  [[maybe_unused]] const ssize_t ignored = write(STDERR_FILENO, kMessage, sizeof(kMessage) - 1);
  _exit(kExitIo);
}

// Where OpenBLAS cannot make its threads, it says so and raises SIGINT.
[[maybe_unused]] void HandleOwnSignal(int signal, siginfo_t* info, void*) {
  if (info->si_code == SI_TKILL && info->si_pid == getpid()) EndBeforeMain();
  std::signal(signal, SIG_DFL);
  raise(signal);
}

#if !CAIRN_SANITIZED

// The constructors of libraries fail for want of memory alone.
void CatchEarlyFailures(int, char**, char**) {
  std::set_terminate(EndBeforeMain);
  struct sigaction action, before;
  std::memset(&action, 0, sizeof(action));
  action.sa_sigaction = HandleOwnSignal;
  action.sa_flags = SA_SIGINFO;
  if (sigaction(SIGINT, nullptr, &before) == 0 && before.sa_handler == SIG_DFL) {
    sigaction(SIGINT, &action, nullptr);
  }
}

// Runs before the constructors of shared libraries.
[[gnu::section(".preinit_array"),
  gnu::used]] void (*const catch_early_failures)(int, char**, char**) = CatchEarlyFailures;

#endif

// Blocks of memory that are freed are mostly asked for again at once. By default, the larger ones
// go back to the system, which clears and maps each of their pages anew.
void KeepFreedMemory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the most that glibc allows
  mallopt(M_TRIM_THRESHOLD, 128 << 20);
}

}  // namespace

int RunMain(const std::function<int()>& body) {
#if !CAIRN_SANITIZED  // sanitizers report at exit
  on_exit(EndProcess, nullptr);
#endif
  std::set_terminate(HandleTerminate);
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error of writing (EFBIG)
  std::cerr.rdbuf(nullptr);       // OpenCV writes there what it returns or throws, too
  KeepFreedMemory();
  int exit_code = kExitSuccess;
  try {
    exit_code = body();
  } catch (...) {
    exit_code = ReportException();
  }
  if (std::fflush(stdout) != 0 && exit_code == kExitSuccess) {
    exit_code = Say(std::string("standard output: ") + std::strerror(errno), kExitIo);
  }
  main_has_returned = true;
  return exit_code;
}

}  // namespace cairn
