#pragma once

#include <sqlite3.h>

#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace cairn {

using SqlRows = std::vector<std::vector<std::string>>;

// Runs one statement, adds its rows, and returns what sqlite3_step returned last.
inline int StepSql(sqlite3_stmt* statement, SqlRows& rows) {
  int code = SQLITE_DONE;  // of no statement: a comment, or blanks
  while (statement != nullptr && (code = sqlite3_step(statement)) == SQLITE_ROW) {
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
  return code;
}

// Runs SQL statements on a file. Returns their rows, values as SQL literals (blobs as X'..', floats
// to the bit). Throws std::runtime_error where one fails.
inline SqlRows RunSql(const std::string& path, const std::string& sql) {
  sqlite3* db = nullptr;
  int code = sqlite3_open(path.c_str(), &db);
  sqlite3_busy_timeout(db, 10000);
  SqlRows rows;
  for (const char* rest = sql.c_str(); code == SQLITE_OK && *rest != '\0';) {
    sqlite3_stmt* statement = nullptr;
    code = sqlite3_prepare_v2(db, rest, -1, &statement, &rest);
    if (code == SQLITE_OK && StepSql(statement, rows) != SQLITE_DONE) code = SQLITE_ERROR;
    const std::string message = sqlite3_errmsg(db);
    sqlite3_finalize(statement);
    if (code != SQLITE_OK) {
      sqlite3_close(db);
      throw std::runtime_error(path + ": " + sql + ": " + message);
    }
  }
  sqlite3_close(db);
  if (code != SQLITE_OK) throw std::runtime_error("open " + path);
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
