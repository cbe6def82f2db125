#pragma once

#include <sqlite3.h>

#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace cairn {

// The rows of a SQL query on a file, values as SQL literals (blobs as X'..', floats to the bit).
inline std::vector<std::vector<std::string>> RunSql(const std::string& path,
                                                    const std::string& sql) {
  sqlite3* db = nullptr;
  if (sqlite3_open(path.c_str(), &db) != SQLITE_OK) throw std::runtime_error("open " + path);
  sqlite3_busy_timeout(db, 10000);
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(db, sql.c_str(), -1, &statement, nullptr) != SQLITE_OK) {
    const std::string message = sqlite3_errmsg(db);
    sqlite3_close(db);
    throw std::runtime_error(sql + ": " + message);
  }
  std::vector<std::vector<std::string>> rows;
  while (sqlite3_step(statement) == SQLITE_ROW) {
    std::vector<std::string>& row = rows.emplace_back();
    for (int i = 0; i < sqlite3_column_count(statement); ++i) {
      const auto* text = static_cast<const char*>(sqlite3_column_blob(statement, i));
      const int size = sqlite3_column_bytes(statement, i);
      switch (sqlite3_column_type(statement, i)) {
        case SQLITE_NULL:
          row.push_back("NULL");
          break;
        case SQLITE_BLOB: {
          std::string hex = "X'";
          for (int k = 0; k < size; ++k) {
            hex += "0123456789ABCDEF"[(text[k] >> 4) & 15];
            hex += "0123456789ABCDEF"[text[k] & 15];
          }
          row.push_back(hex + "'");
          break;
        }
        case SQLITE_FLOAT: {
          char number[40];
          std::snprintf(number, sizeof(number), "%.17g", sqlite3_column_double(statement, i));
          row.push_back(number);
          break;
        }
        default:
          row.push_back(std::string(text ? text : "", static_cast<size_t>(size)));
      }
    }
  }
  sqlite3_finalize(statement);
  sqlite3_close(db);
  return rows;
}

// The whole content of a database as text, in the order in which `sqlite3 FILE .dump` has it, but
// without cairn_timings. Equal databases give equal texts.
inline std::string DumpDatabase(const std::string& path) {
  std::string dump;
  for (const auto& row : RunSql(path, "SELECT name, sql FROM sqlite_master ORDER BY rowid")) {
    dump += row[1] + "\n";
    const bool is_table = row[1].rfind("CREATE TABLE", 0) == 0;
    if (!is_table || row[0] == "cairn_timings") continue;
    for (const auto& values : RunSql(path, "SELECT * FROM " + row[0])) {
      dump += row[0] + ":";
      for (const std::string& value : values) dump += " " + value;
      dump += "\n";
    }
  }
  return dump;
}

}  // namespace cairn
