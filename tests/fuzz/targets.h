#pragma once

#include <string_view>

namespace cairn::fuzz {

// A target takes any bytes and returns: what it tries with them either works, or throws IoError or
// ConfigError, which it catches. Anything else that happens is a finding: another exception, a
// signal, a report of a sanitizer, more than 10 s, more than 512 MiB.
using Target = void (*)(std::string_view input);

void FuzzImage(std::string_view input);
void FuzzDepthMap(std::string_view input);
void FuzzColmapBinary(std::string_view input);
void FuzzColmapText(std::string_view input);
void FuzzBundler(std::string_view input);
void FuzzStrecha(std::string_view input);
void FuzzOneDsfm(std::string_view input);
void FuzzRunFolder(std::string_view input);
void FuzzOptions(std::string_view input);
void FuzzLists(std::string_view input);
void FuzzDatabaseBlobs(std::string_view input);
void FuzzDatabaseRows(std::string_view input);
void FuzzReconstruct(std::string_view input);
void FuzzVerifyPair(std::string_view input);

}  // namespace cairn::fuzz
