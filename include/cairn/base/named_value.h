#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

namespace cairn {

// A value of an enum and the name that users write for it. A table of them is what
// OptionVisitor::Choice offers, and where reports look names up.
template <class Enum>
struct NamedValue {
  Enum value;
  std::string_view name;
};

// The name of a value in a table; "" if the table does not have it.
template <class Enum, class Table>
constexpr std::string_view NameOf(const Table& table, Enum value) {
  for (const NamedValue<Enum>& entry : table) {
    if (entry.value == value) return entry.name;
  }
  return "";
}

// The value of a name in a table; absent if the table does not have it.
template <class Enum, size_t kSize>
constexpr std::optional<Enum> ValueOf(const NamedValue<Enum> (&table)[kSize],
                                      std::string_view name) {
  for (const NamedValue<Enum>& entry : table) {
    if (entry.name == name) return entry.value;
  }
  return std::nullopt;
}

}  // namespace cairn
