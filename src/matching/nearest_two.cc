// Compiled once for each SIMD target; the best one is chosen at run time.
#define HWY_WANT_AVX3_DL
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "matching/nearest_two.cc"  // this file
#include <hwy/foreach_target.h>
// clang-format off
#include <hwy/highway.h>
// clang-format on

#include <hwy/aligned_allocator.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <numeric>

#include "cairn/base/check.h"
#include "matching/nearest_two.h"

HWY_BEFORE_NAMESPACE();
#if HWY_TARGET == HWY_AVX3_DL
#pragma GCC target("avx512vnni")  // Highway 1.0.3 requires it at run time but does not enable it.
#endif
namespace cairn {
namespace HWY_NAMESPACE {
namespace {
namespace hn = hwy::HWY_NAMESPACE;

// The dot products of a tile of rows x columns stay in registers. Lanes are columns: one word of a
// row (some of its elements) is broadcast and multiplied with that word of a vector of columns.
using D = hn::ScalableTag<int32_t>;
using V = hn::Vec<D>;
constexpr int kDim = kDescriptorSize;
constexpr int kTileVectors = 2;
#if HWY_TARGET <= HWY_AVX3
constexpr int kTileRows = 12;  // 24 of 32 registers accumulate
#else
constexpr int kTileRows = 6;  // 12 of 16
#endif
constexpr int kVectorsPerBlock = 16;  // of columns, packed together; stay in the first-level cache
constexpr int32_t kFar = 1 << 30;     // larger than any distance, 2 * 128 * 255^2
constexpr int32_t kPaddingNorm = 1 << 28;  // makes padded rows and columns farther than real ones

// Clang knows no such pragma as above.
#if HWY_TARGET == HWY_AVX3_DL && !HWY_COMPILER_CLANG
// Four unsigned column elements times four signed row elements (minus 128) a lane, by VNNI. The
// shift is undone by the columns' offsets: (r - 128) . c = r . c - 128 sum(c).
constexpr int kWords = kDim / 4;
constexpr int kRowShift = 128;
int32_t ColumnWord(const uint8_t* descriptor, int k) {
  int32_t word;
  std::memcpy(&word, descriptor + 4 * k, 4);
  return word;
}
int32_t RowWord(const uint8_t* descriptor, int k) {
  return static_cast<int32_t>(static_cast<uint32_t>(ColumnWord(descriptor, k)) ^ 0x80808080u);
}
HWY_INLINE V AddProducts(V sum, V columns, V row) {
  return V{_mm512_dpbusd_epi32(sum.raw, columns.raw, row.raw)};
}
#elif HWY_TARGET <= HWY_SSSE3
// Two 16-bit elements a lane.
constexpr int kWords = kDim / 2;
constexpr int kRowShift = 0;
int32_t RowWord(const uint8_t* descriptor, int k) {
  return descriptor[2 * k] | descriptor[2 * k + 1] << 16;
}
int32_t ColumnWord(const uint8_t* descriptor, int k) { return RowWord(descriptor, k); }
HWY_INLINE V AddProducts(V sum, V columns, V row) {
  const hn::Repartition<int16_t, D> d16;
  V unused = hn::Zero(D());
  return hn::ReorderWidenMulAccumulate(D(), hn::BitCast(d16, columns), hn::BitCast(d16, row), sum,
                                       unused);
}
#else
// One element a lane.
constexpr int kWords = kDim;
constexpr int kRowShift = 0;
int32_t RowWord(const uint8_t* descriptor, int k) { return descriptor[k]; }
int32_t ColumnWord(const uint8_t* descriptor, int k) { return descriptor[k]; }
HWY_INLINE V AddProducts(V sum, V columns, V row) { return hn::Add(sum, hn::Mul(columns, row)); }
#endif

using Buffer = hwy::AlignedFreeUniquePtr<int32_t[]>;

Buffer Allocate(size_t size) {
  Buffer buffer = hwy::AllocateAligned<int32_t>(size);
  if (!buffer) throw std::bad_alloc();
  return buffer;
}

// All rows as words, padded to whole tiles; their squared norms; and, lane by lane, the two
// smallest distances so far.
struct Rows {
  int num_padded = 0;
  Buffer words;                // num_padded x kWords
  std::vector<int32_t> norms;  // num_padded
  Buffer best, second;         // num_padded x lanes
};

// A block of columns: words interleaved for vector loads; per column what is added to -2 times the
// product of words to give the distance less the row's norm; the two smallest distances so far, and
// the nearest row.
struct ColumnBlock {
  Buffer words;                         // vectors x kWords x lanes
  Buffer offsets, best, second, index;  // vectors x lanes
};

int Num(const Descriptors& descriptors) { return static_cast<int>(descriptors.rows()); }

int32_t SquaredNorm(const uint8_t* descriptor) {
  int32_t sum = 0;
  for (int k = 0; k < kDim; ++k) sum += descriptor[k] * descriptor[k];
  return sum;
}

Rows PackRows(const Descriptors& descriptors) {
  Rows rows;
  const int lanes = static_cast<int>(hn::Lanes(D()));
  rows.num_padded = (Num(descriptors) + kTileRows - 1) / kTileRows * kTileRows;
  rows.words = Allocate(static_cast<size_t>(rows.num_padded) * kWords);
  rows.norms.assign(rows.num_padded, kPaddingNorm);
  std::fill_n(rows.words.get(), static_cast<size_t>(rows.num_padded) * kWords, 0);
  for (int i = 0; i < Num(descriptors); ++i) {
    int32_t* words = rows.words.get() + static_cast<size_t>(i) * kWords;
    const uint8_t* descriptor = descriptors.row(i).data();
    for (int k = 0; k < kWords; ++k) words[k] = RowWord(descriptor, k);
    rows.norms[i] = SquaredNorm(descriptor);
  }
  for (Buffer* buffer : {&rows.best, &rows.second}) {
    const size_t size = static_cast<size_t>(rows.num_padded) * lanes;
    *buffer = Allocate(size);
    std::fill_n(buffer->get(), size, kFar);
  }
  return rows;
}

// Columns first .. first + vectors * lanes; those past the end are padding.
void PackColumns(const Descriptors& descriptors, int first, int vectors, ColumnBlock* block) {
  const int lanes = static_cast<int>(hn::Lanes(D()));
  for (int j = 0; j < vectors * lanes; ++j) {
    int32_t* words = block->words.get() + j / lanes * kWords * lanes + j % lanes;
    const bool real = first + j < Num(descriptors);
    const uint8_t* descriptor = real ? descriptors.row(first + j).data() : nullptr;
    for (int k = 0; k < kWords; ++k) words[k * lanes] = real ? ColumnWord(descriptor, k) : 0;
    int32_t offset = real ? SquaredNorm(descriptor) : kPaddingNorm;
    if (kRowShift != 0 && real) {
      offset -= 2 * kRowShift * std::accumulate(descriptor, descriptor + kDim, 0);
    }
    block->offsets[j] = offset;
    block->best[j] = block->second[j] = kFar;
    block->index[j] = -1;
  }
}

// Inner products of the descriptors of a tile.
HWY_INLINE void SumProducts(const int32_t* HWY_RESTRICT row_words,
                            const int32_t* HWY_RESTRICT words, V (&sums)[kTileRows][kTileVectors]) {
  const D d;
  const int lanes = static_cast<int>(hn::Lanes(d));
#pragma GCC unroll 16
  for (int r = 0; r < kTileRows; ++r) {
#pragma GCC unroll 4
    for (int v = 0; v < kTileVectors; ++v) sums[r][v] = hn::Zero(d);
  }
  for (int k = 0; k < kWords; ++k) {
    V column[kTileVectors];
#pragma GCC unroll 4
    for (int v = 0; v < kTileVectors; ++v) {
      column[v] = hn::Load(d, words + (v * kWords + k) * lanes);
    }
#pragma GCC unroll 16
    for (int r = 0; r < kTileRows; ++r) {
      const V element = hn::Set(d, row_words[r * kWords + k]);
#pragma GCC unroll 4
      for (int v = 0; v < kTileVectors; ++v) {
        sums[r][v] = AddProducts(sums[r][v], column[v], element);
      }
    }
  }
}

HWY_INLINE void ProcessTile(const Rows& rows, int row, const ColumnBlock& block, int vector) {
  const D d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const int column_state = vector * lanes;
  V sums[kTileRows][kTileVectors];
  SumProducts(rows.words.get() + static_cast<size_t>(row) * kWords,
              block.words.get() + vector * kWords * lanes, sums);
  V offset[kTileVectors], best[kTileVectors], second[kTileVectors], index[kTileVectors];
#pragma GCC unroll 4
  for (int v = 0; v < kTileVectors; ++v) {
    offset[v] = hn::Load(d, block.offsets.get() + column_state + v * lanes);
    best[v] = hn::Load(d, block.best.get() + column_state + v * lanes);
    second[v] = hn::Load(d, block.second.get() + column_state + v * lanes);
    index[v] = hn::Load(d, block.index.get() + column_state + v * lanes);
  }
#pragma GCC unroll 16
  for (int r = 0; r < kTileRows; ++r) {
    const V norm = hn::Set(d, rows.norms[row + r]);
    const V row_index = hn::Set(d, row + r);
    const size_t state = static_cast<size_t>(row + r) * lanes;
    V row_best = hn::Load(d, rows.best.get() + state);
    V row_second = hn::Load(d, rows.second.get() + state);
#pragma GCC unroll 4
    for (int v = 0; v < kTileVectors; ++v) {
      const V distance = hn::Sub(hn::Add(offset[v], norm), hn::Add(sums[r][v], sums[r][v]));
      const auto nearer = hn::Lt(distance, best[v]);
      second[v] = hn::Min(second[v], hn::Max(best[v], distance));
      best[v] = hn::Min(best[v], distance);
      index[v] = hn::IfThenElse(nearer, row_index, index[v]);
      row_second = hn::Min(row_second, hn::Max(row_best, distance));
      row_best = hn::Min(row_best, distance);
    }
    hn::Store(row_best, d, rows.best.get() + state);
    hn::Store(row_second, d, rows.second.get() + state);
  }
#pragma GCC unroll 4
  for (int v = 0; v < kTileVectors; ++v) {
    hn::Store(best[v], d, block.best.get() + column_state + v * lanes);
    hn::Store(second[v], d, block.second.get() + column_state + v * lanes);
    hn::Store(index[v], d, block.index.get() + column_state + v * lanes);
  }
}

NearestTwo MakeNearest(int32_t best, int32_t second, int32_t index) {
  constexpr int32_t kPadding = kPaddingNorm / 2;  // Nothing real is so far.
  NearestTwo nearest;
  if (best < kPadding) {
    nearest.best = best;
    nearest.index = index;
  }
  if (second < kPadding) nearest.second = second;
  return nearest;
}

void FinishColumns(const ColumnBlock& block, int first, int num_columns,
                   std::vector<NearestTwo>* neighbors) {
  const int end = std::min(first + num_columns, static_cast<int>(neighbors->size()));
  for (int j = first; j < end; ++j) {
    const int i = j - first;
    (*neighbors)[j] = MakeNearest(block.best[i], block.second[i], block.index[i]);
  }
}

// The two smallest of a row over its lanes.
void FinishRows(const Rows& rows, std::vector<NearestTwo>* neighbors) {
  const int lanes = static_cast<int>(hn::Lanes(D()));
  for (size_t i = 0; i < neighbors->size(); ++i) {
    int32_t best = kFar, second = kFar;
    for (int lane = 0; lane < lanes; ++lane) {
      const int32_t lane_best = rows.best[i * lanes + lane];
      second = std::min({second, std::max(best, lane_best), rows.second[i * lanes + lane]});
      best = std::min(best, lane_best);
    }
    (*neighbors)[i] = MakeNearest(best, second, -1);
  }
}

void FindNearestTwoImpl(const Descriptors& row_descriptors, const Descriptors& column_descriptors,
                        std::vector<NearestTwo>* column_neighbors,
                        std::vector<NearestTwo>* row_neighbors) {
  const int lanes = static_cast<int>(hn::Lanes(D()));
  const Rows rows = PackRows(row_descriptors);
  ColumnBlock block;
  block.words = Allocate(kVectorsPerBlock * kWords * lanes);
  for (Buffer* buffer : {&block.offsets, &block.best, &block.second, &block.index}) {
    *buffer = Allocate(kVectorsPerBlock * lanes);
  }
  const int columns_per_tile = kTileVectors * lanes;
  for (int first = 0; first < Num(column_descriptors); first += kVectorsPerBlock * lanes) {
    const int left = Num(column_descriptors) - first;
    const int tiles = (left + columns_per_tile - 1) / columns_per_tile;
    const int vectors = std::min(kVectorsPerBlock, tiles * kTileVectors);
    PackColumns(column_descriptors, first, vectors, &block);
    for (int row = 0; row < rows.num_padded; row += kTileRows) {
      for (int v = 0; v < vectors; v += kTileVectors) ProcessTile(rows, row, block, v);
    }
    FinishColumns(block, first, vectors * lanes, column_neighbors);
  }
  FinishRows(rows, row_neighbors);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace cairn
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {

HWY_EXPORT(FindNearestTwoImpl);

void FindNearestTwo(const Descriptors& rows, const Descriptors& columns,
                    std::vector<NearestTwo>* column_neighbors,
                    std::vector<NearestTwo>* row_neighbors) {
  for (const Descriptors* descriptors : {&rows, &columns}) {
    CAIRN_CHECK(descriptors->cols() == kDescriptorSize || descriptors->rows() == 0);
  }
  column_neighbors->assign(columns.rows(), {});
  row_neighbors->assign(rows.rows(), {});
  if (rows.rows() == 0 || columns.rows() == 0) return;
  HWY_DYNAMIC_DISPATCH(FindNearestTwoImpl)(rows, columns, column_neighbors, row_neighbors);
}

}  // namespace cairn
#endif  // HWY_ONCE
