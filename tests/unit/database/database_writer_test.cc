#include "database/database_writer.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "support/database_dump.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

class DatabaseWriterTest : public ::testing::Test {
 protected:
  void SetUp() override { Database database(path_); }
  // The pairs are of images that are not there, so the table itself is asked.
  size_t NumRows(const std::string& table) {
    return std::stoul(RunSql(path_, "SELECT COUNT(*) FROM " + table)[0][0]);
  }
  size_t NumPairs() { return NumRows("matches"); }

  TempFolder folder_;
  const std::string path_ = folder_ / "scene.db";
};

DatabaseWriterOptions SmallOptions() {
  DatabaseWriterOptions options;
  options.max_queue_size = 2;
  options.tasks_per_transaction = 7;
  return options;
}

TEST_F(DatabaseWriterTest, WritesWhatManyThreadsPush) {
  DatabaseWriter writer(path_, SmallOptions());
  ParallelFor(8, 500, [&](int64_t i) {
    writer.Push([i](Database& database) { database.WriteMatches(i + 1, {{0, 0}}); });
  });
  writer.Finish();
  EXPECT_EQ(NumPairs(), 500u);
}

TEST_F(DatabaseWriterTest, CommitsWhileItWaitsForMore) {
  DatabaseWriterOptions options;
  options.seconds_per_transaction = 0.02;
  DatabaseWriter writer(path_, options);
  writer.Push([](Database& database) { database.WriteMatches(1, {{0, 0}}); });
  for (int i = 0; i < 200 && NumPairs() == 0; ++i) usleep(10000);
  EXPECT_EQ(NumPairs(), 1u);
}

TEST_F(DatabaseWriterTest, DropsUncommittedWorkWhenNotFinished) {
  {
    DatabaseWriterOptions options;
    options.seconds_per_transaction = 100;
    DatabaseWriter writer(path_, options);
    writer.Push([](Database& database) { database.WriteMatches(1, {{0, 0}}); });
  }
  EXPECT_EQ(NumPairs(), 0u);
}

TEST_F(DatabaseWriterTest, ATaskThatThrowsRollsBackItsTransactionAndEndsTheWriter) {
  DatabaseWriter writer(path_, SmallOptions());
  bool thrown = false;
  try {
    for (int i = 0; i < 100; ++i) {
      writer.Push([i](Database& database) {
        database.WriteMatches(i + 1, {{0, 0}});
        if (i == 17) throw IoError("x", "y");
      });
    }
    writer.Finish();
  } catch (const IoError& error) {
    thrown = true;
    EXPECT_EQ(error.path(), "x");
  }
  EXPECT_TRUE(thrown);
  EXPECT_EQ(NumPairs(), 14u);  // Two transactions of 7.
}

// A program that is killed loses the transaction in which it was, and nothing else; no task is
// half-written.
TEST_F(DatabaseWriterTest, AKilledProgramLeavesWholeTasks) {
  const pid_t child = fork();
  if (child == 0) {
    DatabaseWriterOptions options;
    options.tasks_per_transaction = 10;
    DatabaseWriter writer(path_, options);
    for (uint64_t i = 1;; ++i) {
      writer.Push([i](Database& database) {
        database.WriteMatches(i, {{0, 0}});
        database.WriteTwoViewGeometry(i, {});
        database.WriteJob("verification", {i, i, ""});
      });
    }
  }
  for (int i = 0; i < 1000 && NumPairs() < 50; ++i) usleep(10000);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  Database database(path_);
  const size_t n = database.ReadJobs("verification").size();
  EXPECT_GE(n, 50u);
  EXPECT_EQ(n % 10, 0u);
  EXPECT_EQ(NumRows("matches"), n);
  EXPECT_EQ(NumRows("two_view_geometries"), n);
}

}  // namespace
}  // namespace cairn
