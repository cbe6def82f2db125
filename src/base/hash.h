#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>

namespace cairn {

// 64-bit content hash (XXH3). The value is stable over machines and versions: it is stored in
// databases.
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;

  Hasher& AddBytes(const void* data, size_t num_bytes);
  // Text is hashed with its length, so that ("ab", "c") and ("a", "bc") differ.
  Hasher& Add(std::string_view text);
  template <class T>
  requires std::is_arithmetic_v<T> Hasher& Add(T value) { return AddBytes(&value, sizeof(value)); }

  uint64_t Digest() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Hash of the memory of a vector's or a matrix's values.
template <class Values>
uint64_t HashValues(const Values& values) {
  const auto num_values = static_cast<size_t>(values.size());
  return Hasher().AddBytes(values.data(), num_values * sizeof(*values.data())).Digest();
}

// 16 hexadecimal digits.
std::string HashToHex(uint64_t hash);

// Hash of a file's bytes. Throws IoError.
uint64_t HashFile(const std::string& path);

}  // namespace cairn
