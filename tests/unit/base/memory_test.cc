#include "base/memory.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/control_groups.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

// Files of the kernel as some machine may have them.
class MachineTest : public ::testing::Test {
 protected:
  MachineTest() { Write("proc/meminfo", "MemTotal: 200 kB\nMemAvailable:  100 kB\n"); }

  void Write(const std::string& name, const std::string& text) {
    const std::filesystem::path path = folder_ / name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
  int64_t Available() const { return ReadMemoryUse(folder_.path()).available; }

  TempFolder folder_;
};

TEST_F(MachineTest, HasWhatTheKernelSaysWithoutAGroup) {
  EXPECT_EQ(Available(), 102400);
  Write("proc/self/cgroup", "0::/\n");
  EXPECT_EQ(Available(), 102400);
  Write("sys/fs/cgroup/memory.max", "max\n");
  Write("sys/fs/cgroup/memory.current", "5000\n");
  EXPECT_EQ(Available(), 102400);
}

TEST_F(MachineTest, PagesOfFilesInAGroupCanBeHad) {
  Write("proc/self/cgroup", "0::/\n");
  Write("sys/fs/cgroup/memory.max", "50000\n");
  Write("sys/fs/cgroup/memory.current", "49000\n");
  EXPECT_EQ(Available(), 1000);
  Write("sys/fs/cgroup/memory.stat",
        "anon 9000\nfile 40000\ninactive_file 30000\nactive_file 8000\n");
  EXPECT_EQ(Available(), 39000);
  Write("sys/fs/cgroup/memory.current", "51000\n");
  Write("sys/fs/cgroup/memory.stat", "anon 51000\n");
  EXPECT_EQ(Available(), 0);
}

TEST_F(MachineTest, TheTightestOfNestedGroupsCounts) {
  Write("proc/self/cgroup", "0::/slurm/job_7/step\n");
  Write("sys/fs/cgroup/slurm/job_7/step/memory.max", "max\n");
  Write("sys/fs/cgroup/slurm/job_7/step/memory.current", "10\n");
  Write("sys/fs/cgroup/slurm/job_7/memory.max", "20000\n");
  Write("sys/fs/cgroup/slurm/job_7/memory.current", "5000\n");
  Write("sys/fs/cgroup/slurm/memory.max", "90000\n");
  Write("sys/fs/cgroup/slurm/memory.current", "60000\n");
  EXPECT_EQ(Available(), 15000);
}

TEST_F(MachineTest, GroupsOfTheFirstVersion) {
  Write("proc/self/cgroup", "5:cpu,cpuacct:/\n4:memory:/jobs/a:b\n0::/\n");
  Write("sys/fs/cgroup/memory/jobs/a:b/memory.limit_in_bytes", "30000\n");
  Write("sys/fs/cgroup/memory/jobs/a:b/memory.usage_in_bytes", "25000\n");
  Write("sys/fs/cgroup/memory/jobs/a:b/memory.stat",
        "inactive_file 1\ntotal_inactive_file 4000\ntotal_active_file 3000\n");
  Write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  Write("sys/fs/cgroup/memory/memory.usage_in_bytes", "70000\n");
  EXPECT_EQ(Available(), 12000);
  // A container may see its own group as the outermost one.
  Write("proc/self/cgroup", "4:memory:/docker/1234\n");
  Write("sys/fs/cgroup/memory/memory.limit_in_bytes", "80000\n");
  EXPECT_EQ(Available(), 10000);
}

TEST_F(MachineTest, WhatIsNoGroupIsLeftAlone) {
  for (const char* text : {"", "4:memory:", "0::", "0::..", "0::relative\n", ":memory:\n", "\n"}) {
    Write("proc/self/cgroup", text);
    EXPECT_EQ(Available(), 102400) << text;
  }
}

TEST_F(MachineTest, HasTheProcessorsThatAGroupLeaves) {
  const int all = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  EXPECT_EQ(NumProcessors(folder_.path()), all);
  Write("proc/self/cgroup", "0::/kubepods/pod7\n");
  Write("sys/fs/cgroup/kubepods/pod7/cpu.max", "max 100000\n");
  EXPECT_EQ(NumProcessors(folder_.path()), all);
  Write("sys/fs/cgroup/kubepods/cpu.max", "50000 100000\n");
  EXPECT_EQ(NumProcessors(folder_.path()), 1);
  Write("sys/fs/cgroup/kubepods/cpu.max", "150000 100000\n");
  EXPECT_EQ(NumProcessors(folder_.path()), std::min(all, 2));
  Write("sys/fs/cgroup/kubepods/pod7/cpu.max", "1000 100000\n");
  EXPECT_EQ(NumProcessors(folder_.path()), 1);
}

TEST_F(MachineTest, HasTheProcessorsThatAGroupOfTheFirstVersionLeaves) {
  const int all = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  Write("proc/self/cgroup", "5:cpu,cpuacct:/docker/1234\n4:memory:/\n0::/\n");
  Write("sys/fs/cgroup/cpu/cpu.cfs_quota_us", "-1\n");
  Write("sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(NumProcessors(folder_.path()), all);
  Write("sys/fs/cgroup/cpu/cpu.cfs_quota_us", "100000\n");
  EXPECT_EQ(NumProcessors(folder_.path()), 1);
}

}  // namespace
}  // namespace cairn
