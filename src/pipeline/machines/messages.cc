#include "pipeline/machines/messages.h"

#include <unistd.h>

#include "base/control_groups.h"
#include "base/hash.h"

namespace cairn {

HelperHello HelperHello::OfThisProcess() {
  char host[256] = "";
  gethostname(host, sizeof(host) - 1);
  return {HashFile("/proc/self/exe"), NumProcessors(), host};
}

void VisitBytes(ByteSink& bytes, const Descriptors& descriptors) {
  bytes(descriptors.cols());
  bytes.AddText(
      {reinterpret_cast<const char*>(descriptors.data()), static_cast<size_t>(descriptors.size())});
}

void VisitBytes(ByteSource& bytes, Descriptors& descriptors) {
  const auto num_columns = bytes.Get<Eigen::Index>();
  const std::string_view values = bytes.GetText();
  const Eigen::Index num_rows = num_columns > 0 ? std::ssize(values) / num_columns : 0;
  descriptors = Eigen::Map<const Descriptors>(reinterpret_cast<const uint8_t*>(values.data()),
                                              num_rows, num_columns);
}

}  // namespace cairn
