#pragma once

#include <string>

namespace cairn {

// The content of a text file, without the byte order mark that some programs begin UTF-8 with.
// Throws IoError.
std::string ReadTextFile(const std::string& path);

}  // namespace cairn
