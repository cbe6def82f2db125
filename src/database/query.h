#pragma once

#include <sqlite3.h>

#include <cstdint>
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
  bool has_cairn_tables = false;
  bool has_depth_tables = false;      // cairn_depth_scales
  bool has_lens_table = false;        // cairn_camera_lenses
  bool has_focal_tables = false;      // cairn_focal_evidence, cairn_camera_focals
  bool has_choice_table = false;      // cairn_pair_choices
  bool has_rigs = false;              // COLMAP 4.x: rigs, frames
  bool has_descriptor_types = false;  // COLMAP 4.x: descriptors.type

  ~Impl();
  // Throws what SQLite says, in our words where it is one of the usual troubles.
  [[noreturn]] void Throw(const std::string& what, int code) const;
  void Execute(const char* sql);
};

// One use of a prepared statement: binds by 1-based position, steps, reads by 0-based column.
// Blobs and texts that are bound must live until Step.
class Query {
 public:
  Query(Database::Impl& impl, const char* sql);
  ~Query();
  Query(const Query&) = delete;
  Query& operator=(const Query&) = delete;

  Query& Bind(int position, int64_t value);
  Query& Bind(int position, uint64_t value) { return Bind(position, static_cast<int64_t>(value)); }
  Query& Bind(int position, int value) { return Bind(position, static_cast<int64_t>(value)); }
  Query& Bind(int position, uint32_t value) { return Bind(position, static_cast<int64_t>(value)); }
  Query& Bind(int position, double value);
  Query& Bind(int position, std::string_view value);
  // Never NULL, even when empty.
  Query& BindBlob(int position, const void* data, size_t num_bytes);
  Query& BindNull(int position);

  // True: a row is there. False: done.
  bool Step();
  // For statements that give no rows.
  void Run();

  int64_t Int(int column) const { return sqlite3_column_int64(statement_, column); }
  double Double(int column) const { return sqlite3_column_double(statement_, column); }
  std::string Text(int column) const;
  std::span<const std::byte> Blob(int column) const;

 private:
  Database::Impl& impl_;
  sqlite3_stmt* statement_;
};

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
