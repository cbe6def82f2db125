#pragma once

#include <sqlite3.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/database/database.h"
#include "fuzz/input.h"

namespace cairn::fuzz {

// A small synthetic scene in a database, of which an input changes rows: a value becomes NULL, a
// number, a text or a blob, a blob is changed in place or cut off, a row is removed or doubled. The
// file and both connections to it are kept; the next input begins with the rows as they were.
class MutatedDatabase {
 public:
  MutatedDatabase();
  ~MutatedDatabase() { sqlite3_close(connection_); }
  MutatedDatabase(const MutatedDatabase&) = delete;
  MutatedDatabase& operator=(const MutatedDatabase&) = delete;

  // The database, read only, with the changes that the input asks for.
  const Database& Mutate(std::string_view input);

 private:
  struct Table {
    std::string name;
    std::vector<std::string> columns;
    std::vector<std::string> rows;  // the SQL condition that each fulfills
    bool is_changed = false;
  };
  void Execute(const std::string& sql) const;
  void ReadTables();
  void Restore(Table& table) const;
  void ChangeValue(const Table& table, Bytes& bytes) const;
  void ChangeRow(const Table& table, Bytes& bytes) const;

  Scratch scratch_;
  sqlite3* connection_ = nullptr;  // which changes rows; `original` in it has them without changes
  std::vector<Table> tables_;
  std::optional<Database> database_;
};

}  // namespace cairn::fuzz
