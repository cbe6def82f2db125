#pragma once

#include <string>

namespace cairn {

// What the Error that fn throws says; "no error" where it throws none. Others pass through.
template <class Error, class Fn>
std::string ThrownMessage(const Fn& fn) {
  try {
    fn();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace cairn
