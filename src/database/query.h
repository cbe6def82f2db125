#pragma once

#include <sqlite3.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>

#include "cairn/database/database.h"

namespace cairn {

// The connection, its prepared statements, and what kind of file it is.
struct Database::Impl {
  std::string path;
  sqlite3* connection = nullptr;
  std::unordered_map<const char*, sqlite3_stmt*> statements;  // by address of the SQL literal
  bool has_rigs = false;                                      // COLMAP 4.x: rigs, frames
  bool has_descriptor_types = false;                          // COLMAP 4.x: descriptors.type

  ~Impl();
  // Throws IoError with SQLite's reason, in our words for the usual ones.
  [[noreturn]] void Throw(const std::string& what, int code) const;
  void Execute(const char* sql);
};

// Opens the file, creates missing tables where the mode allows, and finds out which COLMAP wrote
// it. Throws IoError.
std::unique_ptr<Database::Impl> OpenConnection(const std::string& path, Database::Mode mode);

// Memory that becomes a blob; never NULL, even when empty.
struct BoundBlob {
  const void* data = nullptr;
  size_t num_bytes = 0;
};

// One use of a prepared statement (`sql` is a literal) with its values, ?1 first: numbers, texts,
// blobs, and arrays of doubles that become blobs, or NULL. They must live until Step. Columns are
// 0-based.
class Query {
 public:
  Query(Database::Impl& impl, const char* sql);
  template <class... Values>
  Query(Database::Impl& impl, const char* sql, const Values&... values) : Query(impl, sql) {
    int position = 0;
    (Bind(++position, values), ...);
  }
  ~Query();
  Query(const Query&) = delete;
  Query& operator=(const Query&) = delete;

  // True: a row is there. False: done.
  bool Step();
  // For statements that give no rows.
  void Run();

  template <class T = int64_t>
  T Int(int column) const {
    return static_cast<T>(sqlite3_column_int64(statement_, column));
  }
  double Double(int column) const { return sqlite3_column_double(statement_, column); }
  std::string Text(int column) const;
  std::span<const std::byte> Blob(int column) const;

 private:
  void Bind(int position, int64_t value);
  void Bind(int position, uint64_t value) { Bind(position, static_cast<int64_t>(value)); }
  void Bind(int position, int value) { Bind(position, static_cast<int64_t>(value)); }
  void Bind(int position, uint32_t value) { Bind(position, static_cast<int64_t>(value)); }
  void Bind(int position, double value);
  void Bind(int position, std::string_view value);
  void Bind(int position, const BoundBlob& blob);
  template <size_t n>
  void Bind(int position, const std::optional<std::array<double, n>>& values) {
    if (values) Bind(position, BoundBlob{values->data(), n * sizeof(double)});
  }

  Database::Impl& impl_;
  sqlite3_stmt* statement_;
};

bool ColumnExists(Database::Impl& impl, std::string_view table, std::string_view column);

// A statement that gives no rows.
template <class... Values>
void Run(Database::Impl& impl, const char* sql, const Values&... values) {
  Query(impl, sql, values...).Run();
}

// All rows of a query in a vector or map, each as `from_row(query)` gives it.
template <class Rows, class FromRow>
Rows ReadRows(Query&& query, const FromRow& from_row) {
  Rows rows;
  while (query.Step()) rows.insert(rows.end(), from_row(query));
  return rows;
}

// Blob of a matrix with `rows` x `cols` values of `value_size` bytes, of a query whose first
// columns are rows, cols, data; checks the size. `row_name`, as in "keypoints of image 3", is for
// the message.
struct MatrixBlob {
  int64_t rows = 0;
  int64_t cols = 0;
  const std::byte* data = nullptr;
};
MatrixBlob ReadMatrixBlob(const Database::Impl& impl, const Query& query, size_t value_size,
                          const std::string& row_name);

}  // namespace cairn
