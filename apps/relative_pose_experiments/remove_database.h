#pragma once

#include <filesystem>
#include <string>

namespace cairn::experiments {

// A database of an earlier run, and what SQLite may have left beside it.
inline void RemoveDatabase(const std::string& path) {
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path + suffix);
}

}  // namespace cairn::experiments
