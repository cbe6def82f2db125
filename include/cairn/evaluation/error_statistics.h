#pragma once

#include <vector>

namespace cairn {

// Area under the recall curve of `errors` up to `threshold`, as a share of the best possible, in
// [0, 1] (src/evaluation/README.md). An error may be infinite: never recalled. 0 for no errors.
double RecallAuc(std::vector<double> errors, double threshold);

// Middle element, or mean of the two; 0 if empty.
double Median(std::vector<double> values);

struct ErrorStatistics {
  double mean = 0;
  double median = 0;
  double standard_deviation = 0;  // divided by n
  int count = 0;
};
ErrorStatistics ComputeErrorStatistics(const std::vector<double>& errors);

}  // namespace cairn
