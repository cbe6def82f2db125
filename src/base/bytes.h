#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "cairn/base/check.h"
#include "cairn/base/options.h"

namespace cairn {

// Values as bytes in memory, for another process of the same program: no format that is kept.
class ByteSink {
 public:
  template <class T>
  requires std::is_trivially_copyable_v<T>
  void Add(const T& value) { bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T)); }
  template <class T>
  requires std::is_trivially_copyable_v<T>
  void AddArray(std::span<const T> values) {
    Add(static_cast<uint64_t>(values.size()));
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  }
  template <class T>
  void AddVector(const std::vector<T>& values) {
    AddArray(std::span<const T>(values));
  }
  void AddText(std::string_view text) { AddArray(std::span<const char>(text)); }

  void Append(std::string_view bytes) { bytes_.append(bytes); }

  size_t size() const { return bytes_.size(); }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

// Reads what a ByteSink wrote, in the same order. BugError where it is too short.
class ByteSource {
 public:
  explicit ByteSource(std::string_view bytes) : rest_(bytes) {}

  template <class T>
  requires std::is_trivially_copyable_v<T> T Get() {
    T value;
    std::memcpy(&value, Skip(sizeof(T)), sizeof(T));
    return value;
  }
  template <class T>
  requires std::is_trivially_copyable_v<T> std::vector<T> GetVector() {
    const auto size = Get<uint64_t>();
    CAIRN_CHECK(size <= rest_.size() / sizeof(T));
    std::vector<T> values(size);
    if (size > 0) std::memcpy(values.data(), Skip(size * sizeof(T)), size * sizeof(T));
    return values;
  }
  // Valid as long as the bytes.
  std::string_view GetText() {
    const auto size = Get<uint64_t>();
    return {Skip(size), size};
  }
  bool IsAtEnd() const { return rest_.empty(); }

 private:
  const char* Skip(uint64_t num_bytes) {
    CAIRN_CHECK(num_bytes <= rest_.size());
    const char* begin = rest_.data();
    rest_.remove_prefix(num_bytes);
    return begin;
  }

  std::string_view rest_;
};

// The fields of an options struct as bytes, and back.
class OptionSaver : public OptionVisitor {
 public:
  explicit OptionSaver(ByteSink& sink) : sink_(sink) {}
  void Bool(std::string_view, bool& value, std::string_view) override { sink_.Add(value); }
  void Int(std::string_view, int& value, OptionRange, std::string_view) override {
    sink_.Add(value);
  }
  void Double(std::string_view, double& value, OptionRange, std::string_view) override {
    sink_.Add(value);
  }
  void String(std::string_view, std::string& value, std::string_view) override {
    sink_.AddText(value);
  }
  void Doubles(std::string_view, std::vector<double>& value, std::string_view) override {
    sink_.AddVector(value);
  }

 private:
  void Choice(std::string_view, const ChoiceField& field, std::string_view) override {
    sink_.AddText(field.get());
  }

  ByteSink& sink_;
};

class OptionLoader : public OptionVisitor {
 public:
  explicit OptionLoader(ByteSource& source) : source_(source) {}
  void Bool(std::string_view, bool& value, std::string_view) override {
    value = source_.Get<bool>();
  }
  void Int(std::string_view, int& value, OptionRange, std::string_view) override {
    value = source_.Get<int>();
  }
  void Double(std::string_view, double& value, OptionRange, std::string_view) override {
    value = source_.Get<double>();
  }
  void String(std::string_view, std::string& value, std::string_view) override {
    value = source_.GetText();
  }
  void Doubles(std::string_view, std::vector<double>& value, std::string_view) override {
    value = source_.GetVector<double>();
  }

 private:
  void Choice(std::string_view, const ChoiceField& field, std::string_view) override {
    field.set(std::string(source_.GetText()));
  }

  ByteSource& source_;
};

}  // namespace cairn
