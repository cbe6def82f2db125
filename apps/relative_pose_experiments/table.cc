#include "relative_pose_experiments/table.h"

#include <algorithm>
#include <cstdio>

#include "cairn/base/check.h"
#include "cairn/io/csv.h"

namespace cairn::experiments {
namespace {

std::string Line(const std::vector<Table::Cell>& cells, std::string Table::Cell::*part) {
  std::string line;
  for (const Table::Cell& cell : cells) {
    line += (&cell == &cells.front() ? "" : ",") + CsvField(cell.*part);
  }
  return line + '\n';
}

}  // namespace

void Table::AddRow(std::initializer_list<Cell> cells) {
  rows_.emplace_back(cells);
  CAIRN_CHECK(std::ranges::equal(rows_.front(), rows_.back(), {}, &Cell::name, &Cell::name));
}

std::string Table::ToCsv() const {
  std::string csv;
  if (!rows_.empty()) csv += Line(rows_.front(), &Cell::name);
  for (const std::vector<Cell>& row : rows_) csv += Line(row, &Cell::text);
  return csv;
}

std::string FormatNumber(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", value);
  return text;
}

}  // namespace cairn::experiments
