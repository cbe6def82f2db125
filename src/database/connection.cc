#include "database/connection.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <filesystem>

#include "cairn/base/error.h"
#include "database/sql.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kBusyTimeoutMs = 10000;
constexpr std::array kColmapTables = {"cameras",     "images",  "keypoints",
                                      "descriptors", "matches", "two_view_geometries"};

bool TableExists(Database::Impl& impl, const char* table) {
  return Query(impl, sql::kTableExists).Bind(1, std::string_view(table)).Step();
}

// A file in write-ahead mode needs a file beside it even for reading. Where the folder does not
// allow that, the database is opened as one that nobody changes, which holds as long as no log is
// left beside it.
bool MustOpenImmutable(const std::string& path) {
  const fs::path folder = fs::absolute(path).parent_path();
  const bool is_writable = faccessat(AT_FDCWD, folder.c_str(), W_OK, AT_EACCESS) == 0;
  return !is_writable && !fs::exists(path + "-wal");
}

// "file:" URI of a path.
std::string FileUri(const std::string& path) {
  std::string uri = "file:";
  for (const char c : fs::absolute(path).string()) {
    switch (c) {
      case '?':
        uri += "%3f";
        break;
      case '#':
        uri += "%23";
        break;
      case '%':
        uri += "%25";
        break;
      default:
        uri += c;
    }
  }
  return uri;
}

void Open(Database::Impl& impl, Database::Mode mode) {
  const bool in_memory = impl.path == ":memory:";
  if (!in_memory && fs::is_directory(impl.path)) throw IoError(impl.path, "is a folder");
  if (!in_memory && mode != Database::Mode::kCreateOrOpen && !fs::exists(impl.path)) {
    throw IoError(impl.path, "no such file");
  }
  int flags = SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE;
  std::string name = impl.path;
  if (mode == Database::Mode::kReadOnly) {
    flags |= SQLITE_OPEN_READONLY;
    if (MustOpenImmutable(impl.path)) {
      name = FileUri(impl.path) + "?immutable=1";
      flags |= SQLITE_OPEN_URI;
    }
  } else {
    flags |= SQLITE_OPEN_READWRITE;
    if (mode == Database::Mode::kCreateOrOpen) flags |= SQLITE_OPEN_CREATE;
  }
  const int code = sqlite3_open_v2(name.c_str(), &impl.connection, flags, nullptr);
  if (code != SQLITE_OK) impl.Throw("cannot be opened", code);
  sqlite3_busy_timeout(impl.connection, kBusyTimeoutMs);
}

void CreateColmapTables(Database::Impl& impl) {
  impl.Execute(sql::kBegin);
  impl.Execute(sql::kColmapSchema);
  impl.Execute(("PRAGMA user_version = " + std::to_string(sql::kColmapVersion) + ";").c_str());
  impl.Execute(sql::kCommit);
}

void CheckColmapTables(Database::Impl& impl) {
  for (const char* table : kColmapTables) {
    if (!TableExists(impl, table)) {
      throw IoError(impl.path,
                    std::string("is not a COLMAP database: it has no table '") + table + "'");
    }
  }
}

bool ColumnExists(Database::Impl& impl, std::string_view table, std::string_view column) {
  return Query(impl, sql::kColumnExists).Bind(1, table).Bind(2, column).Step();
}

}  // namespace

std::unique_ptr<Database::Impl> OpenConnection(const std::string& path, Database::Mode mode) {
  auto impl = std::make_unique<Database::Impl>();
  impl->path = path;
  Open(*impl, mode);
  const bool is_empty = !Query(*impl, sql::kAnyTableExists).Step();  // The first look at the file.
  if (mode != Database::Mode::kReadOnly) {
    impl->Execute("PRAGMA journal_mode = WAL;");
    impl->Execute("PRAGMA synchronous = NORMAL;");
    impl->Execute("PRAGMA foreign_keys = ON;");
    if (is_empty) CreateColmapTables(*impl);
    CheckColmapTables(*impl);
    impl->Execute(sql::kCairnSchema);
  }
  CheckColmapTables(*impl);
  impl->has_cairn_tables = TableExists(*impl, "cairn_stages");
  impl->has_depth_tables = TableExists(*impl, "cairn_depth_scales");
  impl->has_lens_table = TableExists(*impl, "cairn_camera_lenses");
  impl->has_focal_tables = TableExists(*impl, "cairn_camera_focals");
  impl->has_choice_table = TableExists(*impl, "cairn_pair_choices");
  impl->has_rigs = TableExists(*impl, "rigs") && TableExists(*impl, "frame_data");
  impl->has_descriptor_types = ColumnExists(*impl, "descriptors", "type");
  return impl;
}

}  // namespace cairn
