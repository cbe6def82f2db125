#include "features/plane_memory.h"

#include <sys/mman.h>

#include <algorithm>
#include <deque>
#include <mutex>
#include <new>

namespace cairn {
namespace {

constexpr size_t kLargePage = size_t{1} << 21;

struct Block {
  size_t num_bytes = 0;  // from the first large page on
  void* mapped = nullptr;
  float* first = nullptr;

  size_t MappedBytes() const { return num_bytes + kLargePage; }
};

Block Map(size_t num_bytes) {
  Block block{num_bytes};
  block.mapped = mmap(nullptr, block.MappedBytes(), PROT_READ | PROT_WRITE,
                      MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (block.mapped == MAP_FAILED) throw std::bad_alloc();
  void* first = block.mapped;
  size_t space = block.MappedBytes();
  block.first = static_cast<float*>(std::align(kLargePage, num_bytes, first, space));
  madvise(block.first, num_bytes, MADV_HUGEPAGE);  // where this fails, pages are small
  return block;
}

void Unmap(const Block& block) { munmap(block.mapped, block.MappedBytes()); }

// Blocks that wait for their next use, the longest first.
class WaitingBlocks {
 public:
  static WaitingBlocks& Get() {
    static WaitingBlocks& blocks = *new WaitingBlocks;
    return blocks;
  }

  Block Take(size_t num_bytes) {
    const std::lock_guard<std::mutex> lock(mutex_);
    num_used_ += num_bytes;
    max_used_ = std::max(max_used_, num_used_);
    const auto found = std::ranges::find(waiting_, num_bytes, &Block::num_bytes);
    if (found == waiting_.end()) {
      Shrink();
      return Map(num_bytes);
    }
    const Block block = *found;
    waiting_.erase(found);
    num_waiting_ -= num_bytes;
    return block;
  }

  void Give(const Block& block) {
    const std::lock_guard<std::mutex> lock(mutex_);
    num_used_ -= block.num_bytes;
    waiting_.push_back(block);
    num_waiting_ += block.num_bytes;
    Shrink();
  }

  void AddUsers(int change) {
    const std::lock_guard<std::mutex> lock(mutex_);
    num_users_ += change;
    max_used_ = num_used_;
    Shrink();
  }

 private:
  void Shrink() {
    while (!waiting_.empty() && (num_users_ == 0 || num_used_ + num_waiting_ > max_used_)) {
      Unmap(waiting_.front());
      num_waiting_ -= waiting_.front().num_bytes;
      waiting_.pop_front();
    }
  }

  std::mutex mutex_;
  int num_users_ = 0;  // PlaneReuse
  std::deque<Block> waiting_;
  size_t num_waiting_ = 0, num_used_ = 0, max_used_ = 0;  // bytes
};

}  // namespace

std::shared_ptr<float[]> AllocateFloats(size_t n) {
  const size_t num_bytes = (n * sizeof(float) + kLargePage - 1) / kLargePage * kLargePage;
  if (num_bytes <= kLargePage) return std::make_shared_for_overwrite<float[]>(n);
  const Block block = WaitingBlocks::Get().Take(num_bytes);
  return {block.first, [block](float*) { WaitingBlocks::Get().Give(block); }};
}

PlaneReuse::PlaneReuse() { WaitingBlocks::Get().AddUsers(1); }
PlaneReuse::~PlaneReuse() { WaitingBlocks::Get().AddUsers(-1); }

}  // namespace cairn
