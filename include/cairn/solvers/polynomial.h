#pragma once

namespace cairn {

// Real roots of a polynomial c[0] + c[1] x + ... + c[degree] x^degree, degree <= 10, in increasing
// order, written to roots[0..count). Roots are isolated by Sturm's theorem and refined by Newton's
// method within their bracket. A root of even multiplicity may be missed. A vanishing leading
// coefficient lowers the degree. Returns the count (0 for a constant).
int RealRoots(const double* coefficients, int degree, double* roots);

}  // namespace cairn
