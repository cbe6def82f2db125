#include "solvers/essential_kernels.h"

#include <algorithm>
#include <cmath>
#include <utility>

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solvers/essential_kernels.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd4d-inl.h"

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

// Rows from `first` on, of kWidth columns each, times I - v v^T from the left.
template <int kWidth>
HWY_INLINE void Reflect(const double* v, int first, int num_rows, double* rows) {
  constexpr int kNumVectors = kWidth / kLanes;
  V dots[kNumVectors];
  for (int k = 0; k < kNumVectors; ++k) dots[k] = Const(0.0);
  for (int i = first; i < num_rows; ++i) {
    for (int k = 0; k < kNumVectors; ++k) {
      dots[k] = dots[k] + Const(v[i]) * Load(rows + i * kWidth + k * kLanes);
    }
  }
  for (int i = first; i < num_rows; ++i) {
    for (int k = 0; k < kNumVectors; ++k) {
      double* p = rows + i * kWidth + k * kLanes;
      Store(Load(p) - dots[k] * Const(v[i]), p);
    }
  }
}

void ComplementKernel(int n, double* columns, double* basis) {
  constexpr int kRows = 9, kWidth = 8, kSteps = 5;
  double squared_norms[kWidth] = {};
  for (int i = 0; i < kRows; ++i) {
    for (int j = 0; j < kWidth; ++j) {
      squared_norms[j] += columns[kWidth * i + j] * columns[kWidth * i + j];
    }
  }
  double reflectors[kSteps][kRows] = {};  // v, with H = I - v v^T
  for (int k = 0; k < kSteps; ++k) {
    const auto pivot = std::max_element(squared_norms + k, squared_norms + n) - squared_norms;
    std::swap(squared_norms[k], squared_norms[pivot]);
    for (int i = 0; i < kRows; ++i) std::swap(columns[kWidth * i + k], columns[kWidth * i + pivot]);
    double* v = reflectors[k];
    double squared_norm = 0.0;
    for (int i = k; i < kRows; ++i) {
      v[i] = columns[kWidth * i + k];
      squared_norm += v[i] * v[i];
    }
    const double norm = std::sqrt(squared_norm);
    v[k] += std::copysign(norm, v[k]);
    // |v|^2 = 2 norm |v_k|.
    const double scale = norm > 0.0 ? 1.0 / std::sqrt(norm * std::abs(v[k])) : 0.0;
    for (int i = k; i < kRows; ++i) v[i] *= scale;
    Reflect<kWidth>(v, k, kRows, columns);
    for (int j = k + 1; j < kWidth; ++j) {
      squared_norms[j] -= columns[kWidth * k + j] * columns[kWidth * k + j];
    }
  }
  std::fill(basis, basis + 4 * kRows, 0.0);
  for (int j = 0; j < 4; ++j) basis[4 * (kSteps + j) + j] = 1.0;
  for (int k = kSteps - 1; k >= 0; --k) Reflect<4>(reflectors[k], k, kRows, basis);
}

// Polynomials in x, y, z of which some coefficients are vectors: linear (x y z 1), quadratic
// (x2 xy xz y2 yz z2 x y z 1), cubic (EssentialConstraints).

// out += factor a b.
template <class A>
HWY_INLINE void AddProduct(const A* a, const V* b, V factor, V* p) {
  p[0] = p[0] + factor * (a[0] * b[0]);
  p[1] = p[1] + factor * (a[0] * b[1] + a[1] * b[0]);
  p[2] = p[2] + factor * (a[0] * b[2] + a[2] * b[0]);
  p[3] = p[3] + factor * (a[1] * b[1]);
  p[4] = p[4] + factor * (a[1] * b[2] + a[2] * b[1]);
  p[5] = p[5] + factor * (a[2] * b[2]);
  p[6] = p[6] + factor * (a[0] * b[3] + a[3] * b[0]);
  p[7] = p[7] + factor * (a[1] * b[3] + a[3] * b[1]);
  p[8] = p[8] + factor * (a[2] * b[3] + a[3] * b[2]);
  p[9] = p[9] + factor * (a[3] * b[3]);
}

// c += p q.
HWY_INLINE void AddProduct(const V* p, const V* q, V* c) {
  c[0] = c[0] + p[0] * q[0];
  c[1] = c[1] + p[3] * q[1];
  c[2] = c[2] + (p[0] * q[1] + p[1] * q[0]);
  c[3] = c[3] + (p[1] * q[1] + p[3] * q[0]);
  c[4] = c[4] + (p[0] * q[2] + p[2] * q[0]);
  c[5] = c[5] + (p[0] * q[3] + p[6] * q[0]);
  c[6] = c[6] + (p[3] * q[2] + p[4] * q[1]);
  c[7] = c[7] + (p[3] * q[3] + p[7] * q[1]);
  c[8] = c[8] + (p[1] * q[2] + p[2] * q[1] + p[4] * q[0]);
  c[9] = c[9] + (p[1] * q[3] + p[6] * q[1] + p[7] * q[0]);
  c[10] = c[10] + (p[2] * q[2] + p[5] * q[0]);
  c[11] = c[11] + (p[2] * q[3] + p[6] * q[2] + p[8] * q[0]);
  c[12] = c[12] + (p[6] * q[3] + p[9] * q[0]);
  c[13] = c[13] + (p[4] * q[2] + p[5] * q[1]);
  c[14] = c[14] + (p[4] * q[3] + p[7] * q[2] + p[8] * q[1]);
  c[15] = c[15] + (p[7] * q[3] + p[9] * q[1]);
  c[16] = c[16] + p[5] * q[2];
  c[17] = c[17] + (p[5] * q[3] + p[8] * q[2]);
  c[18] = c[18] + (p[8] * q[3] + p[9] * q[2]);
  c[19] = c[19] + p[9] * q[3];
}

// A number for each of three columns or rows, and a fourth that is zero.
using Lanes = double[4];

// Entries of E = x X + y Y + W + z Z: of a row of E, of a column, and of a row from its second or
// third entry on (cyclically).
struct Entries {
  Lanes row[3][4], column[3][4], row_from[3][3][4];
};

Entries LoadEntries(const double* basis) {
  Entries E = {};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int m = 0; m < 4; ++m) {
        const double entry = basis[4 * (3 * i + j) + m];
        E.row[i][m][j] = entry;
        E.column[j][m][i] = entry;
        for (int from = 1; from < 3; ++from) E.row_from[from][i][m][(j - from + 3) % 3] = entry;
      }
    }
  }
  return E;
}

HWY_INLINE void LoadLinear(const Lanes* lanes, int first, V* linear) {
  for (int m = 0; m < 4; ++m) linear[m] = Load(lanes[m] + first);
}

// quadratic[m][j], and cubic[m][j] likewise.
using Quadratic = Lanes[10];
using Cubic = Lanes[20];

// Row i of E E^T.
HWY_INLINE void RowOfEEt(const Entries& E, int i, Quadratic* row) {
  for (int first = 0; first < 4; first += kLanes) {
    V sum[10];
    for (int m = 0; m < 10; ++m) sum[m] = Const(0.0);
    for (int k = 0; k < 3; ++k) {
      V a[4], b[4];
      for (int m = 0; m < 4; ++m) a[m] = Const(E.row[i][m][k]);
      LoadLinear(E.column[k], first, b);
      AddProduct(a, b, Const(1.0), sum);
    }
    for (int m = 0; m < 10; ++m) Store(sum[m], (*row)[m] + first);
  }
}

// The minors of the last two rows of E that go with the entries of the first.
HWY_INLINE void Minors(const Entries& E, Quadratic* minors) {
  for (int first = 0; first < 4; first += kLanes) {
    V sum[10];
    for (int m = 0; m < 10; ++m) sum[m] = Const(0.0);
    V a[4], b[4];
    LoadLinear(E.row_from[1][1], first, a);
    LoadLinear(E.row_from[2][2], first, b);
    AddProduct(a, b, Const(1.0), sum);
    LoadLinear(E.row_from[2][1], first, a);
    LoadLinear(E.row_from[1][2], first, b);
    AddProduct(a, b, Const(-1.0), sum);
    for (int m = 0; m < 10; ++m) Store(sum[m], (*minors)[m] + first);
  }
}

// Row i of (E E^T - tr(E E^T) / 2) E.
HWY_INLINE void RowOfCubics(const Quadratic& L, const Entries& E, Cubic* row) {
  for (int first = 0; first < 4; first += kLanes) {
    V sum[20];
    for (int m = 0; m < 20; ++m) sum[m] = Const(0.0);
    for (int k = 0; k < 3; ++k) {
      V p[10], q[4];
      for (int m = 0; m < 10; ++m) p[m] = Const(L[m][k]);
      LoadLinear(E.row[k], first, q);
      AddProduct(p, q, sum);
    }
    for (int m = 0; m < 20; ++m) Store(sum[m], (*row)[m] + first);
  }
}

void ConstraintsKernel(const double* basis, double* constraints) {
  const Entries E = LoadEntries(basis);
  Quadratic L[3];
  for (int i = 0; i < 3; ++i) RowOfEEt(E, i, &L[i]);
  for (int m = 0; m < 10; ++m) {
    const double half_trace = 0.5 * (L[0][m][0] + L[1][m][1] + L[2][m][2]);
    for (int i = 0; i < 3; ++i) L[i][m][i] -= half_trace;
  }
  Cubic cubic;
  for (int i = 0; i < 3; ++i) {
    RowOfCubics(L[i], E, &cubic);
    for (int j = 0; j < 3; ++j) {
      for (int m = 0; m < 20; ++m) constraints[20 * (3 * i + j) + m] = cubic[m][j];
    }
  }
  Quadratic minors;
  Minors(E, &minors);
  for (int first = 0; first < 4; first += kLanes) {
    V p[10], q[4], products[20];
    for (int m = 0; m < 10; ++m) p[m] = Load(minors[m] + first);
    LoadLinear(E.row[0], first, q);
    for (int m = 0; m < 20; ++m) products[m] = Const(0.0);
    AddProduct(p, q, products);
    for (int m = 0; m < 20; ++m) Store(products[m], cubic[m] + first);
  }
  for (int m = 0; m < 20; ++m) constraints[180 + m] = cubic[m][0] + cubic[m][1] + cubic[m][2];
}

bool EliminateKernel(double* constraints) {
  double* row[10];
  for (int i = 0; i < 10; ++i) row[i] = constraints + 20 * i;
  for (int i = 0; i < 10; ++i) {
    int pivot = i;
    for (int k = i + 1; k < 10; ++k) {
      if (std::abs(row[k][i]) > std::abs(row[pivot][i])) pivot = k;
    }
    if (std::abs(row[pivot][i]) < 1e-14) return false;
    std::swap(row[i], row[pivot]);
    // Nobody reads the columns before i + 1 again.
    const int first = (i + 1) / kLanes * kLanes;
    double factors[10];
    for (int k = i + 1; k < 10; ++k) factors[k] = row[k][i];
    const V inverse = Const(1.0 / row[i][i]);
    for (int j = first; j < 20; j += kLanes) {
      const V scaled = Load(row[i] + j) * inverse;
      Store(scaled, row[i] + j);
      for (int k = i + 1; k < 10; ++k) {
        Store(Load(row[k] + j) - Const(factors[k]) * scaled, row[k] + j);
      }
    }
  }
  double reduced[6][12];  // columns 8 to 19 of the last six rows
  for (int i = 4; i < 10; ++i) std::copy(row[i] + 8, row[i] + 20, reduced[i - 4]);
  for (int i = 9; i > 4; --i) {
    for (int k = 4; k < i; ++k) {
      const V factor = Const(row[k][i]);
      for (int j = 0; j < 12; j += kLanes) {
        double* p = reduced[k - 4] + j;
        Store(Load(p) - factor * Load(reduced[i - 4] + j), p);
      }
    }
  }
  for (int i = 4; i < 10; ++i) {
    std::copy(reduced[i - 4] + 2, reduced[i - 4] + 12, constraints + 20 * i + 10);
  }
  return true;
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {

HWY_EXPORT(ComplementKernel);
HWY_EXPORT(ConstraintsKernel);
HWY_EXPORT(EliminateKernel);

namespace internal {

void ComplementOfFive(int n, double* columns, double* basis) {
  HWY_DYNAMIC_DISPATCH(ComplementKernel)(n, columns, basis);
}

void EssentialConstraints(const double* basis, double* constraints) {
  HWY_DYNAMIC_DISPATCH(ConstraintsKernel)(basis, constraints);
}

bool EliminateConstraints(double* constraints) {
  return HWY_DYNAMIC_DISPATCH(EliminateKernel)(constraints);
}

}  // namespace internal
}  // namespace cairn
#endif
