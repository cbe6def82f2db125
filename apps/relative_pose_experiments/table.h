#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cairn::experiments {

// A table of text, written as CSV with a header.
class Table {
 public:
  explicit Table(std::vector<std::string> columns);

  // Starts a row; Add fills its cells from the left.
  Table& Row();
  Table& Add(std::string_view text);
  Table& Add(double value);  // six significant digits
  Table& Add(int value) { return Add(static_cast<int64_t>(value)); }
  Table& Add(int64_t value);

  // Checks that every row is complete.
  std::string ToCsv() const;
  // Throws IoError.
  void Write(const std::string& path) const;

 private:
  std::vector<std::string> columns_;
  std::vector<std::vector<std::string>> rows_;
};

// "%.6g", the same on every machine.
std::string FormatNumber(double value);

// A figure that must lie within wide bounds: far enough to hold for every machine and seed, near
// enough that a wrong sign or a transposed matrix breaks it.
struct FigureCheck {
  std::string name;
  double value = 0;
  double min = 0;
  double max = 0;
  bool Holds() const { return value >= min && value <= max; }
};

}  // namespace cairn::experiments
