#include "io/text_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {
namespace {

constexpr char kBlanks[] = " \t";

bool IsBlank(char c) { return c == ' ' || c == '\t'; }

std::string Expected(std::string_view what, std::string_view word) {
  if (word.empty()) return "the line is too short: " + std::string(what) + " is missing";
  return std::string(what) + " expected, not '" + std::string(word.substr(0, 40)) + "'";
}

// Without the byte order mark that some programs begin UTF-8 with.
std::string ReadTextFile(const std::string& path) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  std::string text = ReadFile(path);
  if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  // (UTF-16, as spreadsheets write it, has a byte order mark.)
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    throw IoError(path, "is UTF-16; save it as UTF-8");
  }
  if (text.find('\0') != std::string::npos) throw IoError(path, "is no text file");
  return text;
}

// Reads all of `word`; false if it is no number of this type.
template <class T>
bool Parse(std::string_view word, T& value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
  if constexpr (std::is_floating_point_v<T>) {
    if (result.ec == std::errc::result_out_of_range) {
      value = std::strtod(std::string(word).c_str(), nullptr);  // 0 or infinite
      return std::isfinite(value);
    }
  }
  return result.ec == std::errc() && result.ptr == word.data() + word.size();
}

}  // namespace

std::string_view Trimmed(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  return text.substr(0, text.find_last_not_of(kBlanks) + 1);
}

std::vector<std::string_view> Split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (size_t begin = 0; begin <= text.size(); begin += parts.back().size() + 1) {
    parts.push_back(text.substr(begin, text.find(separator, begin) - begin));
  }
  return parts;
}

TextReader::TextReader(const std::string& path) : path_(path), text_(ReadTextFile(path)) {}

bool TextReader::NextLine() {
  if (next_line_ >= text_.size()) {
    line_ = {};
    position_ = 0;
    return false;
  }
  const size_t end = std::min(text_.find('\n', next_line_), text_.size());
  line_ = std::string_view(text_).substr(next_line_, end - next_line_);
  if (line_.ends_with('\r')) line_.remove_suffix(1);
  next_line_ = end + 1;
  position_ = 0;
  ++line_number_;
  return true;
}

bool TextReader::NextDataLine() {
  while (NextLine()) {
    SkipBlanks();
    if (position_ < line_.size() && line_[position_] != '#') return true;
  }
  return false;
}

void TextReader::ExpectDataLine(std::string_view what) {
  if (!NextDataLine()) Fail("the file ends before " + std::string(what));
}

void TextReader::SkipBlanks() {
  while (position_ < line_.size() && IsBlank(line_[position_])) ++position_;
}

std::string_view TextReader::Word() {
  SkipBlanks();
  const size_t begin = position_;
  while (position_ < line_.size() && !IsBlank(line_[position_])) ++position_;
  return line_.substr(begin, position_ - begin);
}

double TextReader::Double(std::string_view what) {
  const std::string_view word = Word();
  const std::optional<double> value = ToDouble(word);
  if (!value) Fail(Expected(what, word));
  return *value;
}

int64_t TextReader::IntegerWithin(std::string_view what, int64_t min, int64_t max) {
  const std::string_view word = Word();
  int64_t value = 0;
  if (!Parse(word, value)) Fail(Expected(what, word));
  if (value < min || value > max) {
    Fail(std::string(what) + " " + std::to_string(value) + " is not in [" + std::to_string(min) +
         ", " + std::to_string(max) + "]");
  }
  return value;
}

double TextReader::DoubleOnAnyLine(std::string_view what) {
  if (AtLineEnd()) ExpectDataLine(what);
  return Double(what);
}

std::vector<std::string_view> TextReader::RemainingWords() {
  const size_t position = position_;
  std::vector<std::string_view> words;
  while (!AtLineEnd()) words.push_back(Word());
  position_ = position;
  return words;
}

std::optional<double> TextReader::ToDouble(std::string_view word) {
  double value = 0;
  if (!Parse(word, value) || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<std::vector<double>> TextReader::ToDoubles(std::span<const std::string_view> words) {
  std::vector<double> values;
  for (const std::string_view word : words) {
    const std::optional<double> value = ToDouble(word);
    if (!value) return std::nullopt;
    values.push_back(*value);
  }
  return values;
}

std::string_view TextReader::Rest() {
  return Trimmed(line_.substr(std::exchange(position_, line_.size())));
}

bool TextReader::AtLineEnd() {
  SkipBlanks();
  return position_ == line_.size();
}

void TextReader::ExpectLineEnd() {
  if (!AtLineEnd()) Fail("the line is too long, from '" + std::string(Rest().substr(0, 40)) + "'");
}

void TextReader::Fail(const std::string& reason) const {
  throw IoError(path_ + ":" + std::to_string(line_number_), reason);
}

}  // namespace cairn
