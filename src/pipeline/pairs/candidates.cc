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
// Candidates whose largest features are matched, for each neighbor that is chosen.
constexpr int kCandidatesPerNeighbor = 6;
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
    if (std::ssize(*keypoints) != descriptors->rows() || descriptors->cols() != 128) {
      throw IoError(database.path(), "the keypoints and descriptors of image " +
                                         std::to_string(id) + " do not fit together");
    }
    return ImageFeatures{std::move(*keypoints), std::move(*descriptors)};
  } catch (const IoError& error) {
    monitor.Warning(std::string(error.what()) + "; no photograph is found to look like it");
    return std::nullopt;
  }
}

FloatRows SampleAll(const Database& database, const std::vector<image_t>& images,
                    ProgressMonitor& monitor) {
  const int per_image = std::max(1, kMaxSamples / static_cast<int>(images.size()));
  const size_t step = std::max<size_t>(1, images.size() / kMaxSamples);
  std::vector<FloatRows> samples;
  Eigen::Index num_rows = 0;
  for (size_t i = 0; i < images.size() && !monitor.StopRequested(); i += step) {
    samples.push_back(SampleDescriptors(*database.ReadDescriptors(images[i]), per_image));
    num_rows += samples.back().rows();
  }
  FloatRows all(num_rows, 128);
  Eigen::Index row = 0;
  for (const FloatRows& rows : samples) {
    all.middleRows(row, rows.rows()) = rows;
    row += rows.rows();
  }
  return all;
}

// Images with features that can be read.
std::vector<image_t> ReadableImages(const Database& database, ProgressMonitor& monitor) {
  std::vector<image_t> images;
  for (const auto& [id, num] : database.ReadNumDescriptors()) {
    if (num > 0 && ReadFeatures(database, id, monitor)) images.push_back(id);
  }
  return images;
}

}  // namespace

std::map<image_t, std::vector<Candidate>> ReadCandidates(const Database& database,
                                                         const PairSelectionOptions& options,
                                                         int num_threads,
                                                         ProgressMonitor& monitor) {
  const std::vector<image_t> images = ReadableImages(database, monitor);
  if (images.empty()) return {};
  const FloatRows words =
      TrainWords(SampleAll(database, images, monitor), options.num_words, num_threads);
  FloatRows descriptions(static_cast<Eigen::Index>(images.size()), words.size());
  std::vector<PreparedDescriptors> largest(images.size(), PreparedDescriptors(Descriptors(0, 128)));
  monitor.BeginStage("describing photographs", std::ssize(images));
  for (size_t first = 0; first < images.size() && !monitor.StopRequested(); first += kBlock) {
    std::vector<ImageFeatures> block;
    for (size_t i = first; i < std::min(first + kBlock, images.size()); ++i) {
      block.push_back(*ReadFeatures(database, images[i], monitor));
    }
    ParallelFor(num_threads, std::ssize(block), [&](int64_t k) {
      const size_t i = first + static_cast<size_t>(k);
      descriptions.row(static_cast<Eigen::Index>(i)) = DescribeImage(block[k].descriptors, words);
      largest[i] = LargestFeatures(block[k].keypoints, block[k].descriptors, kNumLargest);
      monitor.Advance(1);
    });
  }
  monitor.EndStage();
  if (monitor.StopRequested()) return {};
  return FindCandidates(images, descriptions, largest,
                        kCandidatesPerNeighbor * options.retrieval_neighbors, num_threads);
}

}  // namespace cairn
