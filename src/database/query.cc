#include "database/query.h"

#include "cairn/base/error.h"

namespace cairn {

Database::Impl::~Impl() {
  for (const auto& [sql, statement] : statements) sqlite3_finalize(statement);
  sqlite3_close(connection);
}

void Database::Impl::Throw(const std::string& what, int code) const {
  switch (code & 0xff) {
    case SQLITE_NOTADB:
      throw IoError(path, "is not an SQLite database");
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      throw IoError(path, "is locked by another program, or elsewhere in this one");
    case SQLITE_CORRUPT:
      throw IoError(path, "is a damaged SQLite database");
    case SQLITE_READONLY:
      throw IoError(path, "cannot be written to (read-only)");
    case SQLITE_FULL:
      throw IoError(path, "the disk is full");
    case SQLITE_CANTOPEN:
      throw IoError(path, "cannot be opened or created");
    default:
      throw IoError(path,
                    what + ": " + (connection ? sqlite3_errmsg(connection) : sqlite3_errstr(code)));
  }
}

void Database::Impl::Execute(const char* sql) {
  const int code = sqlite3_exec(connection, sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) Throw("cannot run SQL", code);
}

Query::Query(Database::Impl& impl, const char* sql) : impl_(impl) {
  sqlite3_stmt*& statement = impl.statements[sql];
  if (statement == nullptr) {
    const int code = sqlite3_prepare_v3(impl.connection, sql, -1, SQLITE_PREPARE_PERSISTENT,
                                        &statement, nullptr);
    if (code != SQLITE_OK) impl.Throw("does not have the tables of a COLMAP database", code);
  }
  statement_ = statement;
}

Query::~Query() {
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

void Query::Bind(int position, int64_t value) { sqlite3_bind_int64(statement_, position, value); }

void Query::Bind(int position, double value) { sqlite3_bind_double(statement_, position, value); }

void Query::Bind(int position, std::string_view value) {
  sqlite3_bind_text64(statement_, position, value.data() ? value.data() : "", value.size(),
                      SQLITE_STATIC, SQLITE_UTF8);
}

void Query::Bind(int position, const BoundBlob& blob) {
  if (blob.num_bytes == 0) {
    sqlite3_bind_zeroblob(statement_, position, 0);
  } else if (sqlite3_bind_blob64(statement_, position, blob.data, blob.num_bytes, SQLITE_STATIC) !=
             SQLITE_OK) {
    throw IoError(impl_.path, "a blob of " + std::to_string(blob.num_bytes) + " bytes is too big");
  }
}

bool Query::Step() {
  const int code = sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  impl_.Throw(std::string("cannot run '") + sqlite3_sql(statement_) + "'", code);
}

void Query::Run() {
  while (Step()) {
  }
}

std::string Query::Text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
  return text ? std::string(text, static_cast<size_t>(sqlite3_column_bytes(statement_, column)))
              : std::string();
}

std::span<const std::byte> Query::Blob(int column) const {
  const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(statement_, column));
  return {data, static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
}

MatrixBlob ReadMatrixBlob(const Database::Impl& impl, const Query& query, size_t value_size,
                          const std::string& row_name) {
  MatrixBlob matrix;
  matrix.rows = query.Int(0);
  matrix.cols = query.Int(1);
  const std::span<const std::byte> blob = query.Blob(2);
  // (A row count without columns would need no bytes, and could be any number.)
  const bool fits = matrix.rows >= 0 && matrix.rows < (int64_t{1} << 32) &&
                    matrix.cols >= (matrix.rows > 0 ? 1 : 0) && matrix.cols < (int64_t{1} << 16);
  const size_t expected =
      fits ? static_cast<size_t>(matrix.rows) * static_cast<size_t>(matrix.cols) * value_size : 0;
  if (!fits || blob.size() != expected) {
    throw IoError(impl.path, row_name + ": " + std::to_string(matrix.rows) + " x " +
                                 std::to_string(matrix.cols) + " values need " +
                                 (fits ? std::to_string(expected) : "a different number of") +
                                 " bytes, but the blob has " + std::to_string(blob.size()));
  }
  matrix.data = blob.data();
  return matrix;
}

bool ColumnExists(Database::Impl& impl, std::string_view table, std::string_view column) {
  return Query(impl, "SELECT 1 FROM pragma_table_info(?1) WHERE name = ?2;", table, column).Step();
}

}  // namespace cairn
