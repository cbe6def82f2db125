#pragma once

#include <string>

namespace cairn {

// folder/name. Names of images come from databases and models, which may be a stranger's: throws
// IoError where the name is absolute or has a part "..", so that it would lead out of the folder.
std::string PathInFolder(const std::string& folder, const std::string& name);

}  // namespace cairn
