// The program that users call. The image codecs behind most commands (OpenCV's, with GDAL) load 140
// shared libraries in 0.08 s, as long as averaging the 20,297 rotations of Ellis Island takes: a
// command that needs none of them runs here, every other one in the full program (main.cc), which
// takes this process over. `ldd build/bin/global_sfm`; `time build/libexec/cairn/global_sfm --help`
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "global_sfm/commands.h"

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "rotation_averaging") {
    cairn::Program program("global_sfm", "Global structure-from-motion.");
    cairn::AddRotationAveragingCommand(program);
    return program.Run(argc, argv);
  }
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path full = self.parent_path().parent_path() / CAIRN_FULL_PROGRAM;
  execv(full.c_str(), argv);
  std::fprintf(stderr, "%s: %s\n", full.c_str(), std::strerror(errno));
  return cairn::kExitIo;
}
