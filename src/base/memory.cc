#include "base/memory.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <new>

#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {
namespace {

// "" if there is no such file.
std::string ReadIfThere(const std::string& path) {
  try {
    return ReadFile(path);
  } catch (const IoError&) {
    return "";
  }
}

// The number after `key`, times `unit`; -1: there is none.
int64_t NumberAfter(const std::string& text, const std::string& key, int64_t unit) {
  const size_t at = text.find(key);
  if (at == std::string::npos) return -1;
  char* end = nullptr;
  const char* begin = text.c_str() + at + key.size();
  const int64_t number = std::strtoll(begin, &end, 10);
  return end == begin ? -1 : number * unit;
}

}  // namespace

MemoryUse ReadMemoryUse() {
  MemoryUse use;
  const std::string status = ReadIfThere("/proc/self/status");
  use.resident = NumberAfter(status, "VmRSS:", 1024);
  use.peak = NumberAfter(status, "VmHWM:", 1024);
  use.available = NumberAfter(ReadIfThere("/proc/meminfo"), "MemAvailable:", 1024);
  // Control groups, version 2 ("max": no limit) and 1.
  for (const auto& [limit_path, used_path] :
       {std::pair("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
        std::pair("/sys/fs/cgroup/memory/memory.limit_in_bytes",
                  "/sys/fs/cgroup/memory/memory.usage_in_bytes")}) {
    const int64_t limit = NumberAfter(ReadIfThere(limit_path), "", 1);
    const int64_t used = NumberAfter(ReadIfThere(used_path), "", 1);
    if (limit < 0 || used < 0) continue;
    const int64_t left = std::max<int64_t>(0, limit - used);
    use.available = use.available < 0 ? left : std::min(use.available, left);
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
