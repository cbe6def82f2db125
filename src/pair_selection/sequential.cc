#include <algorithm>
#include <filesystem>

#include "cairn/pair_selection/pair_selection.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// Digits from `begin` on, without leading zeros; `begin` moves behind them.
std::string_view Number(std::string_view name, size_t& begin) {
  const size_t first = std::min(name.find_first_not_of('0', begin), name.size());
  size_t end = begin;
  while (end < name.size() && IsDigit(name[end])) ++end;
  begin = end;
  return first < end ? name.substr(first, end - first) : std::string_view();
}

// By characters, where runs of digits compare as numbers; equal ones by the text itself.
bool ComesBefore(std::string_view a, std::string_view b) {
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!IsDigit(a[i]) || !IsDigit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    const std::string_view number1 = Number(a, i), number2 = Number(b, j);
    if (number1.size() != number2.size()) return number1.size() < number2.size();
    if (number1 != number2) return number1 < number2;
  }
  if ((i < a.size()) != (j < b.size())) return j < b.size();
  return a < b;
}

std::vector<std::vector<image_t>> SplitByFolder(const std::vector<Image>& ordered) {
  std::map<std::string, std::vector<image_t>> folders;
  for (const Image& image : ordered) {
    folders[std::filesystem::path(image.name).parent_path()].push_back(image.image_id);
  }
  std::vector<std::vector<image_t>> sequences;
  for (auto& [folder, images] : folders) sequences.push_back(std::move(images));
  return sequences;
}

}  // namespace

std::vector<std::vector<image_t>> SequencesByName(std::vector<Image> images) {
  std::ranges::sort(images, ComesBefore, &Image::name);
  return SplitByFolder(images);
}

std::vector<std::vector<image_t>> SequencesByTime(const std::vector<Image>& images,
                                                  const std::map<image_t, double>& taken_at_s) {
  std::vector<Image> ordered;
  for (const Image& image : images) {
    if (taken_at_s.contains(image.image_id)) ordered.push_back(image);
  }
  std::sort(ordered.begin(), ordered.end(), [&](const Image& a, const Image& b) {
    const double time1 = taken_at_s.at(a.image_id), time2 = taken_at_s.at(b.image_id);
    return time1 != time2 ? time1 < time2 : ComesBefore(a.name, b.name);
  });
  return SplitByFolder(ordered);
}

std::vector<image_pair_t> SequentialPairs(const std::vector<std::vector<image_t>>& sequences,
                                          int overlap, bool quadratic) {
  std::vector<image_pair_t> pairs;
  for (const std::vector<image_t>& images : sequences) {
    const size_t num = images.size();
    for (size_t i = 0; i < num; ++i) {
      const auto add = [&](size_t distance) {
        if (distance < num - i) pairs.push_back(ImagePairToPairId(images[i], images[i + distance]));
      };
      for (int k = 1; k <= overlap; ++k) add(static_cast<size_t>(k));
      if (!quadratic) continue;
      for (int k = 1; k <= overlap && (size_t{1} << k) < num; ++k) add(size_t{1} << k);
    }
  }
  return Unique(std::move(pairs));
}

}  // namespace cairn
