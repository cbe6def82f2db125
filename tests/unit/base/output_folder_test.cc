#include "base/output_folder.h"

#include <unistd.h>

#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

class OutputFolderTest : public ::testing::Test {
 protected:
  std::string At(const std::string& name) const { return path_ + "/" + name; }
  std::string Content(const std::string& name) const {
    return fs::exists(At(name)) ? ReadFile(At(name)) : "-";
  }
  static void Write(const OutputFolder& output, const std::string& name, const std::string& text) {
    CreateFolders(fs::path(output.staging() + "/" + name).parent_path().string());
    WriteFileAtomically(output.staging() + "/" + name, text);
  }
  void Run(const std::map<std::string, std::string>& files, bool overwrites = false,
           const std::string& within = "") {
    OutputFolder output(path_, "test", {"sparse", "report", "failed"}, overwrites);
    for (const auto& [name, text] : files) Write(output, name, text);
    output.Commit(within);
  }
  int NumEntries() const {
    return static_cast<int>(std::distance(fs::directory_iterator(path_), fs::directory_iterator()));
  }

  TempFolder temp_;
  const std::string path_ = temp_ / "out";
};

TEST_F(OutputFolderTest, ResultsReplaceThoseOfTheRunBefore) {
  Run({{"sparse/0/a", "1"}, {"sparse/1/a", "1"}, {"report", "1"}});
  EXPECT_EQ(Content("sparse/1/a"), "1");
  WriteFileAtomically(At("notes"), "mine");
  Run({{"sparse/0/a", "2"}, {"report", "2"}});
  EXPECT_EQ(Content("sparse/0/a"), "2");
  EXPECT_EQ(Content("report"), "2");
  EXPECT_FALSE(fs::exists(At("sparse/1")));
  EXPECT_EQ(Content("notes"), "mine");
  EXPECT_EQ(NumEntries(), 4);  // sparse, report, notes, .cairn-files
}

TEST_F(OutputFolderTest, NothingChangesWithoutCommit) {
  Run({{"report", "1"}});
  {
    OutputFolder output(path_, "test", {"sparse", "report"}, false);
    Write(output, "report", "2");
    Write(output, "sparse/0/a", "2");
  }
  EXPECT_EQ(Content("report"), "1");
  EXPECT_EQ(NumEntries(), 2);
}

TEST_F(OutputFolderTest, FilesOfOthersAreNotTouched) {
  CreateFolders(At("sparse/0"));
  WriteFileAtomically(At("sparse/0/a"), "COLMAP's");
  EXPECT_THAT(ThrownMessage<ConfigError>([&] {
                Run({{"report", "1"}});
              }),
              HasSubstr(At("sparse/0/a") + " is not as cairn wrote it"));
  EXPECT_EQ(Content("sparse/0/a"), "COLMAP's");
  EXPECT_EQ(NumEntries(), 1);
  Run({{"sparse/1/a", "1"}}, true);
  EXPECT_FALSE(fs::exists(At("sparse/0")));
  // Ours, until somebody changes it.
  Run({{"sparse/1/a", "2"}});
  WriteFileAtomically(At("sparse/1/a"), "refined");
  EXPECT_THAT(ThrownMessage<ConfigError>([&] {
                Run({{"sparse/1/a", "3"}});
              }),
              HasSubstr("--overwrite"));
  // A link is never ours: what it leads to may be anywhere.
  fs::remove(At("sparse/1/a"));
  WriteFileAtomically(At("elsewhere"), "2");
  fs::create_symlink("../../elsewhere", At("sparse/1/a"));
  EXPECT_THROW(Run({{"sparse/1/a", "3"}}), ConfigError);
  Run({{"sparse/1/a", "3"}}, true);
  EXPECT_EQ(Content("elsewhere"), "2");
  EXPECT_EQ(Content("sparse/1/a"), "3");
}

TEST_F(OutputFolderTest, AFolderIsOfOneCommand) {
  Run({{"report", "1"}});
  for (const bool overwrites : {false, true}) {
    EXPECT_THAT(
        ThrownMessage<ConfigError>([&] { OutputFolder(path_, "another", {"report"}, overwrites); }),
        HasSubstr(path_ + " holds the results of test, which would be lost; give another "
                          "--output_path"));
  }
  EXPECT_EQ(Content("report"), "1");
}

TEST_F(OutputFolderTest, AFolderWithinIsOfTheSameCommand) {
  Run({{"sparse/0/a", "1"}});
  for (const std::string within : {"sparse", "sparse/0", "sparse/0/"}) {
    EXPECT_THAT(
        ThrownMessage<ConfigError>([&] { OutputFolder(At(within), "another", {"a"}, true); }),
        HasSubstr("holds the results of test"));
  }
  OutputFolder(At("more"), "another", {"a"}, false);
}

TEST_F(OutputFolderTest, WhatACommandWritesAgainStaysAResult) {
  Run({{"report", "1"}, {"failed/report", "1"}});
  for (const std::string name : {"report", "failed/report", "notes"}) {
    WriteFileAtomically(At(name), "2");
    RecordRewritten(At(name));
  }
  Run({{"report", "3"}});
  EXPECT_EQ(Content("report"), "3");
  EXPECT_EQ(Content("notes"), "2");
  EXPECT_FALSE(fs::exists(At("failed")));
}

TEST_F(OutputFolderTest, AResultOfAnotherCommandIsNamed) {
  CheckNotOfAnother(path_, "export", {"report"});  // no such folder
  Run({{"report", "1"}});
  EXPECT_THAT(ThrownMessage<ConfigError>([&] {
                CheckNotOfAnother(path_, "export", {"sparse", "report"});
              }),
              HasSubstr("out/report is a result of test, which would be lost"));
  CheckNotOfAnother(path_, "export", {"sparse"});  // replaces nothing
  CheckNotOfAnother(path_, "test", {"report"});
}

TEST_F(OutputFolderTest, FilesThatComeDuringTheRunAreNotTouched) {
  OutputFolder output(path_, "test", {"report"}, false);
  Write(output, "report", "1");
  WriteFileAtomically(At("report"), "another's");
  EXPECT_THROW(output.Commit(), ConfigError);
  EXPECT_EQ(Content("report"), "another's");
}

TEST_F(OutputFolderTest, AFailedRunLeavesTheEarlierResults) {
  Run({{"sparse/0/a", "1"}, {"report", "1"}});
  Run({{"failed/report", "2"}, {"failed/sparse/0/a", "2"}}, false, "failed");
  EXPECT_EQ(Content("sparse/0/a"), "1");
  EXPECT_EQ(Content("report"), "1");
  EXPECT_EQ(Content("failed/report"), "2");
  Run({{"failed/report", "3"}}, false, "failed");
  EXPECT_EQ(Content("report"), "1");
  EXPECT_EQ(Content("failed/report"), "3");
  EXPECT_FALSE(fs::exists(At("failed/sparse")));  // of the run before
  Run({{"sparse/0/a", "3"}, {"report", "3"}});
  EXPECT_FALSE(fs::exists(At("failed")));
}

TEST_F(OutputFolderTest, AFailedRunLeavesWhatOthersWrote) {
  CreateFolders(At("sparse/0"));
  WriteFileAtomically(At("sparse/0/a"), "COLMAP's");
  Run({{"failed/report", "1"}}, true, "failed");
  EXPECT_EQ(Content("sparse/0/a"), "COLMAP's");
  EXPECT_EQ(Content("failed/report"), "1");
}

TEST_F(OutputFolderTest, RemainsOfAKilledRunAreRemoved) {
  Run({{"report", "1"}});
  CreateFolders(At(".cairn-new/sparse"));
  WriteFileAtomically(At(".cairn-new/sparse/half"), "x");
  Run({{"report", "2"}});
  EXPECT_EQ(Content("report"), "2");
  EXPECT_EQ(NumEntries(), 2);
}

// Killed at any step of putting the results in place: the next run finishes it.
TEST_F(OutputFolderTest, AnInterruptedCommitIsFinished) {
  for (int step = 0; step < 5; ++step) {
    fs::remove_all(path_);
    Run({{"sparse/0/a", "1"}, {"sparse/1/a", "1"}, {"report", "1"}});
    const std::string list_before = ReadFile(At(".cairn-files"));
    fs::copy(path_, temp_ / "before", fs::copy_options::recursive);
    Run({{"sparse/0/a", "2"}, {"report", "2"}});
    // The state between: results in the committed folder, the first `step` steps done.
    const std::string committed = At(".cairn-committed");
    CreateFolders(committed + "/sparse/0");
    fs::rename(At(".cairn-files"), committed + "/.cairn-files");
    WriteFileAtomically(committed + "/.cairn-remove", "sparse/1/a\n");
    WriteFileAtomically(At(".cairn-files"), list_before);
    if (step < 1) fs::copy(temp_ / "before/sparse/1", At("sparse/1"));
    if (step < 2) {
      fs::rename(At("report"), committed + "/report");
      WriteFileAtomically(At("report"), "1");
    }
    if (step < 3) {
      fs::rename(At("sparse/0/a"), committed + "/sparse/0/a");
      WriteFileAtomically(At("sparse/0/a"), "1");
    }
    if (step == 4) fs::rename(committed + "/.cairn-files", At(".cairn-files"));
    fs::remove_all(temp_ / "before");
    { const OutputFolder output(path_, "test", {"sparse", "report"}, false); }
    EXPECT_EQ(Content("sparse/0/a"), "2") << step;
    EXPECT_EQ(Content("report"), "2") << step;
    EXPECT_FALSE(fs::exists(At("sparse/1"))) << step;
    EXPECT_EQ(NumEntries(), 3) << step;
  }
}

TEST_F(OutputFolderTest, ALineOfTheListLeadsNowhereElse) {
  Run({{"report", "1"}});
  WriteFileAtomically(temp_ / "victim", "x");
  CreateFolders(At(".cairn-committed"));
  WriteFileAtomically(At(".cairn-committed/.cairn-files"),
                      "# written by: test\n0 ../victim\n0 /tmp/x\n");
  WriteFileAtomically(At(".cairn-committed/.cairn-remove"), "../victim\n");
  { const OutputFolder output(path_, "test", {"report"}, true); }
  EXPECT_EQ(ReadFile(temp_ / "victim"), "x");
}

// A line of a list would be another file's name.
TEST_F(OutputFolderTest, FilesWithALineBreakInTheirNameAreNotRemoved) {
  Run({{"report", "1"}});
  WriteFileAtomically(At("notes"), "mine");
  CreateFolders(At("sparse"));
  WriteFileAtomically(At("sparse/x\nnotes"), "mine");
  EXPECT_THAT(ThrownMessage<IoError>([&] {
                Run({{"report", "2"}}, true);
              }),
              ::testing::HasSubstr("line break"));
  EXPECT_EQ(Content("notes"), "mine");
  EXPECT_EQ(Content("report"), "1");
}

TEST_F(OutputFolderTest, OneRunWritesAtATime) {
  const OutputFolder output(path_, "test", {"report"}, false);
  EXPECT_THAT(ThrownMessage<IoError>([&] { OutputFolder(path_, "test", {"report"}, false); }),
              HasSubstr("another run"));
}

}  // namespace
}  // namespace cairn
