#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cairn {

// Arrays of the page, each in an element of its own, which the page decodes when it needs it:
// little-endian numbers in base64 (RFC 4648, section 4).
class PageBlocks {
 public:
  // Returns the number of the block.
  template <class T>
  int Add(const std::vector<T>& values) {
    return AddBytes({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
  }
  int AddBytes(std::string_view bytes);
  // <script type="text/plain" id="block0">...</script> ...
  const std::string& Html() const { return html_; }

 private:
  int num_ = 0;
  std::string html_;
};

}  // namespace cairn
