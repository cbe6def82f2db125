#pragma once

namespace cairn::internal {

// The five-point solver's linear algebra over plain arrays (row-major), with the instruction set
// chosen at run time and the same bits with all.

// Four orthonormal vectors orthogonal to the five most important directions of the first n of eight
// columns, n >= 5 (all directions when n = 5), the others being zero: Householder reflections with
// column pivoting (Golub and Van Loan, 5.4). Columns of lower rank leave more than one such space;
// any is returned. columns: 9 x 8, lost. basis: 9 x 4.
void ComplementOfFive(int n, double* columns, double* basis);

// See EssentialConstraints in essential_constraints.h. basis: 9 x 4; constraints: 10 x 20.
void EssentialConstraints(const double* basis, double* constraints);

// Gaussian elimination with partial pivoting of 10 x 20 constraints, of which only the last six
// rows (those of the monomials x2z x2 y2z y2 xyz xy) are reduced fully, in the last ten columns.
// False if singular.
bool EliminateConstraints(double* constraints);

}  // namespace cairn::internal
