#include "support/run_program.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "support/temp_folder.h"

namespace cairn {
namespace {

// In the child: both streams go to `log`, then the program replaces this one.
[[noreturn]] void Execute(const std::string& executable, const std::vector<std::string>& arguments,
                          const std::string& log) {
  const int file = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  dup2(file, STDOUT_FILENO);
  dup2(file, STDERR_FILENO);
  std::vector<char*> argv = {const_cast<char*>(executable.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  execvp(executable.c_str(), argv.data());
  _exit(127);
}

}  // namespace

ProgramResult RunExecutable(const std::string& executable,
                            const std::vector<std::string>& arguments, double kill_after_seconds) {
  const TempFolder folder;
  const std::string log = folder / "output";
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("fork");
  if (child == 0) Execute(executable, arguments, log);

  int status = 0;
  const auto start = std::chrono::steady_clock::now();
  while (kill_after_seconds > 0 && waitpid(child, &status, WNOHANG) == 0) {
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    if (elapsed.count() > kill_after_seconds) {
      kill(child, SIGKILL);
      break;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  waitpid(child, &status, 0);  // fails where the loop has reaped the child; status is set then

  ProgramResult result;
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  std::ifstream file(log);
  std::ostringstream text;
  text << file.rdbuf();
  result.output = text.str();
  return result;
}

ProgramResult RunProgram(const std::string& name, const std::vector<std::string>& arguments,
                         double kill_after_seconds) {
  return RunExecutable(CAIRN_BINARY_DIR "/bin/" + name, arguments, kill_after_seconds);
}

}  // namespace cairn
