#include "base/control_groups.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <thread>

#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {
namespace {

// How much time of processors a group has in so much time; infinite: it has no limit.
double ProcessorsOf(const ControlGroup& group) {
  std::string text = ReadIfThere(group.folder / (group.is_v1 ? "cpu.cfs_quota_us" : "cpu.max"));
  if (group.is_v1) text += " " + ReadIfThere(group.folder / "cpu.cfs_period_us");
  std::istringstream numbers(text);  // without a limit, "max" or -1 comes first
  double quota = 0, period = 0;
  const bool is_limited = numbers >> quota >> period && quota > 0 && period > 0;
  return is_limited ? quota / period : HUGE_VAL;
}

}  // namespace

std::string ReadIfThere(const std::string& path) {
  try {
    return ReadFile(path);
  } catch (const IoError&) {
    return "";
  }
}

std::vector<ControlGroup> ControlGroups(const std::string& root, std::string_view controller) {
  std::vector<ControlGroup> groups;
  std::istringstream lines(ReadIfThere(root + "/proc/self/cgroup"));
  for (std::string line; std::getline(lines, line);) {  // number:controllers:group
    const size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const bool is_v1 = controllers.find("," + std::string(controller) + ",") != std::string::npos;
    if (!is_v1 && !line.starts_with("0::")) continue;
    const std::string mount =
        root + "/sys/fs/cgroup" + (is_v1 ? "/" + std::string(controller) : "");
    std::filesystem::path folder = mount + line.substr(second + 1);
    for (; folder.native().size() >= mount.size(); folder = folder.parent_path()) {
      groups.push_back({folder, is_v1});
    }
  }
  return groups;
}

int NumProcessors(const std::string& root) {
  double least = std::max(1u, std::thread::hardware_concurrency());
  for (const ControlGroup& group : ControlGroups(root, "cpu")) {
    least = std::min(least, ProcessorsOf(group));
  }
  return static_cast<int>(std::ceil(least));
}

}  // namespace cairn
