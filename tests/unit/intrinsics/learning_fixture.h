#pragma once

#include <functional>
#include <string>

#include "cairn/pipeline/verify_pairs.h"
#include "support/database_dump.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/test_monitor.h"

namespace cairn {

// Databases with matches, and what verification learns from them of their cameras.
class LearningTest : public ::testing::Test {
 protected:
  static StageReport Verify(const std::string& path, int num_threads = 2,
                            ProgressMonitor& monitor = NullMonitor()) {
    Database database(path);
    VerificationInput input;
    input.options = "a = 1\n";
    return VerifyPairs(database, MakeVerifiers("fast", {}), input,
                       {.num_threads = num_threads, .monitor = monitor});
  }

  // One thread, eight, and a run that is stopped after every few pairs leave equal rows, in
  // databases that `make` makes by name. The parts of that run together count `num_learned`.
  // Returns the rows.
  static std::string ExpectEqualRows(const std::function<std::string(const std::string&)>& make,
                                     const std::string& counted, int num_learned) {
    const std::string whole = make("whole.db"), threads = make("threads.db");
    Verify(whole, 1);
    Verify(threads, 8);
    const std::string dump = DumpDatabase(whole);
    EXPECT_TRUE(DumpDatabase(threads) == dump);
    const std::string parts = make("parts.db");
    int num_runs = 0, sum = 0;
    for (; num_runs < 60; ++num_runs) {
      TestMonitor monitor(3);
      const StageReport report = Verify(parts, 2, monitor);
      sum += static_cast<int>(report.Value(counted));
      if (!report.WasStopped()) break;
    }
    EXPECT_GT(num_runs, 4);
    EXPECT_LT(num_runs, 60);
    EXPECT_EQ(sum, num_learned);
    EXPECT_TRUE(DumpDatabase(parts) == dump);
    return dump;
  }

  TempFolder folder_;
};

}  // namespace cairn
