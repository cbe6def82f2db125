#pragma once

#include <memory>
#include <string>

#include "cairn/two_view/pair_verifier.h"

namespace cairn::bench {

// OpenCV's essential-matrix estimators behind our interface, as the rivals of a table, with the
// same threshold, confidence and largest number of iterations: "opencv_usac_accurate",
// "opencv_usac_magsac". Null for any other name.
std::unique_ptr<PairVerifier> MakeOpenCvVerifier(const std::string& name,
                                                 const TwoViewOptions& options);

}  // namespace cairn::bench
