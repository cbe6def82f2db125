#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "cairn/base/check.h"

namespace cairn {

// T or const T. `void VisitBytes(auto& bytes, Is<T> auto& value)` gives the parts of a value, where
// it is more than plain memory, a text, a vector or an optional value, to `bytes`, a ByteSink or a
// ByteSource. So one list of fields writes and reads.
template <class Value, class T>
concept Is = std::is_same_v<std::remove_const_t<Value>, T>;

// Values as bytes in memory, for another process of the same program: no format that is kept.
class ByteSink {
 public:
  template <class... T>
  void operator()(const T&... values) {
    (Add(values), ...);
  }
  void AddText(std::string_view text) {
    Add(uint64_t{text.size()});
    Append(text);
  }
  void Append(std::string_view bytes) { bytes_.append(bytes); }

  size_t size() const { return bytes_.size(); }
  std::string Take() { return std::move(bytes_); }

 private:
  template <class T>
  void AddMemory(const T* values, size_t num) {
    Append({reinterpret_cast<const char*>(values), num * sizeof(T)});
  }
  template <class T>
  void Add(const T& value) {
    if constexpr (std::is_trivially_copyable_v<T>) {
      AddMemory(&value, 1);
    } else {
      VisitBytes(*this, value);
    }
  }
  void Add(const std::string& text) { AddText(text); }
  template <class T>
  void Add(const std::vector<T>& values) {
    Add(uint64_t{values.size()});
    if constexpr (std::is_trivially_copyable_v<T>) {
      AddMemory(values.data(), values.size());
    } else {
      for (const T& value : values) Add(value);
    }
  }
  template <class T>
  void Add(const std::optional<T>& value) {
    Add(value.has_value());
    if (value) Add(*value);
  }

  std::string bytes_;
};

// Reads what a ByteSink wrote, in the same order. BugError where it is too short.
class ByteSource {
 public:
  explicit ByteSource(std::string_view bytes) : rest_(bytes) {}

  template <class... T>
  void operator()(T&... values) {
    (Read(values), ...);
  }
  template <class T>
  T Get() {
    T value{};
    Read(value);
    return value;
  }
  // Valid as long as the bytes.
  std::string_view GetText() { return Skip(Get<uint64_t>()); }
  bool IsAtEnd() const { return rest_.empty(); }

 private:
  std::string_view Skip(uint64_t num_bytes) {
    CAIRN_CHECK(num_bytes <= rest_.size());
    const std::string_view skipped = rest_.substr(0, num_bytes);
    rest_.remove_prefix(num_bytes);
    return skipped;
  }
  template <class T>
  void ReadMemory(T* values, size_t num) {
    CAIRN_CHECK(num <= rest_.size() / sizeof(T));
    if (num > 0) std::memcpy(values, Skip(num * sizeof(T)).data(), num * sizeof(T));
  }
  template <class T>
  void Read(T& value) {
    if constexpr (std::is_trivially_copyable_v<T>) {
      ReadMemory(&value, 1);
    } else {
      VisitBytes(*this, value);
    }
  }
  void Read(std::string& text) { text = GetText(); }
  template <class T>
  void Read(std::vector<T>& values) {
    const auto num = Get<uint64_t>();
    CAIRN_CHECK(num <= rest_.size());
    values.resize(num);
    if constexpr (std::is_trivially_copyable_v<T>) {
      ReadMemory(values.data(), num);
    } else {
      for (T& value : values) Read(value);
    }
  }
  template <class T>
  void Read(std::optional<T>& value) {
    value.reset();
    if (Get<bool>()) Read(value.emplace());
  }

  std::string_view rest_;
};

}  // namespace cairn
