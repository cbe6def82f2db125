#include "cairn/base/check.h"

namespace cairn::internal {

void ThrowBug(const char* file, int line, const std::string& message) {
  throw BugError(std::string(file) + ":" + std::to_string(line) + ": check failed: " + message);
}

}  // namespace cairn::internal
