#pragma once

#include <cstdlib>
#include <string_view>

namespace cairn {

// Was this process started as one of several by mpirun, or by srun with PMIx or PMI?
inline bool IsLaunched() {
  const char* const size = std::getenv("OMPI_COMM_WORLD_SIZE");
  if (size != nullptr) return std::string_view(size) != "1";
  return std::getenv("PMIX_RANK") != nullptr || std::getenv("PMI_RANK") != nullptr;
}

// Of this process, if it IsLaunched.
inline int LaunchedRank() {
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"}) {
    if (const char* const rank = std::getenv(name)) return std::atoi(rank);
  }
  return 0;
}

}  // namespace cairn
