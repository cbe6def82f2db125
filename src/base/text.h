#pragma once

#include <span>
#include <string>

namespace cairn {

// The text that printf would print.
[[gnu::format(printf, 1, 2)]] std::string Formatted(const char* format, ...);

// With A to Z as a to z.
std::string Lowercase(std::string text);

// "a.jpg, b.jpg and 7 more": the first names.
std::string FirstNames(std::span<const std::string> names, size_t max_named = 20);

}  // namespace cairn
