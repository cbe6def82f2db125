#pragma once

#include <string>

namespace cairn {

// A relative path without a part "..".
bool StaysInFolder(const std::string& name);

// folder/name. Names of images come from databases and models, which may be a stranger's: throws
// IoError where the name would lead out of the folder.
std::string PathInFolder(const std::string& folder, const std::string& name);

}  // namespace cairn
