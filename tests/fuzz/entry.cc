// One of the targets as libFuzzer calls it; CAIRN_FUZZ_TARGET is its function.
#include <spdlog/spdlog.h>

#include <cstddef>
#include <cstdint>

#include "fuzz/targets.h"

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  spdlog::set_level(spdlog::level::off);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  cairn::fuzz::CAIRN_FUZZ_TARGET({reinterpret_cast<const char*>(data), size});
  return 0;
}
