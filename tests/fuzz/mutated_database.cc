#include "fuzz/mutated_database.h"

#include "cairn/base/check.h"
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

MutatedDatabase::MutatedDatabase() {
  const std::string path = scratch_.path() + "/scene.db";
  {
    Database database(path);
    WriteScene(MakeScene(SmallScene(), 1), SceneContent::kTwoViewGeometries, database);
  }
  CAIRN_CHECK_EQ(sqlite3_open(path.c_str(), &connection_), SQLITE_OK);
  Execute("PRAGMA synchronous = OFF; PRAGMA foreign_keys = OFF; ATTACH ':memory:' AS original");
  ReadTables();
  for (const Table& table : tables_) {
    Execute("CREATE TABLE original." + table.name + " AS SELECT * FROM main." + table.name);
  }
  database_.emplace(path, Database::Mode::kReadOnly);
}

void MutatedDatabase::Execute(const std::string& sql) const {
  CAIRN_CHECK_EQ(sqlite3_exec(connection_, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
}

void MutatedDatabase::ReadTables() {
  const auto column = [&](const std::string& sql) { return Column(connection_, sql); };
  for (const std::string& name :
       column("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")) {
    Table table{name, column("SELECT name FROM pragma_table_info('" + name + "')"), {}};
    std::string condition;  // SQL for the one of a row: "key = 1 AND ..."
    for (const std::string& key :
         column("SELECT name FROM pragma_table_info('" + name + "') WHERE pk > 0")) {
      condition += (condition.empty() ? "'" : " || ' AND ") + key + " = ' || quote(" + key + ")";
    }
    if (condition.empty()) continue;  // SQLite's own
    table.rows = column("SELECT " + condition + " FROM " + name + " ORDER BY 1");
    if (!table.rows.empty()) tables_.push_back(std::move(table));
  }
}

void MutatedDatabase::Restore(Table& table) const {
  if (!table.is_changed) return;
  Execute("DELETE FROM main." + table.name);
  Execute("INSERT INTO main." + table.name + " SELECT * FROM original." + table.name);
  table.is_changed = false;
}

void MutatedDatabase::ChangeValue(const Table& table, Bytes& bytes) const {
  const std::string where = " WHERE " + table.rows[bytes.TakeIndex(table.rows.size())];
  const std::string column = table.columns[bytes.TakeIndex(table.columns.size())];
  sqlite3_stmt* statement = nullptr;
  std::string old;
  const std::string read = "SELECT CAST(" + column + " AS BLOB) FROM " + table.name + where;
  CAIRN_CHECK_EQ(sqlite3_prepare_v2(connection_, read.c_str(), -1, &statement, nullptr), SQLITE_OK);
  if (sqlite3_step(statement) == SQLITE_ROW && sqlite3_column_bytes(statement, 0) > 0) {
    old.assign(static_cast<const char*>(sqlite3_column_blob(statement, 0)),
               static_cast<size_t>(sqlite3_column_bytes(statement, 0)));
  }
  sqlite3_finalize(statement);
  const std::string write = "UPDATE OR IGNORE " + table.name + " SET " + column + " = ?1" + where;
  CAIRN_CHECK_EQ(sqlite3_prepare_v2(connection_, write.c_str(), -1, &statement, nullptr),
                 SQLITE_OK);
  BindChange(statement, bytes, std::move(old));
  sqlite3_step(statement);
  sqlite3_finalize(statement);
}

void MutatedDatabase::ChangeRow(const Table& table, Bytes& bytes) const {
  const std::string where = " WHERE " + table.rows[bytes.TakeIndex(table.rows.size())];
  const std::string other = " WHERE " + table.rows[bytes.TakeIndex(table.rows.size())];
  const std::string key = table.columns.front();
  const std::string sql = bytes.TakeIndex(2) == 0
                              ? "DELETE FROM " + table.name + where
                              : "UPDATE OR REPLACE " + table.name + " SET " + key + " = (SELECT " +
                                    key + " FROM " + table.name + other + ")" + where;
  sqlite3_exec(connection_, sql.c_str(), nullptr, nullptr, nullptr);
}

const Database& MutatedDatabase::Mutate(std::string_view input) {
  Execute("BEGIN");
  for (Table& table : tables_) Restore(table);
  Bytes bytes(input);
  for (int i = 0; i < kMaxChanges && !bytes.IsEmpty(); ++i) {
    Table& table = tables_[bytes.TakeIndex(tables_.size())];
    table.is_changed = true;
    if (bytes.TakeIndex(8) == 0) {
      ChangeRow(table, bytes);
    } else {
      ChangeValue(table, bytes);
    }
  }
  Execute("COMMIT");
  return *database_;
}

}  // namespace cairn::fuzz
