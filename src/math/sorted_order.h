#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

namespace cairn {

// 0, 1, ..., size - 1 by rising key(i); those with equal keys stay in this order.
template <class Key>
std::vector<int> SortedOrder(size_t size, const Key& key) {
  std::vector<int> order(size);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  return order;
}

// Ascending, each once.
template <class T>
std::vector<T> Unique(std::vector<T> values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

// The place of a value in a sorted list that has it.
template <class T>
int IndexIn(const std::vector<T>& sorted, const T& value) {
  return static_cast<int>(std::lower_bound(sorted.begin(), sorted.end(), value) - sorted.begin());
}

}  // namespace cairn
