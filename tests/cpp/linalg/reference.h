// The definition of every block operation, in plain loops. The kernels must give the same bits.
//
// Each output element is one chain of fma(-a, b, c); the order of its terms is the order in which
// the loops below reach it.
#pragma once

#include <cmath>
#include <vector>

namespace trajopt::reference {

template <class T>
using MatrixOf = std::vector<T>;  // row-major, no padding
using Matrix = MatrixOf<double>;

// A = Wt D W from the last row to the first, W unit lower triangular: on return the strict lower
// triangle of `a` is W and `inverse` the diagonal of D^-1. Couplings s (size x size) become
// V = D^-1 W^-T s, their unscaled U = W^-T s goes to u.
template <class T>
inline void eliminate(int size, MatrixOf<T>& a, MatrixOf<T>& inverse, std::vector<MatrixOf<T>>& s,
                      std::vector<MatrixOf<T>>& u, const signed char* signs, T regularization) {
  MatrixOf<T> unscaled = a;
  for (int q = size - 1; q >= 0; --q) {
    inverse[q] = T(1) / (unscaled[q * size + q] + (signs ? signs[q] : T(1)) * regularization);
    for (int i = q - 1; i >= 0; --i) {
      const T w = a[q * size + i] = unscaled[q * size + i] * inverse[q];
      for (int j = 0; j <= i; ++j) {
        unscaled[i * size + j] = std::fma(-w, unscaled[q * size + j], unscaled[i * size + j]);
      }
      for (MatrixOf<T>& c : s) {
        for (int j = 0; j < size; ++j)
          c[i * size + j] = std::fma(-w, c[q * size + j], c[i * size + j]);
      }
    }
  }
  u = s;
  for (MatrixOf<T>& c : s) {
    for (int k = 0; k < size; ++k) {
      for (int j = 0; j < size; ++j) c[k * size + j] *= inverse[k];
    }
  }
}

// target = source - Vt U.
template <class T>
inline void update(int size, const MatrixOf<T>& source, MatrixOf<T>& target, const MatrixOf<T>& v,
                   const MatrixOf<T>& u) {
  target = source;
  for (int k = size - 1; k >= 0; --k) {
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) {
        T& t = target[i * size + j];
        t = std::fma(-v[k * size + i], u[k * size + j], t);
      }
    }
  }
}

// x = W^-T x.
template <class T>
inline void substitute_transposed(int size, const MatrixOf<T>& w, MatrixOf<T>& x, int m) {
  for (int k = size - 1; k > 0; --k) {
    for (int i = 0; i < k; ++i) {
      for (int j = 0; j < m; ++j)
        x[i * m + j] = std::fma(-w[k * size + i], x[k * m + j], x[i * m + j]);
    }
  }
}

// x = W^-1 x.
template <class T>
inline void substitute(int size, const MatrixOf<T>& w, MatrixOf<T>& x, int m) {
  for (int k = 0; k + 1 < size; ++k) {
    for (int i = k + 1; i < size; ++i) {
      for (int j = 0; j < m; ++j)
        x[i * m + j] = std::fma(-w[i * size + k], x[k * m + j], x[i * m + j]);
    }
  }
}

// Row k of x times d[k].
template <class T>
inline void scale(int size, const MatrixOf<T>& d, MatrixOf<T>& x, int m) {
  for (int k = 0; k < size; ++k) {
    for (int j = 0; j < m; ++j) x[k * m + j] *= d[k];
  }
}

// y -= Vt x for rows x columns V.
template <class T>
inline void subtract_transposed(int rows, int columns, const MatrixOf<T>& v, const MatrixOf<T>& x,
                                MatrixOf<T>& y, int m) {
  for (int k = rows - 1; k >= 0; --k) {
    for (int i = 0; i < columns; ++i) {
      for (int j = 0; j < m; ++j) {
        y[i * m + j] = std::fma(-v[k * columns + i], x[k * m + j], y[i * m + j]);
      }
    }
  }
}

// y -= V x for rows x columns V.
template <class T>
inline void subtract(int rows, int columns, const MatrixOf<T>& v, const MatrixOf<T>& x,
                     MatrixOf<T>& y, int m) {
  for (int k = 0; k < columns; ++k) {
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < m; ++j) {
        y[i * m + j] = std::fma(-v[i * columns + k], x[k * m + j], y[i * m + j]);
      }
    }
  }
}

// y -= A x with the lower triangle of A.
template <class T>
inline void subtract_symmetric(int size, const MatrixOf<T>& a, const MatrixOf<T>& x, MatrixOf<T>& y,
                               int m) {
  for (int k = 0; k < size; ++k) {
    for (int i = 0; i < size; ++i) {
      const T s = i >= k ? a[i * size + k] : a[k * size + i];
      for (int j = 0; j < m; ++j) y[i * m + j] = std::fma(-s, x[k * m + j], y[i * m + j]);
    }
  }
}

}  // namespace trajopt::reference
