#pragma once

#include <string>
#include <vector>

namespace cairn {

// "'<key>'", with what is to be said about an option that is not `known` by this name: its new
// name, that it was removed, or which one may be meant. A key may begin with "--".
std::string DescribeUnknownOption(const std::string& key, const std::vector<std::string>& known);

// "; did you mean '<nearest>'?", or "" where none is near.
std::string DidYouMean(const std::string& name, const std::vector<std::string>& known);

}  // namespace cairn
