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

// Is this process one of several, and not the first? It has nothing to do in a program that runs on
// one machine.
inline bool IsLaunchedBesideTheFirst() {
  if (!IsLaunched()) return false;
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"}) {
    if (const char* const rank = std::getenv(name)) return std::string_view(rank) != "0";
  }
  return false;
}

}  // namespace cairn
