#include "cairn/depth/options.h"

#include "cairn/base/error.h"

namespace cairn {

std::vector<DepthWindows> DepthOptions::Scales() const {
  if (value_window.empty()) throw ConfigError("depth.value_window", "needs a value");
  if (gradient_window.size() != value_window.size()) {
    throw ConfigError("depth.gradient_window", "needs as many values as depth.value_window, " +
                                                   std::to_string(value_window.size()));
  }
  std::vector<DepthWindows> scales;
  for (size_t i = 0; i < value_window.size(); ++i) {
    for (const auto& [key, window] : {std::pair("depth.value_window", value_window[i]),
                                      std::pair("depth.gradient_window", gradient_window[i])}) {
      if (!(window >= 0.0 && window <= 1.0)) throw ConfigError(key, "must be between 0 and 1");
    }
    scales.push_back({value_window[i], gradient_window[i]});
  }
  return scales;
}

}  // namespace cairn
