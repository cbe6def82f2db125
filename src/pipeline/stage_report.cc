#include "pipeline/stage_report.h"

#include <algorithm>

#include "cairn/pipeline/stages.h"

namespace cairn {
namespace {

constexpr const char* kStopped = "stopped; run again to continue";

}  // namespace

void MarkStopped(StageReport& report) {
  report.status = StageStatus::kFailed;
  report.messages.push_back(kStopped);
}

bool StoppedEarly(const StageReport& report) {
  return std::find(report.messages.begin(), report.messages.end(), kStopped) !=
         report.messages.end();
}

}  // namespace cairn
