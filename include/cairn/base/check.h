#pragma once

#include <sstream>
#include <string>

#include "cairn/base/error.h"

namespace cairn::internal {

[[noreturn]] void ThrowBug(const char* file, int line, const std::string& message);

template <class A, class B>
[[noreturn]] void ThrowComparison(const char* file, int line, const char* text, const A& a,
                                  const B& b) {
  std::ostringstream out;
  out << text << " (" << a << " vs. " << b << ")";
  ThrowBug(file, line, out.str());
}

}  // namespace cairn::internal

// Preconditions, always on; they throw BugError with file, line and values.
#define CAIRN_CHECK(condition)                                                     \
  do {                                                                             \
    if (!(condition)) ::cairn::internal::ThrowBug(__FILE__, __LINE__, #condition); \
  } while (false)

#define CAIRN_CHECK_OP_(a, op, b)                                                         \
  do {                                                                                    \
    const auto& check_a_ = (a);                                                           \
    const auto& check_b_ = (b);                                                           \
    if (!(check_a_ op check_b_))                                                          \
      ::cairn::internal::ThrowComparison(__FILE__, __LINE__, #a " " #op " " #b, check_a_, \
                                         check_b_);                                       \
  } while (false)
#define CAIRN_CHECK_EQ(a, b) CAIRN_CHECK_OP_(a, ==, b)
#define CAIRN_CHECK_NE(a, b) CAIRN_CHECK_OP_(a, !=, b)
#define CAIRN_CHECK_LT(a, b) CAIRN_CHECK_OP_(a, <, b)
#define CAIRN_CHECK_LE(a, b) CAIRN_CHECK_OP_(a, <=, b)
#define CAIRN_CHECK_GT(a, b) CAIRN_CHECK_OP_(a, >, b)
#define CAIRN_CHECK_GE(a, b) CAIRN_CHECK_OP_(a, >=, b)

// For hot loops: on only in debug and sanitizer builds.
#ifdef NDEBUG
#define CAIRN_DCHECK(condition) ((void)0)
#else
#define CAIRN_DCHECK(condition) CAIRN_CHECK(condition)
#endif
