#pragma once

#include <concepts>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace cairn::experiments {

// "%.6g", the same on every machine.
std::string FormatNumber(double value);

// A table of text, written as CSV with a header.
class Table {
 public:
  // A named value: a text, a whole number, or six significant digits.
  struct Cell {
    Cell(const char* column, std::string_view value) : name(column), text(value) {}
    Cell(const char* column, std::integral auto value)
        : name(column), text(std::to_string(value)) {}
    Cell(const char* column, double value) : name(column), text(FormatNumber(value)) {}
    std::string name, text;
  };
  // All rows have the same columns.
  void AddRow(std::initializer_list<Cell> cells);

  std::string ToCsv() const;
  // Throws IoError.
  void Write(const std::string& path) const;

 private:
  std::vector<std::vector<Cell>> rows_;
};

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
