#include "fuzz/mutated_database.h"

#include <filesystem>

#include "cairn/base/check.h"
#include "cairn/base/file.h"
#include "cairn/database/database.h"
#include "cairn/synthetic/scene.h"

namespace cairn::fuzz {
namespace {

constexpr int kMaxChanges = 8;

SceneOptions SmallScene() {
  SceneOptions options;
  options.layout = CameraLayout::kArc;
  options.num_images = 5;
  options.num_points = 80;
  options.image_noise_px = 0.3;
  options.outlier_ratio = 0.1;
  options.pair_metrics = true;
  return options;
}

sqlite3* Open(const std::string& path) {
  sqlite3* connection = nullptr;
  CAIRN_CHECK_EQ(sqlite3_open(path.c_str(), &connection), SQLITE_OK);
  sqlite3_exec(connection, "PRAGMA journal_mode = MEMORY; PRAGMA synchronous = OFF;", nullptr,
               nullptr, nullptr);
  return connection;
}

// The first column of all rows, as text.
std::vector<std::string> Column(sqlite3* connection, const std::string& sql) {
  sqlite3_stmt* statement = nullptr;
  CAIRN_CHECK_EQ(sqlite3_prepare_v2(connection, sql.c_str(), -1, &statement, nullptr), SQLITE_OK);
  std::vector<std::string> values;
  while (sqlite3_step(statement) == SQLITE_ROW) {
    values.emplace_back(reinterpret_cast<const char*>(sqlite3_column_text(statement, 0)));
  }
  sqlite3_finalize(statement);
  return values;
}

// What stands at ?1, in the way that the next bytes say; `old` is the blob that is there now.
void BindChange(sqlite3_stmt* statement, Bytes& bytes, std::string old) {
  constexpr double kNumbers[] = {0.0, 1e-300, -1e30, 1e300, HUGE_VAL, NAN, 0.5, -1.0};
  switch (bytes.TakeIndex(8)) {
    case 0:
      sqlite3_bind_null(statement, 1);
      return;
    case 1:
      sqlite3_bind_int64(statement, 1, bytes.Take<int64_t>());
      return;
    case 2:
      sqlite3_bind_int64(statement, 1, bytes.Take<int8_t>());
      return;
    case 3:
      sqlite3_bind_double(statement, 1, kNumbers[bytes.TakeIndex(std::size(kNumbers))]);
      return;
    case 4: {
      const std::string_view text = bytes.TakeBytes(bytes.Take<uint8_t>() % 64);
      sqlite3_bind_text(statement, 1, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
      return;
    }
    case 5: {  // one number of the blob
      const size_t offset = bytes.Take<uint16_t>();
      const double value = kNumbers[bytes.TakeIndex(std::size(kNumbers))];
      const auto single = static_cast<float>(value == 1e300 ? HUGE_VAL : value);
      const bool is_double = bytes.TakeIndex(2) == 0;
      const size_t size = is_double ? sizeof(value) : sizeof(single);
      const size_t at = offset * size;
      if (at + size <= old.size()) {
        std::memcpy(old.data() + at, is_double ? static_cast<const void*>(&value) : &single, size);
      }
      break;
    }
    case 6: {  // some bytes of the blob
      const size_t offset = bytes.Take<uint16_t>();
      const std::string_view patch = bytes.TakeBytes(1 + bytes.TakeIndex(16));
      if (offset + patch.size() <= old.size()) old.replace(offset, patch.size(), patch);
      break;
    }
    default:
      old.resize(std::min<size_t>(bytes.Take<uint16_t>(), 2 * old.size() + 8));
  }
  sqlite3_bind_blob(statement, 1, old.data(), static_cast<int>(old.size()), SQLITE_TRANSIENT);
}

}  // namespace

MutatedDatabase::MutatedDatabase() : path_(scratch_.path() + "/scene.db") {
  {
    Database database(path_);
    WriteScene(MakeScene(SmallScene(), 1), SceneContent::kTwoViewGeometries, database);
  }
  ReadTables();
  content_ = ReadFile(path_);
}

void MutatedDatabase::ReadTables() {
  sqlite3* const connection = Open(path_);
  for (const std::string& name :
       Column(connection, "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")) {
    Table table{name, Column(connection, "SELECT name FROM pragma_table_info('" + name + "')"), {}};
    std::string condition;  // SQL for the one of a row: "key = 1 AND ..."
    for (const std::string& key :
         Column(connection, "SELECT name FROM pragma_table_info('" + name + "') WHERE pk > 0")) {
      condition += (condition.empty() ? "'" : " || ' AND ") + key + " = ' || quote(" + key + ")";
    }
    if (condition.empty()) continue;  // SQLite's own
    table.rows = Column(connection, "SELECT " + condition + " FROM " + name + " ORDER BY 1");
    if (!table.rows.empty()) tables_.push_back(std::move(table));
  }
  sqlite3_close(connection);
}

void MutatedDatabase::ChangeValue(sqlite3* connection, const Table& table, Bytes& bytes) const {
  const std::string where = " WHERE " + table.rows[bytes.TakeIndex(table.rows.size())];
  const std::string column = table.columns[bytes.TakeIndex(table.columns.size())];
  sqlite3_stmt* statement = nullptr;
  std::string old;
  const std::string read = "SELECT CAST(" + column + " AS BLOB) FROM " + table.name + where;
  CAIRN_CHECK_EQ(sqlite3_prepare_v2(connection, read.c_str(), -1, &statement, nullptr), SQLITE_OK);
  if (sqlite3_step(statement) == SQLITE_ROW && sqlite3_column_bytes(statement, 0) > 0) {
    old.assign(static_cast<const char*>(sqlite3_column_blob(statement, 0)),
               static_cast<size_t>(sqlite3_column_bytes(statement, 0)));
  }
  sqlite3_finalize(statement);
  const std::string write = "UPDATE OR IGNORE " + table.name + " SET " + column + " = ?1" + where;
  CAIRN_CHECK_EQ(sqlite3_prepare_v2(connection, write.c_str(), -1, &statement, nullptr), SQLITE_OK);
  BindChange(statement, bytes, std::move(old));
  sqlite3_step(statement);
  sqlite3_finalize(statement);
}

void MutatedDatabase::ChangeRow(sqlite3* connection, const Table& table, Bytes& bytes) const {
  const std::string where = " WHERE " + table.rows[bytes.TakeIndex(table.rows.size())];
  const std::string other = " WHERE " + table.rows[bytes.TakeIndex(table.rows.size())];
  const std::string key = table.columns.front();
  const std::string sql = bytes.TakeIndex(2) == 0
                              ? "DELETE FROM " + table.name + where
                              : "UPDATE OR REPLACE " + table.name + " SET " + key + " = (SELECT " +
                                    key + " FROM " + table.name + other + ")" + where;
  sqlite3_exec(connection, sql.c_str(), nullptr, nullptr, nullptr);
}

const std::string& MutatedDatabase::Mutate(std::string_view input) const {
  scratch_.Write("scene.db", content_);
  sqlite3* const connection = Open(path_);
  sqlite3_exec(connection, "PRAGMA foreign_keys = OFF; BEGIN;", nullptr, nullptr, nullptr);
  Bytes bytes(input);
  for (int i = 0; i < kMaxChanges && !bytes.IsEmpty(); ++i) {
    const Table& table = tables_[bytes.TakeIndex(tables_.size())];
    if (bytes.TakeIndex(8) == 0) {
      ChangeRow(connection, table, bytes);
    } else {
      ChangeValue(connection, table, bytes);
    }
  }
  sqlite3_exec(connection, "COMMIT;", nullptr, nullptr, nullptr);
  sqlite3_close(connection);
  return path_;
}

}  // namespace cairn::fuzz
