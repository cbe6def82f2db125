#include <algorithm>

#include "cairn/base/parallel.h"
#include "cairn/base/rng.h"
#include "cairn/pair_selection/pair_selection.h"

namespace cairn {
namespace {

constexpr int kNumIterations = 12;  // of k-means; the error changes by less than 1 % from then on
constexpr Eigen::Index kBlockRows = 1024;

Eigen::Index NumBlocks(Eigen::Index rows) { return (rows + kBlockRows - 1) / kBlockRows; }

// Unit vectors; zero stays.
void NormalizeRows(FloatRows& rows) {
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const float norm = rows.row(i).norm();
    if (norm > 0) rows.row(i) /= norm;
  }
}

// The nearest word of every row: the largest x.w - |w|^2 / 2; of equal ones the first.
std::vector<int> NearestWords(const Eigen::Ref<const FloatRows>& rows, const FloatRows& words) {
  const Eigen::RowVectorXf offsets = -0.5f * words.rowwise().squaredNorm().transpose();
  const FloatRows scores = (rows * words.transpose()).rowwise() + offsets;
  std::vector<int> nearest(static_cast<size_t>(rows.rows()));
  for (Eigen::Index i = 0; i < rows.rows(); ++i) scores.row(i).maxCoeff(&nearest[i]);
  return nearest;
}

// Sums and counts of the rows of each word, in one block.
struct WordSums {
  FloatRows sums;
  Eigen::VectorXf counts;
};

WordSums SumOfBlock(const Eigen::Ref<const FloatRows>& rows, const FloatRows& words) {
  WordSums result{FloatRows::Zero(words.rows(), words.cols()), Eigen::VectorXf::Zero(words.rows())};
  const std::vector<int> nearest = NearestWords(rows, words);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    result.sums.row(nearest[i]) += rows.row(i);
    result.counts(nearest[i]) += 1;
  }
  return result;
}

}  // namespace

FloatRows SampleDescriptors(const Descriptors& descriptors, int max_rows) {
  const Eigen::Index step =
      std::max<Eigen::Index>(1, (descriptors.rows() + max_rows - 1) / max_rows);
  FloatRows rows((descriptors.rows() + step - 1) / step, descriptors.cols());
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    rows.row(i) = descriptors.row(i * step).cast<float>();
  }
  NormalizeRows(rows);
  return rows;
}

FloatRows TrainWords(const FloatRows& samples, int num_words, int num_threads) {
  if (samples.rows() <= num_words) return samples;
  std::vector<Eigen::Index> order(static_cast<size_t>(samples.rows()));
  for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Eigen::Index>(i);
  Rng(0, "words").Shuffle(order);
  FloatRows words(num_words, samples.cols());
  for (int k = 0; k < num_words; ++k) words.row(k) = samples.row(order[k]);
  std::vector<WordSums> blocks(static_cast<size_t>(NumBlocks(samples.rows())));
  for (int iteration = 0; iteration < kNumIterations; ++iteration) {
    ParallelFor(num_threads, std::ssize(blocks), [&](int64_t b) {
      const Eigen::Index rows = std::min(kBlockRows, samples.rows() - b * kBlockRows);
      blocks[b] = SumOfBlock(samples.middleRows(b * kBlockRows, rows), words);
    });
    WordSums all = std::move(blocks[0]);
    for (size_t b = 1; b < blocks.size(); ++b) {
      all.sums += blocks[b].sums;
      all.counts += blocks[b].counts;
    }
    for (int k = 0; k < num_words; ++k) {
      if (all.counts(k) > 0) words.row(k) = all.sums.row(k) / all.counts(k);
    }
  }
  return words;
}

Eigen::RowVectorXf DescribeImage(const Descriptors& descriptors, const FloatRows& words) {
  FloatRows sums = FloatRows::Zero(words.rows(), words.cols());
  if (descriptors.rows() > 0 && words.rows() > 0) {
    const FloatRows rows = SampleDescriptors(descriptors, static_cast<int>(descriptors.rows()));
    const std::vector<int> nearest = NearestWords(rows, words);
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      const Eigen::RowVectorXf residual = rows.row(i) - words.row(nearest[i]);
      const float norm = residual.norm();
      if (norm > 0) sums.row(nearest[i]) += residual / norm;
    }
  }
  NormalizeRows(sums);
  Eigen::RowVectorXf description = Eigen::Map<const Eigen::RowVectorXf>(sums.data(), sums.size());
  const float norm = description.norm();
  if (norm > 0) description /= norm;
  return description;
}

}  // namespace cairn
