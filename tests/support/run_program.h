#pragma once

#include <string>
#include <vector>

namespace cairn {

struct ProgramResult {
  int exit_code = -1;  // 128 + signal, if a signal ended the program
  std::string output;  // both streams
};

// Runs build/bin/<name> with the arguments and waits for it. kill_after_seconds > 0: it is killed
// (SIGKILL) when it still runs after that time.
ProgramResult RunProgram(const std::string& name, const std::vector<std::string>& arguments,
                         double kill_after_seconds = 0);

// The same for any executable, looked up in PATH.
ProgramResult RunExecutable(const std::string& executable,
                            const std::vector<std::string>& arguments,
                            double kill_after_seconds = 0);

}  // namespace cairn
