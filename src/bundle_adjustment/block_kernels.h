#pragma once

namespace cairn {

// block -= J^T M L in double precision, where most of the time of forming the cameras' system goes.
// J: 2 x kSize, M: 2 x 2, L: 2 x kSize, block: kSize x kSize; all row by row. kSize: 4, 12 or 24.
template <int kSize>
void SubtractProduct(const float* J, const double* M, const float* L, double* block);

}  // namespace cairn
