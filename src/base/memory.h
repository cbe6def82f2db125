#pragma once

#include <cstdint>
#include <string>

namespace cairn {

// Memory of this process and of the machine, bytes; -1 where unknown.
struct MemoryUse {
  int64_t resident = -1;
  int64_t peak = -1;  // largest resident size until now
  // What this process can still allocate: on the machine, and within the limits of its control
  // groups.
  int64_t available = -1;
};
// From the files of the kernel below `root`.
MemoryUse ReadMemoryUse(const std::string& root = "");

// Throws std::bad_alloc where so many bytes are not to be had. OpenBLAS takes 128 MiB for a thread
// where it is first used, and where they are missing it asks for them for ever: so ask before.
void RequireMemory(int64_t bytes);

constexpr int64_t GibToBytes(double gib) { return static_cast<int64_t>(gib * (1 << 30)); }
constexpr double BytesToGib(int64_t bytes) { return static_cast<double>(bytes) / (1 << 30); }

}  // namespace cairn
