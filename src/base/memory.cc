#include "base/memory.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <new>

#include "base/control_groups.h"

namespace cairn {
namespace {

// The number after `key`, times `unit`; -1: there is none.
int64_t NumberAfter(const std::string& text, const std::string& key, int64_t unit) {
  const size_t at = text.find(key);
  if (at == std::string::npos) return -1;
  char* end = nullptr;
  const char* begin = text.c_str() + at + key.size();
  const int64_t number = std::strtoll(begin, &end, 10);
  return end == begin ? -1 : number * unit;
}

// What a control group leaves this process; -1: it has no limit.
int64_t LeftByGroup(const ControlGroup& group) {
  const auto& [folder, is_v1] = group;
  const auto number_in = [&folder = folder](const char* file) {
    return NumberAfter(ReadIfThere(folder / file), "", 1);
  };
  const int64_t limit = number_in(is_v1 ? "memory.limit_in_bytes" : "memory.max");
  const int64_t used = number_in(is_v1 ? "memory.usage_in_bytes" : "memory.current");
  if (limit < 0 || used < 0) return -1;
  // Pages of files are given up when memory is asked for.
  const std::string stat = "\n" + ReadIfThere(folder / "memory.stat");
  int64_t of_files = 0;
  for (const char* key : {"inactive_file ", "active_file "}) {
    const std::string line_begin = is_v1 ? "\ntotal_" : "\n";
    of_files += std::max<int64_t>(0, NumberAfter(stat, line_begin + key, 1));
  }
  return std::max<int64_t>(0, limit - std::max<int64_t>(0, used - of_files));
}

// The lesser of two amounts; -1: without limit.
int64_t Lesser(int64_t a, int64_t b) { return a < 0 ? b : b < 0 ? a : std::min(a, b); }

}  // namespace

MemoryUse ReadMemoryUse(const std::string& root) {
  MemoryUse use;
  const std::string status = ReadIfThere(root + "/proc/self/status");
  use.resident = NumberAfter(status, "VmRSS:", 1024);
  use.peak = NumberAfter(status, "VmHWM:", 1024);
  use.available = NumberAfter(ReadIfThere(root + "/proc/meminfo"), "MemAvailable:", 1024);
  for (const ControlGroup& group : ControlGroups(root, "memory")) {
    use.available = Lesser(use.available, LeftByGroup(group));
  }
  return use;
}

void RequireMemory(int64_t bytes) {
  void* room = mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                    MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (room == MAP_FAILED) throw std::bad_alloc();
  munmap(room, bytes);
}

}  // namespace cairn
