#include "report_page/page_blocks.h"

namespace cairn {
namespace {

void AppendBase64(std::string_view bytes, std::string& text) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  text.reserve(text.size() + 4 * (bytes.size() / 3 + 1));
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k) {
      group = group << 8 | (i + k < bytes.size() ? static_cast<uint8_t>(bytes[i + k]) : 0);
    }
    for (size_t k = 0; k < 4; ++k) {
      text += i + k <= bytes.size() ? kDigits[group >> (18 - 6 * k) & 63] : '=';
    }
  }
}

}  // namespace

int PageBlocks::AddBytes(std::string_view bytes) {
  html_ += "<script type=\"text/plain\" id=\"block" + std::to_string(num_) + "\">";
  AppendBase64(bytes, html_);
  html_ += "</script>\n";
  return num_++;
}

}  // namespace cairn
