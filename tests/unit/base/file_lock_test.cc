#include "base/file_lock.h"

#include <filesystem>
#include <fstream>
#include <optional>

#include "cairn/base/error.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

TEST(FileLock, OneAtATimeAndNoFileRemains) {
  const TempFolder folder;
  const std::string path = folder / "a.db";
  std::optional<FileLock> lock(path);
  const FileLock another(folder / "b.db");
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(ThrownMessage<IoError>([&] { const FileLock second(path); }),
              path + ": another run of cairn is writing to it");
  }
  lock.reset();
  EXPECT_FALSE(std::filesystem::exists(path + ".lock"));
  lock.emplace(path);
}

TEST(FileLock, ALinkIsItsFile) {
  const TempFolder folder;
  std::ofstream(folder / "a.db") << "";
  std::filesystem::create_symlink("a.db", folder / "link.db");
  const FileLock lock(folder / "link.db");
  EXPECT_THROW(FileLock(folder / "a.db"), IoError);
}

TEST(FileLock, WithoutAFolderThereIsNone) {
  const TempFolder folder;
  const FileLock lock(folder / "absent/a.db");
  const FileLock second(folder / "absent/a.db");
}

}  // namespace
}  // namespace cairn
