#include "cairn/base/progress.h"

namespace cairn {

ProgressMonitor& NullMonitor() {
  static ProgressMonitor monitor;  // Stateless, so sharing it is harmless.
  return monitor;
}

}  // namespace cairn
