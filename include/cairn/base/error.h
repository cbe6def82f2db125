#pragma once

#include <stdexcept>
#include <string>

namespace cairn {

// The three kinds of failure (src/STYLE.md, "Errors"). Expected outcomes (no model, disconnected
// graph) are not errors: they are a status in the report of the function that met them.

// A file, folder or database that cannot be read or written. what() is "<path>: <reason>".
class IoError : public std::runtime_error {
 public:
  IoError(const std::string& path, const std::string& reason)
      : std::runtime_error(path + ": " + reason), path_(path), reason_(reason) {}
  const std::string& path() const { return path_; }
  const std::string& reason() const { return reason_; }

 private:
  std::string path_;
  std::string reason_;
};

// A wrong option, flag or configuration file. what() is "<key>: <reason>".
class ConfigError : public std::runtime_error {
 public:
  ConfigError(const std::string& key, const std::string& reason)
      : std::runtime_error(key + ": " + reason), key_(key) {}
  const std::string& key() const { return key_; }

 private:
  std::string key_;
};

// A broken precondition: a defect in the program. Thrown by CAIRN_CHECK.
class BugError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

}  // namespace cairn
