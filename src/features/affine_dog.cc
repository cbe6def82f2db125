extern "C" {
#include <vl/covdet.h>
#include <vl/generic.h>
#include <vl/imopv.h>
#include <vl/sift.h>
}

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <new>
#include <tuple>

#include "features/extractors.h"
#include "features/root_sift.h"

namespace cairn {
namespace {

constexpr int kPatchResolution = 15;
constexpr int kPatchSide = 2 * kPatchResolution + 1;
constexpr double kPatchExtent = 7.5;  // 4 x 4 cells of 3 units, and half a cell around them
constexpr double kCellSize = 3.0;

using CovDet = std::unique_ptr<VlCovDet, void (*)(VlCovDet*)>;
using SiftFilter = std::unique_ptr<VlSiftFilt, void (*)(VlSiftFilt*)>;

// VLFeat writes to the memory that it asks for whether it was given any or not.
void* Given(void* memory) {
  if (!memory) throw std::bad_alloc();
  return memory;
}
void* Allocate(size_t num_bytes) { return Given(std::malloc(std::max<size_t>(1, num_bytes))); }
void* Reallocate(void* memory, size_t num_bytes) {
  return Given(std::realloc(memory, std::max<size_t>(1, num_bytes)));
}
void* AllocateZeros(size_t num, size_t size) {
  return Given(std::calloc(std::max<size_t>(1, num), std::max<size_t>(1, size)));
}
void LetVlFeatThrow() {
  static std::once_flag once;
  std::call_once(once, [] { vl_set_alloc_func(Allocate, Reallocate, AllocateZeros, std::free); });
}

bool LargerFrameFirst(const VlCovDetFeature& a, const VlCovDetFeature& b) {
  const auto key = [](const VlCovDetFeature& f) {
    return std::tuple(-f.frame.a11, -std::abs(f.peakScore), f.frame.y, f.frame.x);
  };
  return key(a) < key(b);
}

VlFrameOrientedEllipse Rotated(const VlFrameOrientedEllipse& frame, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  VlFrameOrientedEllipse rotated = frame;
  rotated.a11 = static_cast<float>(frame.a11 * c + frame.a12 * s);
  rotated.a21 = static_cast<float>(frame.a21 * c + frame.a22 * s);
  rotated.a12 = static_cast<float>(-frame.a11 * s + frame.a12 * c);
  rotated.a22 = static_cast<float>(-frame.a21 * s + frame.a22 * c);
  return rotated;
}

void Describe(VlCovDet* detector, VlSiftFilt* sift, const VlFrameOrientedEllipse& frame,
              uint8_t* descriptor) {
  float patch[kPatchSide * kPatchSide] = {};
  float gradient[2 * kPatchSide * kPatchSide];
  vl_covdet_extract_patch_for_frame(detector, patch, kPatchResolution, kPatchExtent, 1.0, frame);
  vl_imgradient_polar_f(gradient, gradient + 1, 2, 2 * kPatchSide, patch, kPatchSide, kPatchSide,
                        kPatchSide);
  float histogram[kSiftDim], reordered[kSiftDim];
  vl_sift_calc_raw_descriptor(sift, gradient, histogram, kPatchSide, kPatchSide, kPatchResolution,
                              kPatchResolution, kPatchResolution / (kCellSize * 2.5), 0);
  ReorderVlFeatBins(histogram, reordered);
  WriteRootSift(reordered, descriptor);
}

}  // namespace

Features ExtractAffineDog(const Bitmap& gray, const FeatureOptions& options) {
  Features features;
  features.descriptors.resize(0, kSiftDim);
  if (std::min(gray.width, gray.height) < 32) return features;
  std::vector<float> image(gray.data.size());
  std::transform(gray.data.begin(), gray.data.end(), image.begin(),
                 [](uint8_t value) { return value / 255.0f; });

  LetVlFeatThrow();
  const CovDet detector(vl_covdet_new(VL_COVDET_METHOD_DOG), &vl_covdet_delete);
  const SiftFilter sift(vl_sift_new(16, 16, 1, 3, 0), &vl_sift_delete);
  vl_sift_set_magnif(sift.get(), kCellSize);
  vl_covdet_set_first_octave(detector.get(), options.first_octave);
  vl_covdet_set_peak_threshold(detector.get(), options.peak_threshold);
  vl_covdet_set_edge_threshold(detector.get(), options.edge_threshold);
  vl_covdet_set_max_num_orientations(detector.get(), options.max_num_orientations);
  vl_covdet_set_non_extrema_suppression_threshold(detector.get(), 0);
  vl_covdet_put_image(detector.get(), image.data(), gray.width, gray.height);
  vl_covdet_detect(detector.get());

  const auto* found = static_cast<const VlCovDetFeature*>(vl_covdet_get_features(detector.get()));
  std::vector<VlCovDetFeature> detected(found, found + vl_covdet_get_num_features(detector.get()));
  std::sort(detected.begin(), detected.end(), LargerFrameFirst);

  std::vector<VlFrameOrientedEllipse> frames;
  for (const VlCovDetFeature& feature : detected) {
    if (frames.size() >= static_cast<size_t>(options.max_num_features)) break;
    VlFrameOrientedEllipse adapted;
    if (vl_covdet_extract_affine_shape_for_frame(detector.get(), &adapted, feature.frame) != 0) {
      continue;
    }
    if (options.estimate_upright) {
      frames.push_back(adapted);
      continue;
    }
    vl_size num_orientations = 0;
    const VlCovDetFeatureOrientation* orientations =
        vl_covdet_extract_orientations_for_frame(detector.get(), &num_orientations, adapted);
    for (vl_size i = 0; i < num_orientations; ++i) {
      frames.push_back(Rotated(adapted, orientations[i].angle));
    }
  }
  frames.resize(std::min(frames.size(), static_cast<size_t>(options.max_num_features)));
  features.descriptors.resize(frames.size(), kSiftDim);
  for (size_t i = 0; i < frames.size(); ++i) {
    const VlFrameOrientedEllipse& f = frames[i];
    Describe(detector.get(), sift.get(), f, features.descriptors.row(i).data());
    features.keypoints.push_back({f.x + 0.5f, f.y + 0.5f, f.a11, f.a12, f.a21, f.a22});
  }
  return features;
}

}  // namespace cairn
