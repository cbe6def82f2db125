#include "base/hash.h"

#include <xxhash.h>

#include <vector>

#include "base/text.h"
#include "cairn/base/file.h"

namespace cairn {

struct Hasher::State {
  XXH3_state_t* xxh = XXH3_createState();
  ~State() { XXH3_freeState(xxh); }
};

Hasher::Hasher() : state_(std::make_unique<State>()) { XXH3_64bits_reset(state_->xxh); }
Hasher::~Hasher() = default;

Hasher& Hasher::AddBytes(const void* data, size_t num_bytes) {
  XXH3_64bits_update(state_->xxh, data, num_bytes);
  return *this;
}

Hasher& Hasher::Add(std::string_view text) {
  return Add(static_cast<uint64_t>(text.size())).AddBytes(text.data(), text.size());
}

uint64_t Hasher::Digest() const { return XXH3_64bits_digest(state_->xxh); }

std::string HashToHex(uint64_t hash) {
  return Formatted("%016llx", static_cast<unsigned long long>(hash));
}

uint64_t HashFile(const std::string& path) {
  InputFile file(path);
  Hasher hasher;
  std::vector<char> buffer(1 << 16);
  while (const size_t count = file.Read(buffer.data(), buffer.size())) {
    hasher.AddBytes(buffer.data(), count);
  }
  return hasher.Digest();
}

}  // namespace cairn
