#pragma once

namespace cairn::internal {

// Another observation of a point. Where the point is eliminated, the block of the two images loses
// J^T (M C): J and C are the observations' derivatives by the unknowns of their images, M is of
// both.
struct SchurPartner {
  double M[4];     // 2 x 2, row-major
  const float* C;  // 2 x kBlock, row-major
  double* block;   // kBlock x kBlock, row-major
};

// block -= J^T (M C) for each partner of the observation that J (2 x kBlock, row-major) is of, for
// a kBlock of 10, 14 or 22. The instruction set is chosen at run time (Google Highway), and every
// one gives the same bits.
void SubtractFromBlocks(int block_size, const double* J, const SchurPartner* partners,
                        int num_partners);

}  // namespace cairn::internal
