#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

// Reads a text file line by line, and a line word by word. Every error is an IoError whose path is
// "<file>:<line>".
class TextReader {
 public:
  explicit TextReader(const std::string& path);

  // Goes to the next line (carriage returns are removed); false at the end of the file.
  bool NextLine();
  // Goes to the next line with a word that does not begin with '#'.
  bool NextDataLine();
  // The same, but the end of the file is an error: "the file ends before <what>".
  void ExpectDataLine(std::string_view what);

  // The next word of the line; empty at its end.
  std::string_view Word();
  // The next word as a finite number, or an error that says what was expected.
  double Double(std::string_view what);
  int64_t Integer(std::string_view what, int64_t min = std::numeric_limits<int64_t>::min(),
                  int64_t max = std::numeric_limits<int64_t>::max());
  uint64_t Unsigned(std::string_view what);
  Eigen::Vector3d Vector3(std::string_view what);
  Eigen::Matrix3d RowMajor3x3(std::string_view what);
  // Numbers that may go on over several lines.
  double DoubleOnAnyLine(std::string_view what);

  // The words from here to the end of the line, without moving on.
  std::vector<std::string_view> RemainingWords();
  // The word as a finite number, if it is one.
  static std::optional<double> ToDouble(std::string_view word);

  // The rest of the line without blanks around it.
  std::string_view Rest();
  bool AtLineEnd();
  void ExpectLineEnd();

  std::string_view line() const { return line_; }
  int line_number() const { return line_number_; }
  [[noreturn]] void Fail(const std::string& reason) const;

 private:
  void SkipBlanks();
  std::string path_;
  std::string text_;
  size_t next_line_ = 0;
  std::string_view line_;
  size_t position_ = 0;  // in line_
  int line_number_ = 0;
};

}  // namespace cairn
