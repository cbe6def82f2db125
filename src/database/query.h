#pragma once

#include <sqlite3.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "cairn/database/database.h"

namespace cairn {

// The connection, its prepared statements, and what kind of file it is.
struct Database::Impl {
  std::string path;
  sqlite3* connection = nullptr;
  std::unordered_map<const char*, sqlite3_stmt*> statements;  // by address of the SQL constant
  bool has_rigs = false;                                      // COLMAP 4.x: rigs, frames
  bool has_descriptor_types = false;                          // COLMAP 4.x: descriptors.type

  ~Impl();
  // Throws what SQLite says, in our words where it is one of the usual troubles.
  [[noreturn]] void Throw(const std::string& what, int code) const;
  void Execute(const char* sql);
};

// Memory that becomes a blob; never NULL, even when empty.
struct BoundBlob {
  const void* data = nullptr;
  size_t num_bytes = 0;
};

// One use of a prepared statement with its values, ?1 first: numbers, texts, blobs, and arrays of
// doubles that become blobs, or NULL. They must live until Step. Columns are 0-based.
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

  int64_t Int(int column) const { return sqlite3_column_int64(statement_, column); }
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

// A statement that gives no rows.
template <class... Values>
void Run(Database::Impl& impl, const char* sql, const Values&... values) {
  Query(impl, sql, values...).Run();
}

// Blob of a matrix with `rows` x `cols` values of `value_size` bytes at the columns (rows, cols,
// data) from `first_column` on; checks the size. `row_name`, as in "keypoints of image 3", is for
// the message.
struct MatrixBlob {
  int64_t rows = 0;
  int64_t cols = 0;
  const std::byte* data = nullptr;
};
MatrixBlob ReadMatrixBlob(const Database::Impl& impl, const Query& query, int first_column,
                          size_t value_size, const std::string& row_name);

}  // namespace cairn
