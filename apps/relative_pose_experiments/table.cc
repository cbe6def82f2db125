#include "relative_pose_experiments/table.h"

#include <cstdio>

#include "cairn/base/check.h"
#include "cairn/base/file.h"

namespace cairn::experiments {
namespace {

void AppendLine(const std::vector<std::string>& cells, std::string* csv) {
  for (size_t i = 0; i < cells.size(); ++i) {
    CAIRN_CHECK(cells[i].find_first_of(",\"\n") == std::string::npos);
    if (i > 0) *csv += ',';
    *csv += cells[i];
  }
  *csv += '\n';
}

}  // namespace

Table::Table(std::vector<std::string> columns) : columns_(std::move(columns)) {}

Table& Table::Row() {
  rows_.emplace_back();
  return *this;
}

Table& Table::Add(std::string_view text) {
  CAIRN_CHECK(!rows_.empty());
  rows_.back().emplace_back(text);
  return *this;
}

Table& Table::Add(double value) { return Add(FormatNumber(value)); }

Table& Table::Add(int64_t value) { return Add(std::to_string(value)); }

std::string Table::ToCsv() const {
  std::string csv;
  AppendLine(columns_, &csv);
  for (const auto& row : rows_) {
    CAIRN_CHECK_EQ(row.size(), columns_.size());
    AppendLine(row, &csv);
  }
  return csv;
}

void Table::Write(const std::string& path) const { WriteFileAtomically(path, ToCsv()); }

std::string FormatNumber(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", value);
  return text;
}

}  // namespace cairn::experiments
