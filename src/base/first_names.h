#pragma once

#include <algorithm>
#include <span>
#include <string>

namespace cairn {

// "a.jpg, b.jpg and 7 more": the first twenty names.
inline std::string FirstNames(std::span<const std::string> names) {
  const size_t num_named = std::min<size_t>(20, names.size());
  std::string text;
  for (size_t i = 0; i < num_named; ++i) text += (i > 0 ? ", " : "") + names[i];
  if (names.size() > num_named)
    text += " and " + std::to_string(names.size() - num_named) + " more";
  return text;
}

}  // namespace cairn
