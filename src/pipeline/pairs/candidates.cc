#include "pipeline/pairs/candidates.h"

#include <algorithm>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"

namespace cairn {
namespace {

// Samples for the visual words, of all images together: 64 words have more than 1000 each.
constexpr int kMaxSamples = 100000;
// Features whose matches decide the order of candidates; a pair takes a 250th of the time of 8192.
constexpr int kNumLargest = 512;
// Images that are in memory at once.
constexpr size_t kBlock = 64;

struct ImageFeatures {
  std::vector<Keypoint> keypoints;
  Descriptors descriptors;
};

std::optional<ImageFeatures> ReadFeatures(const Database& database, image_t id,
                                          ProgressMonitor& monitor) {
  try {
    auto keypoints = database.ReadKeypoints(id);
    auto descriptors = database.ReadDescriptors(id);
    if (!keypoints || !descriptors) return std::nullopt;
    if (std::ssize(*keypoints) != descriptors->rows()) {
      throw IoError(database.path(), "the keypoints and descriptors of image " +
                                         std::to_string(id) + " do not fit together");
    }
    return ImageFeatures{std::move(*keypoints), std::move(*descriptors)};
  } catch (const IoError& error) {
    monitor.Warning(std::string(error.what()) + "; no photograph is found to look like it");
    return std::nullopt;
  }
}

// Descriptors of all images whose features can be read; these images are added to `images`.
FloatRows SampleAll(const Database& database, std::vector<image_t>& images,
                    ProgressMonitor& monitor) {
  const std::map<image_t, int> num_descriptors = database.ReadNumDescriptors();
  const int per_image =
      std::max(1, kMaxSamples / std::max(1, static_cast<int>(num_descriptors.size())));
  std::vector<FloatRows> samples;
  Eigen::Index num_rows = 0;
  for (const auto& [id, num] : num_descriptors) {
    if (monitor.StopRequested()) break;
    if (num == 0) continue;
    const std::optional<ImageFeatures> features = ReadFeatures(database, id, monitor);
    if (!features) continue;
    images.push_back(id);
    samples.push_back(SampleDescriptors(features->descriptors, per_image));
    num_rows += samples.back().rows();
  }
  FloatRows all(num_rows, kDescriptorSize);
  Eigen::Index row = 0;
  for (const FloatRows& rows : samples) {
    all.middleRows(row, rows.rows()) = rows;
    row += rows.rows();
  }
  return all;
}

}  // namespace

DescribedImages DescribeImages(const Database& database, const PairSelectionOptions& options,
                               const RunContext& run) {
  ProgressMonitor& monitor = run.monitor;
  std::vector<image_t> images;
  const FloatRows samples = SampleAll(database, images, monitor);
  if (images.empty() || monitor.StopRequested()) return {};
  const FloatRows words = TrainWords(samples, options.num_words, run.num_threads);
  FloatRows descriptions(static_cast<Eigen::Index>(images.size()), words.size());
  std::vector<Descriptors> largest(images.size(), Descriptors(0, kDescriptorSize));
  monitor.BeginStage("describing photographs", std::ssize(images));
  for (size_t first = 0; first < images.size() && !monitor.StopRequested(); first += kBlock) {
    std::vector<ImageFeatures> block;
    for (size_t i = first; i < std::min(first + kBlock, images.size()); ++i) {
      block.push_back(ReadFeatures(database, images[i], monitor)
                          .value_or(ImageFeatures{{}, Descriptors(0, kDescriptorSize)}));
    }
    ParallelFor(run.num_threads, std::ssize(block), [&](int64_t k) {
      const size_t i = first + static_cast<size_t>(k);
      descriptions.row(static_cast<Eigen::Index>(i)) = DescribeImage(block[k].descriptors, words);
      largest[i] = LargestFeatures(block[k].keypoints, block[k].descriptors, kNumLargest);
      monitor.Advance(1);
    });
  }
  monitor.EndStage();
  if (monitor.StopRequested()) return {};
  return {std::move(images), std::move(descriptions), std::move(largest)};
}

}  // namespace cairn
