#pragma once

#include <concepts>
#include <initializer_list>
#include <map>
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

 private:
  std::vector<std::vector<Cell>> rows_;
};

// A figure and its bounds: wide enough to hold for every machine and seed, narrow enough that a
// wrong sign or a transposed matrix breaks them.
struct FigureCheck {
  std::string name;
  double value = 0;
  double min = 0;
  double max = 0;
  bool Holds() const { return value >= min && value <= max; }
};

// What an experiment gives: its tables by the names of their files (without .csv), and checks.
struct Results {
  std::map<std::string, Table> tables;
  std::vector<FigureCheck> checks;
};

}  // namespace cairn::experiments
