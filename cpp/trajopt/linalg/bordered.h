// A symmetric block tridiagonal matrix with a dense border of global unknowns (free duration,
// parameters, the two ends of a ring):
//
//   K  E   z   f      K block tridiagonal, E rows x border, F border x border
//   Et F   y = g      S = F - Et K^-1 E is factored after K
#pragma once

#include "trajopt/linalg/factorization.h"

namespace trajopt::linalg {

class BorderedFactorization {
 public:
  // Allocates everything factor(), solve() and refine() need.
  //   reach    E is zero but in so many blocks at either end of K, at most half of them; 0: it may
  //            be anything anywhere
  BorderedFactorization(int blocks, int size, int border, Ordering ordering = Ordering::automatic,
                        int chunks = 2, Isa isa = Isa::avx512, int reach = 0);

  // e: rows x border, f: border x border (lower triangle read), both row-major. The signs are
  // those of K's rows and of the border's; nullptr: all +1. In a FactorizationError the border
  // counts as the block behind the last.
  void factor(const SymmetricBlockTridiagonal& k, const double* e, const double* f,
              const signed char* signs = nullptr, const signed char* border_signs = nullptr,
              double regularization = 0.0, int threads = 1);

  // The same, but false at such a pivot. Allocates nothing.
  [[nodiscard]] bool try_factor(const SymmetricBlockTridiagonal& k, const double* e,
                                const double* f, const signed char* signs = nullptr,
                                const signed char* border_signs = nullptr,
                                double regularization = 0.0, int threads = 1);

  // Solves in place: z is rows x m, y is border x m, row-major.
  void solve(double* z, double* y, int m = 1, int threads = 1) const;

  // As Factorization::refine, for one right-hand side (rhs_z, rhs_y) and its solution (z, y), with
  // the e passed to factor(). Overwrites its copy of the f passed there.
  Refinement refine(const SymmetricBlockTridiagonal& k, const double* f, const double* rhs_z,
                    const double* rhs_y, double* z, double* y, int max_steps, double tolerance,
                    int threads = 1);

  int blocks() const { return inner_.blocks(); }
  int size() const { return inner_.size(); }
  int border() const { return border_; }
  Ordering ordering() const { return inner_.ordering(); }  // never automatic

 private:
  long rows() const { return static_cast<long>(inner_.blocks()) * inner_.size(); }
  // body(first, count) for the rows of E that may not be zero, the last ones first.
  template <class Body>
  void for_rows(const Body& body) const;
  Pivot factor_border(const double* e, const double* f, const signed char* border_signs,
                      double regularization, int threads);

  Factorization inner_;
  int border_, reach_;
  long columns_;  // border, padded to whole vectors
  long ld_;       // of the factors of S
  const BlockKernels* kernels_;
  BlockBuffer e_, z_;  // E and K^-1 E, rows x columns_
  BlockBuffer f_;      // F, border x border
  BlockBuffer schur_, packed_, unscaled_, inverse_;
  BlockBuffer residual_, saved_;  // of refine()
  bool factored_ = false;
};

}  // namespace trajopt::linalg
