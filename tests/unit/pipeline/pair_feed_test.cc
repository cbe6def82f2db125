#include <algorithm>
#include <atomic>
#include <set>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "pipeline/pairs/feed.h"
#include "support/test.h"

namespace cairn {
namespace {

std::vector<PairTile> Plan(int num_images, int64_t max_images) {
  std::vector<image_pair_t> pairs;
  std::map<image_t, int64_t> image_bytes;
  for (image_t i = 1; i <= static_cast<image_t>(num_images); ++i) {
    image_bytes[i] = 1;
    for (image_t j = i + 1; j <= static_cast<image_t>(num_images); ++j) {
      pairs.push_back(ImagePairToPairId(i, j));
    }
  }
  return PlanPairTiles(pairs, image_bytes, max_images);
}

PairImage ImageWithId(image_t id) {
  PairImage image;
  image.content_hash = id;
  return image;
}

bool LoadBoth(PairTask& task, const std::function<PairFeed::ImagePtr(image_t)>& image) {
  const auto [id1, id2] = PairIdToImagePair(task.pair_id);
  task.image1 = image(id1);
  task.image2 = image(id2);
  return true;
}

TEST(PairFeed, GivesEveryTaskOnceToManyThreads) {
  std::atomic<int> num_loads = 0;
  PairFeed feed(
      Plan(30, 10),
      [&](image_t id) {
        ++num_loads;
        return ImageWithId(id);
      },
      LoadBoth, 1000);
  std::mutex mutex;
  std::set<image_pair_t> seen;
  ParallelFor(8, 30 * 29 / 2, [&](int64_t) {
    const std::optional<PairTask> task = feed.Next();
    ASSERT_TRUE(task);
    const auto [id1, id2] = PairIdToImagePair(task->pair_id);
    EXPECT_EQ(task->image1->content_hash, id1);
    EXPECT_EQ(task->image2->content_hash, id2);
    const std::lock_guard<std::mutex> lock(mutex);
    EXPECT_TRUE(seen.insert(task->pair_id).second);
  });
  EXPECT_FALSE(feed.Next());
  EXPECT_EQ(seen.size(), 30u * 29 / 2);
  EXPECT_LE(num_loads, 5 * (1 + 20 + 5));  // 6 groups of 5 images, 21 tiles in serpentine order.
}

TEST(PairFeed, LeavesOutWhatLoadPairRefuses) {
  PairFeed feed(
      Plan(10, 100), ImageWithId,
      [](PairTask& task, const auto& image) {
        return task.pair_id % 2 == 0 && LoadBoth(task, image);
      },
      1000);
  int num_tasks = 0;
  while (const std::optional<PairTask> task = feed.Next()) {
    EXPECT_EQ(task->pair_id % 2, 0u);
    ++num_tasks;
  }
  EXPECT_GT(num_tasks, 10);
  EXPECT_LT(num_tasks, 45);
}

TEST(PairFeed, WaitsWhenTheQueueIsFull) {
  std::atomic<int> num_read = 0;
  PairFeed feed(
      Plan(40, 100), ImageWithId,
      [&](PairTask& task, const auto&) {
        ++num_read;
        task.matches.resize(100);
        return true;
      },
      10000);  // About 10 tasks of 928 bytes.
  while (num_read < 10) std::this_thread::yield();
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_LE(num_read, 12);
  while (feed.Next()) {
  }
  EXPECT_EQ(num_read, 780);
}

TEST(PairFeed, ThrowsWhatReadingThrew) {
  PairFeed feed(
      Plan(10, 100),
      [](image_t id) -> PairImage {
        if (id == 7) throw IoError("scene.db", "broken");
        return ImageWithId(id);
      },
      LoadBoth, 1000);
  EXPECT_THROW(
      {
        while (feed.Next()) {
        }
      },
      IoError);
  EXPECT_THROW(feed.Next(), IoError);  // Every thread hears of it.
}

TEST(PairFeed, StopsAtOnce) {
  PairFeed feed(Plan(40, 100), ImageWithId, LoadBoth, 1000);
  ASSERT_TRUE(feed.Next());
  feed.Stop();
  EXPECT_FALSE(feed.Next());
}

TEST(PairFeed, CanBeDestroyedWhileReading) {
  PairFeed feed(Plan(40, 100), ImageWithId, LoadBoth, 1000);
  EXPECT_TRUE(feed.Next());
}

}  // namespace
}  // namespace cairn
