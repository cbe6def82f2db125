#pragma once

#include <cstdint>
#include <string>

namespace cairn {

// How library code reports to the program that calls it; the library itself never prints. Every
// method may be called from any thread. The default implementations do nothing, so a null-object is
// `ProgressMonitor()`.
class ProgressMonitor {
 public:
  virtual ~ProgressMonitor() = default;

  // A stage of `total` work items begins (0: unknown); done items are added; the stage ends.
  virtual void BeginStage(const std::string& /*name*/, int64_t /*total*/) {}
  virtual void Advance(int64_t /*num_done*/) {}
  virtual void EndStage() {}

  // One line for the user: something was done / something was skipped, with the file or pair and
  // the reason.
  virtual void Info(const std::string& /*message*/) {}
  virtual void Warning(const std::string& /*message*/) {}

  // True once the user asked to stop (Ctrl-C). Long stages check this between items, keep what is
  // done, and return early.
  virtual bool StopRequested() const { return false; }
};

// A monitor that does nothing.
inline ProgressMonitor& NullMonitor() {
  static ProgressMonitor monitor;  // Stateless, so sharing it is harmless.
  return monitor;
}

}  // namespace cairn
