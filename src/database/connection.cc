#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <sstream>
#include <string_view>
#include <utility>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "database/query.h"
#include "database/sql.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kBusyTimeoutMs = 10000;
// The columns that every version of COLMAP has.
constexpr std::pair<const char*, std::array<const char*, 6>> kColmapTables[] = {
    {"cameras", {"camera_id", "model", "width", "height", "params", "prior_focal_length"}},
    {"images", {"image_id", "name", "camera_id"}},
    {"keypoints", {"image_id", "rows", "cols", "data"}},
    {"descriptors", {"image_id", "rows", "cols", "data"}},
    {"matches", {"pair_id", "rows", "cols", "data"}},
    {"two_view_geometries", {"pair_id", "rows", "cols", "data", "config"}}};

bool IsReadOnly(Database::Mode mode) {
  return mode == Database::Mode::kReadOnly || mode == Database::Mode::kSnapshot;
}

bool TableExists(Database::Impl& impl, const char* table) {
  return Query(impl, "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?1;", table)
      .Step();
}

// A file in write-ahead mode needs a file beside it even for reading. Where the folder does not
// allow that, the database is opened as immutable, which is right as long as no log is
// left beside it. Both are beside the file that links lead to.
bool MustOpenImmutable(const std::string& path) {
  const fs::path file = fs::absolute(BehindLinks(path));
  const bool is_writable = faccessat(AT_FDCWD, file.parent_path().c_str(), W_OK, AT_EACCESS) == 0;
  return !is_writable && !fs::exists(file.string() + "-wal");
}

// "file:" URI of a path.
std::string FileUri(const std::string& path) {
  std::string uri = "file:";
  for (const char c : fs::absolute(path).string()) {
    uri += c == '?' ? "%3f" : c == '#' ? "%23" : c == '%' ? "%25" : std::string(1, c);
  }
  return uri;
}

void Open(Database::Impl& impl, Database::Mode mode) {
  const bool in_memory = impl.path == ":memory:";
  if (!in_memory && fs::is_directory(impl.path)) throw IoError(impl.path, "is a folder");
  // Not by opening it: closing it again would take the locks from all connections of this process
  // to the file, and another process could then damage it.
  if (!in_memory && fs::exists(impl.path) && !fs::is_regular_file(impl.path)) {
    throw IoError(impl.path, "is a pipe or a device, not a file");
  }
  if (!in_memory && mode != Database::Mode::kCreateOrOpen && !fs::exists(impl.path)) {
    throw IoError(impl.path, "no such file");
  }
  int flags = SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE;
  std::string name = impl.path;
  if (IsReadOnly(mode) && MustOpenImmutable(impl.path)) {
    name = FileUri(impl.path) + "?immutable=1";
    flags |= SQLITE_OPEN_READONLY | SQLITE_OPEN_URI;
  } else {
    // For reading alone, too: of connections that may not write, the last one leaves the log and
    // its index beside the file.
    flags |= SQLITE_OPEN_READWRITE;
    if (mode == Database::Mode::kCreateOrOpen) flags |= SQLITE_OPEN_CREATE;
  }
  const int code = sqlite3_open_v2(name.c_str(), &impl.connection, flags, nullptr);
  if (code != SQLITE_OK) impl.Throw("cannot be opened", code);
  sqlite3_busy_timeout(impl.connection, kBusyTimeoutMs);
  // Triggers and the like in a stranger's file must not call functions that reach beyond it.
  sqlite3_db_config(impl.connection, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
}

void CreateColmapTables(Database::Impl& impl) {
  impl.Execute((std::string("BEGIN IMMEDIATE;") + sql::kColmapSchema +
                "PRAGMA user_version = " + std::to_string(sql::kColmapVersion) + ";COMMIT;")
                   .c_str());
}

// The table of two-view geometries, under the name that it has in this file.
const char* GeometryTable(Database::Impl& impl) {
  constexpr const char* kOldName = "inlier_matches";
  constexpr const char* kName = "two_view_geometries";
  return !TableExists(impl, kName) && TableExists(impl, kOldName) ? kOldName : kName;
}

void CheckColmapTables(Database::Impl& impl) {
  for (const auto& [name, columns] : kColmapTables) {
    const bool is_geometry = std::string_view(name) == "two_view_geometries";
    const std::string table = is_geometry ? GeometryTable(impl) : name;
    const std::string refusal = "is not a COLMAP database: ";
    if (!TableExists(impl, table.c_str())) {
      throw IoError(impl.path, refusal + "it has no table '" + table + "'");
    }
    for (const char* column : columns) {
      if (column == nullptr || ColumnExists(impl, table, column)) continue;
      throw IoError(impl.path,
                    refusal + "its table '" + table + "' has no column '" + column + "'");
    }
  }
}

// A file of an old COLMAP gets the schema of 3.8, as COLMAP does it: before 3.0 inlier_matches,
// before 3.4 no F, E, H, before 3.6 no qvec, tvec. For reading alone it is a view, which this
// connection sees in place of the table.
void AdaptOldTables(Database::Impl& impl, bool is_read_only) {
  const std::string table = GeometryTable(impl);
  const bool is_old_name = table != "two_view_geometries";
  std::string change, columns = "pair_id, rows, cols, data, config";
  if (is_old_name) change = "ALTER TABLE inlier_matches RENAME TO two_view_geometries;";
  for (const std::string column : {"F", "E", "H", "qvec", "tvec"}) {
    const bool is_missing = !ColumnExists(impl, table, column);
    if (is_missing) change += "ALTER TABLE two_view_geometries ADD COLUMN " + column + " BLOB;";
    columns += (is_missing ? ", NULL AS " : ", ") + column;
  }
  if (change.empty()) return;
  if (is_read_only) {
    impl.Execute(
        ("CREATE TEMP VIEW two_view_geometries AS SELECT " + columns + " FROM main." + table + ";")
            .c_str());
  } else {
    impl.Execute(("BEGIN IMMEDIATE;" + change + "COMMIT;").c_str());
  }
}

// For reading alone: those of our tables that the file lacks, as empty ones of this connection.
void AddEmptyTables(Database::Impl& impl) {
  std::istringstream schema(sql::kCairnSchema);
  for (std::string statement; std::getline(schema, statement, ';');) {
    const size_t begin = statement.find("cairn_");
    if (begin == std::string::npos) continue;
    const std::string table = statement.substr(begin);
    const std::string name = table.substr(0, table.find('\n'));
    if (!TableExists(impl, name.c_str())) impl.Execute(("CREATE TEMP TABLE " + table).c_str());
  }
}

}  // namespace

std::unique_ptr<Database::Impl> OpenConnection(const std::string& path, Database::Mode mode) {
  auto impl = std::make_unique<Database::Impl>();
  impl->path = path;
  Open(*impl, mode);
  const bool is_read_only = IsReadOnly(mode);
  const bool is_empty =
      !Query(*impl, "SELECT 1 FROM sqlite_master LIMIT 1;").Step();  // The first look at the file.
  if (is_read_only || !is_empty) CheckColmapTables(*impl);           // Before anything is changed.
  impl->Execute("PRAGMA temp_store = MEMORY;");
  if (!is_read_only) {
    impl->Execute("PRAGMA journal_mode = WAL;");
    impl->Execute("PRAGMA synchronous = NORMAL;");
    impl->Execute("PRAGMA foreign_keys = ON;");
    impl->Execute("PRAGMA secure_delete = OFF;");  // Debian's would write what is deleted, twice
    if (is_empty) CreateColmapTables(*impl);
    impl->Execute(sql::kCairnSchema);
    impl->Execute(sql::kCairnRules);
  } else {
    AddEmptyTables(*impl);
  }
  AdaptOldTables(*impl, is_read_only);
  impl->Execute(sql::kCreateUsableImages);
  if (is_read_only) impl->Execute("PRAGMA query_only = ON;");
  impl->has_rigs = TableExists(*impl, "rigs") && TableExists(*impl, "frame_data");
  impl->has_descriptor_types = ColumnExists(*impl, "descriptors", "type");
  if (mode == Database::Mode::kSnapshot) impl->Execute("BEGIN;");
  return impl;
}

}  // namespace cairn
