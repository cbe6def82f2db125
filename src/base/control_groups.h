#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

// A control group of Linux, by which containers and jobs of clusters limit what their processes
// use. Version 1 has a hierarchy of groups for each controller, version 2 one for all.
struct ControlGroup {
  std::filesystem::path folder;
  bool is_v1 = false;
};

// The groups that this process is in for a controller ("memory", "cpu"), and those around them. All
// files are looked for below `root`.
std::vector<ControlGroup> ControlGroups(const std::string& root, std::string_view controller);

// A file's text; "" if there is no such file.
std::string ReadIfThere(const std::string& path);

// The processors that this process may use: what the machine has and the control groups leave, at
// least 1.
int NumProcessors(const std::string& root = "");

}  // namespace cairn
