#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace cairn {

// The text without the blanks and tabs around it.
std::string_view Trimmed(std::string_view text);

// The texts between separators, one more than there are separators.
std::vector<std::string_view> Split(std::string_view text, char separator);

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
  // Whole numbers within limits.
  template <class T = int64_t>
  T Integer(std::string_view what, std::type_identity_t<T> min = std::numeric_limits<T>::min(),
            std::type_identity_t<T> max = std::numeric_limits<T>::max()) {
    return static_cast<T>(IntegerWithin(what, min, max));
  }
  // A vector, or a matrix row by row.
  template <class Matrix>
  Matrix Doubles(std::string_view what) {
    Matrix m;
    for (double& value : m.template reshaped<Eigen::RowMajor>()) value = Double(what);
    return m;
  }
  // The same of numbers that may go on over several lines.
  double DoubleOnAnyLine(std::string_view what);
  template <class Matrix>
  Matrix DoublesOnAnyLine(std::string_view what) {
    Matrix m;
    for (double& value : m.template reshaped<Eigen::RowMajor>()) value = DoubleOnAnyLine(what);
    return m;
  }

  // The words from here to the end of the line, without moving on.
  std::vector<std::string_view> RemainingWords();
  // The word as a finite number, if it is one; all words as such, if all are.
  static std::optional<double> ToDouble(std::string_view word);
  static std::optional<std::vector<double>> ToDoubles(std::span<const std::string_view> words);

  // The rest of the line without blanks around it.
  std::string_view Rest();
  bool AtLineEnd();
  void ExpectLineEnd();

  std::string_view line() const { return line_; }
  int line_number() const { return line_number_; }
  [[noreturn]] void Fail(const std::string& reason) const;

 private:
  int64_t IntegerWithin(std::string_view what, int64_t min, int64_t max);
  void SkipBlanks();
  std::string path_;
  std::string text_;
  size_t next_line_ = 0;
  std::string_view line_;
  size_t position_ = 0;  // in line_
  int line_number_ = 0;
};

}  // namespace cairn
