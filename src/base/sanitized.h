#pragma once

// CAIRN_SANITIZED: 1 where this is compiled with the address or the thread sanitizer, by Clang
// (scripts/run_sanitizers), else 0.
#define CAIRN_SANITIZED 0
#ifdef __has_feature
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#undef CAIRN_SANITIZED
#define CAIRN_SANITIZED 1
#endif
#endif
