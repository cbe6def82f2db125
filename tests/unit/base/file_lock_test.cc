#include "base/file_lock.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>

#include "cairn/base/error.h"
#include "support/temp_folder.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

TEST(FileLock, OneAtATimeAndNoFileRemains) {
  const testing::TempFolder folder;
  const std::string path = folder / "a.db";
  std::optional<FileLock> lock(path);
  const FileLock another(folder / "b.db");
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(testing::ThrownMessage<IoError>([&] { const FileLock second(path); }),
              path + ": another run of cairn is writing to it");
  }
  lock.reset();
  EXPECT_FALSE(std::filesystem::exists(path + ".lock"));
  lock.emplace(path);
}

TEST(FileLock, WithoutAFolderThereIsNone) {
  const testing::TempFolder folder;
  const FileLock lock(folder / "absent/a.db");
  const FileLock second(folder / "absent/a.db");
}

}  // namespace
}  // namespace cairn
