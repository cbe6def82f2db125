#pragma once

#include <cstdlib>
#include <string>

namespace cairn {

// The folder of real data (../shared/data beside the project), which may be moved by the
// environment variable CAIRN_SHARED_DIR. Tests skip where what they need is absent.
inline std::string SharedDataPath(const std::string& name) {
  const char* moved = std::getenv("CAIRN_SHARED_DIR");
  return std::string(moved ? moved : CAIRN_SHARED_DIR) + "/data/" + name;
}

}  // namespace cairn
