// Databases of strangers: every blob by itself, rows through all readers.
#include "cairn/database/database.h"

#include "cairn/base/check.h"
#include "fuzz/input.h"
#include "fuzz/mutated_database.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {
namespace {

constexpr const char* kBlobColumns[][2] = {{"keypoints", "data"},
                                           {"descriptors", "data"},
                                           {"matches", "data"},
                                           {"cairn_depth_scales", "data"},
                                           {"cameras", "params"},
                                           {"two_view_geometries", "data"},
                                           {"two_view_geometries", "F"},
                                           {"two_view_geometries", "E"},
                                           {"two_view_geometries", "H"},
                                           {"two_view_geometries", "qvec"},
                                           {"two_view_geometries", "tvec"},
                                           {"cairn_pair_metrics", "qvec"},
                                           {"cairn_pair_metrics", "tvec"},
                                           {"cairn_polarities", "data"}};

// A database of two images and a pair, and beside it the connection that changes it.
struct SmallDatabase {
  SmallDatabase() : database(scratch.path() + "/pair.db") {
    database.WriteCamera({.camera_id = 1,
                          .model = CameraModel::kSimplePinhole,
                          .width = 640,
                          .height = 480,
                          .params = {500, 320, 240}});
    for (const image_t id : {1, 2}) {
      database.WriteImage({id, std::to_string(id) + ".jpg", 1});
      database.WriteKeypoints(id, {{}, {}});
      database.WriteDescriptors(id, Descriptors::Zero(2, 128), {1, 0});
      database.WriteDepthSamples(id, std::vector<DepthSample>(2));
    }
    database.WriteMatches(pair, {{0, 0}});
    database.WriteTwoViewGeometry(pair, {});
    PairMetrics metrics;
    metrics.pair_id = pair;
    metrics.verifier = "five_point";
    database.WritePairMetrics(metrics);
    CAIRN_CHECK_EQ(sqlite3_open(database.path().c_str(), &connection), SQLITE_OK);
    sqlite3_exec(connection, "PRAGMA synchronous = OFF;", nullptr, nullptr, nullptr);
  }

  // Puts rows, columns (where the table has them) and the blob into one row.
  void Change(const char* const (&column)[2], Bytes bytes) {
    const std::string table = column[0];
    const int64_t rows = bytes.Take<int32_t>(), cols = bytes.Take<int8_t>();
    const bool is_matrix = std::string_view(column[1]) == "data" && table != "cairn_polarities";
    const std::string sql = "UPDATE " + table + " SET " +
                            (is_matrix ? "rows = ?1, cols = ?2, " : "") + column[1] + " = ?3" +
                            (table == "cameras" ? ", model = ?1" : "");
    sqlite3_stmt* statement = nullptr;
    CAIRN_CHECK_EQ(sqlite3_prepare_v2(connection, sql.c_str(), -1, &statement, nullptr), SQLITE_OK);
    sqlite3_bind_int64(statement, 1, rows);
    sqlite3_bind_int64(statement, 2, cols);
    const std::string_view blob = bytes.TakeBytes(1 << 20);
    sqlite3_bind_blob(statement, 3, blob.data(), static_cast<int>(blob.size()), SQLITE_STATIC);
    sqlite3_step(statement);
    sqlite3_finalize(statement);
  }

  Scratch scratch;
  Database database;
  sqlite3* connection = nullptr;
  image_pair_t pair = ImagePairToPairId(1, 2);
};

void ReadImageRows(const Database& database, image_t id) {
  ReadOrRefuse([&] { database.ReadKeypoints(id); });
  ReadOrRefuse([&] {
    if (const auto descriptors = database.ReadDescriptors(id)) {
      database.ReadPolarities(id, *descriptors);
    }
  });
  ReadOrRefuse([&] { database.ReadDepthSamples(id); });
}

void ReadPairRows(const Database& database, image_pair_t pair) {
  ReadOrRefuse([&] { database.ReadMatches(pair); });
  ReadOrRefuse([&] {
    const std::optional<TwoViewGeometry> geometry = database.ReadTwoViewGeometry(pair);
    if (!geometry || !geometry->cam2_from_cam1) return;
    const Rigid3d& pose = *geometry->cam2_from_cam1;
    CAIRN_CHECK(std::abs(pose.rotation.norm() - 1.0) < 1e-9 && pose.translation.allFinite());
  });
}

// All that is read of many rows at once.
void ReadTables(const Database& database) {
  ReadOrRefuse([&] { database.FindBadRows(); });
  ReadOrRefuse([&] {
    for (const Camera& camera : database.ReadCameras()) CAIRN_CHECK_EQ(camera.Validate(), "");
  });
  ReadOrRefuse([&] { database.ReadUnknownCameras(); });
  ReadOrRefuse([&] { database.ReadNumMatches(); });
  ReadOrRefuse([&] { database.ReadNumInliers(); });
  ReadOrRefuse([&] { database.ReadNumKeypoints(); });
  ReadOrRefuse([&] { database.ReadNumDescriptors(); });
  ReadOrRefuse([&] { database.ReadPairMetrics(); });
  ReadOrRefuse([&] { database.ReadPairChoices(); });
  ReadOrRefuse([&] { database.ReadFocalEvidence(); });
  ReadOrRefuse([&] { database.ReadCameraFocals(); });
  ReadOrRefuse([&] { database.ReadCameraLenses(); });
  ReadOrRefuse([&] { database.ReadPhotos(); });
  ReadOrRefuse([&] { database.CountWinners(); });
}

}  // namespace

void FuzzDatabaseBlobs(std::string_view input) {
  static SmallDatabase small;
  Bytes bytes(input);
  const auto& column = kBlobColumns[bytes.TakeIndex(std::size(kBlobColumns))];
  small.Change(column, bytes);
  if (std::string_view(column[0]) == "cameras") {
    ReadTables(small.database);
  } else {
    ReadImageRows(small.database, 1);
    ReadPairRows(small.database, small.pair);
    ReadOrRefuse([&] { small.database.ReadPairMetrics(); });
  }
}

void FuzzDatabaseRows(std::string_view input) {
  static MutatedDatabase mutated;
  const Database& database = mutated.Mutate(input);
  ReadTables(database);
  ReadOrRefuse([&] {
    for (const Image& image : database.ReadImages()) ReadImageRows(database, image.image_id);
    for (const image_pair_t pair : database.ReadMatchedPairIds()) ReadPairRows(database, pair);
  });
}

}  // namespace cairn::fuzz
