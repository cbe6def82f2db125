#pragma once

#include <sqlite3.h>

#include <string>
#include <string_view>
#include <vector>

#include "fuzz/input.h"

namespace cairn::fuzz {

// A small synthetic scene in a database, of which an input changes rows: a value becomes NULL, a
// number, a text or a blob, a blob is changed in place or cut off, a row is removed or doubled.
class MutatedDatabase {
 public:
  MutatedDatabase();

  // Writes the database with the changes that the input asks for; its path.
  const std::string& Mutate(std::string_view input) const;

 private:
  struct Table {
    std::string name;
    std::vector<std::string> columns;
    std::vector<std::string> rows;  // the SQL condition that each fulfills
  };
  void ReadTables();
  void ChangeValue(sqlite3* connection, const Table& table, Bytes& bytes) const;
  void ChangeRow(sqlite3* connection, const Table& table, Bytes& bytes) const;

  Scratch scratch_;
  std::string path_;
  std::string content_;  // of the file without changes
  std::vector<Table> tables_;
};

}  // namespace cairn::fuzz
