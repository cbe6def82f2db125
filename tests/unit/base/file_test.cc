#include "cairn/base/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

#include "cairn/base/error.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"
#include "support/unprivileged.h"

namespace cairn {
namespace {

size_t NumFiles(const TempFolder& folder) {
  return std::distance(std::filesystem::directory_iterator(folder.path()), {});
}

TEST(File, ContentComesBackWhateverTheBytes) {
  const TempFolder folder;
  std::string content = "a\0b\r\n\xFF";
  content.resize(200000, 'x');
  WriteFileAtomically(folder / "a", content);
  EXPECT_EQ(ReadFile(folder / "a"), content);
  WriteFileAtomically(folder / "a", "");
  EXPECT_EQ(ReadFile(folder / "a"), "");
  EXPECT_EQ(NumFiles(folder), 1u);
}

TEST(File, ReadsFilesWithoutASize) { EXPECT_THAT(ReadFile("/proc/self/status"), HasSubstr("Pid")); }

// Opening a pipe would wait for its writer, and a device may have no end.
TEST(File, PipesAndDevicesAreRefused) {
  const TempFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  std::filesystem::create_symlink("pipe", folder / "link");
  for (const std::string& path : {folder / "pipe", folder / "link", std::string("/dev/zero")}) {
    EXPECT_THAT(ThrownMessage<IoError>([&] { ReadFile(path); }),
                HasSubstr("is a pipe or a device"));
  }
  WriteFileAtomically(folder / "a", "x");
  std::filesystem::create_symlink("a", folder / "link2");
  EXPECT_EQ(ReadFile(folder / "link2"), "x");
}

TEST(File, NamesDoNotLeadOutOfTheirFolder) {
  EXPECT_EQ(PathInFolder("a", "b/c.jpg"), "a/b/c.jpg");
  EXPECT_EQ(PathInFolder("a", "..b/c..jpg"), "a/..b/c..jpg");
  for (const std::string name : {"/etc/passwd", "../c.jpg", "b/../../c.jpg", "b/.."}) {
    EXPECT_THAT(ThrownMessage<IoError>([&] { PathInFolder("a", name); }),
                HasSubstr(name + ": the name leads out of the folder a"));
  }
}

TEST(File, AsManyBytesAsAreWanted) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a", "12345");
  EXPECT_EQ(ReadFile(folder / "a", 3), "123");
  EXPECT_EQ(ReadFile(folder / "a", 5), "12345");
  EXPECT_EQ(ReadFile(folder / "a", 9), "12345");
  EXPECT_EQ(ReadFile(folder / "a", 0), "");
}

TEST(File, NothingAppearsBeforeCommitAndTheOldFileStays) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a", "old");
  {
    AtomicFile file(folder / "a");
    file.Write("new");
    EXPECT_EQ(ReadFile(folder / "a"), "old");
  }
  EXPECT_EQ(ReadFile(folder / "a"), "old");
  EXPECT_EQ(NumFiles(folder), 1u);
  AtomicFile file(folder / "a");
  file.Write("n");
  file.Write("ew");
  file.Commit();
  EXPECT_EQ(ReadFile(folder / "a"), "new");
  EXPECT_EQ(NumFiles(folder), 1u);
}

TEST(File, TheNextWriterTakesWhatAKilledOneLeft) {
  const TempFolder folder;
  WriteFileAtomically(folder / "a", "old");
  const pid_t child = fork();
  if (child == 0) {
    AtomicFile file(folder / "a");
    file.Write(std::string(100000, 'x'));
    _exit(0);
  }
  ASSERT_EQ(waitpid(child, nullptr, 0), child);
  EXPECT_EQ(ReadFile(folder / "a"), "old");
  EXPECT_EQ(NumFiles(folder), 2u);
  WriteFileAtomically(folder / "a", "new");
  EXPECT_EQ(ReadFile(folder / "a"), "new");
  EXPECT_EQ(NumFiles(folder), 1u);
}

TEST(File, IsWholeHoweverManyWriteIt) {
  const TempFolder folder;
  const auto content = [](int writer) { return std::string(20000 + 1000 * writer, 'a' + writer); };
  {
    std::vector<std::jthread> writers;
    for (int writer = 0; writer < 4; ++writer) {
      writers.emplace_back([&, writer] {
        for (int k = 0; k < 100; ++k) WriteFileAtomically(folder / "a", content(writer));
      });
    }
    for (int k = 0; k < 200; ++k) {
      if (!std::filesystem::exists(folder / "a")) continue;
      const std::string read = ReadFile(folder / "a");
      ASSERT_EQ(read, content(read.at(0) - 'a'));
    }
  }
  EXPECT_EQ(NumFiles(folder), 1u);
}

TEST(File, NamesMayBeAsLongAsTheFileSystemAllows) {
  const TempFolder folder;
  const std::string path = folder / std::string(255, 'n');
  WriteFileAtomically(path, "x");
  EXPECT_EQ(ReadFile(path), "x");
}

TEST(File, LinksStayAndTheirTargetsAreWritten) {
  const TempFolder folder;
  WriteFileAtomically(folder / "target", "before");
  std::filesystem::create_symlink("target", folder / "link");
  WriteFileAtomically(folder / "link", "after");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  // Also where the target is not there yet.
  std::filesystem::create_symlink("absent", folder / "middle");
  std::filesystem::create_symlink("middle", folder / "dangling");
  EXPECT_EQ(BehindLinks(folder / "dangling"), folder / "absent");
  WriteFileAtomically(folder / "dangling", "new");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "dangling"));
  EXPECT_EQ(ReadFile(folder / "absent"), "new");

  EXPECT_EQ(ReadFile(folder / "target"), "after");
}

TEST(File, PipesAreWrittenNotReplaced) {
  const TempFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  const int reader = open((folder / "pipe").c_str(), O_RDONLY | O_NONBLOCK);
  WriteFileAtomically(folder / "pipe", "content");
  char content[8] = {};
  EXPECT_EQ(read(reader, content, sizeof(content)), 7);
  EXPECT_STREQ(content, "content");
  close(reader);
  EXPECT_TRUE(std::filesystem::is_fifo(folder / "pipe"));
  EXPECT_EQ(NumFiles(folder), 1u);
}

TEST(File, DatabasesAreNotReplaced) {
  const TempFolder folder;
  const std::string content = std::string("SQLite format 3\0", 16) + "pages";
  std::ofstream(folder / "scene.db", std::ios::binary) << content;
  EXPECT_THAT(ThrownMessage<IoError>([&] { WriteFileAtomically(folder / "scene.db", "a table"); }),
              HasSubstr("scene.db: is a database"));
  EXPECT_EQ(ReadFile(folder / "scene.db"), content);
}

TEST(File, ErrorsNameThePathAndTheReason) {
  const TempFolder folder;
  try {
    WriteFileAtomically(folder / "absent/a", "x");
    FAIL();
  } catch (const IoError& error) {
    EXPECT_EQ(error.path(), folder / "absent/a");
    EXPECT_THAT(error.reason(), HasSubstr("No such file or directory"));
  }
  EXPECT_THROW(ReadFile(folder / "absent"), IoError);
  EXPECT_THROW(ReadFile(folder.path()), IoError);
  EXPECT_THROW(WriteFileAtomically(folder.path(), "x"), IoError);  // a folder is in the way
  WriteFileAtomically(folder / "a", "x");
  EXPECT_THROW(CreateFolders(folder / "a"), IoError);
  EXPECT_THROW(CreateFolders(folder / "a/b"), IoError);
  CreateFolders(folder / "b/c");
  CreateFolders(folder / "b/c");
  EXPECT_EQ(NumFiles(folder), 2u);
}

TEST(File, ReadOnlyFolderIsAnError) {
  const TempFolder folder;
  ReadOnly(folder.path());
  EXPECT_THAT(ThrownMessage<IoError>([&] {
                const Unprivileged unprivileged;
                WriteFileAtomically(folder / "a", "x");
              }),
              HasSubstr("Permission denied"));
  std::filesystem::permissions(folder.path(), std::filesystem::perms::owner_all);
}

}  // namespace
}  // namespace cairn
