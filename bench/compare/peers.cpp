// Other libraries' block Thomas, band and sparse factorizations behind plain functions.
// bench/compare/_peers.py compiles this file into a shared library and calls it.
//
// All libraries are opened at run time by the path given, each in a scope of its own, so that one
// BLAS does not take over another's symbols.
#include <dlfcn.h>
#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#if __has_include(<suitesparse/cholmod.h>)
#include <suitesparse/cholmod.h>
#define HAVE_CHOLMOD 1
#endif

namespace {

using Chars = const char*;
using Ints = const int*;
using Doubles = const double*;

void* open_library(Chars path, bool global) {
  return dlopen(path, RTLD_NOW | (global ? RTLD_GLOBAL : RTLD_LOCAL | RTLD_DEEPBIND));
}

char* huge_memory(std::size_t bytes) {
  constexpr std::size_t page = std::size_t{1} << 21;
  const std::size_t rounded = (bytes + page - 1) / page * page;
  char* memory = static_cast<char*>(std::aligned_alloc(page, rounded));
  madvise(memory, rounded, MADV_HUGEPAGE);
  std::memset(memory, 0, rounded);
  return memory;
}

}  // namespace

extern "C" {

// LAPACK -----------------------------------------------------------------------------------------

struct Lapack {
  void (*potrf)(Chars, Ints, double*, Ints, int*);
  void (*trsm)(Chars, Chars, Chars, Chars, Ints, Ints, Doubles, Doubles, Ints, double*, Ints);
  void (*syrk)(Chars, Chars, Ints, Ints, Doubles, Doubles, Ints, Doubles, double*, Ints);
  void (*pbtrf)(Chars, Ints, Ints, double*, Ints, int*);
  void (*trsv)(Chars, Chars, Chars, Ints, Doubles, Ints, double*, Ints);
  void (*gemv)(Chars, Ints, Ints, Doubles, Doubles, Ints, Doubles, Ints, Doubles, double*, Ints);
};

void* lapack_open(Chars path, Chars prefix, int global) {
  void* library = open_library(path, global != 0);
  if (!library) return nullptr;
  auto* lapack = new Lapack;
  const auto find = [&](auto& function, const char* name) {
    void* symbol = dlsym(library, (std::string(prefix) + name).c_str());
    std::memcpy(&function, &symbol, sizeof symbol);
    return symbol != nullptr;
  };
  const bool found = find(lapack->potrf, "dpotrf_") && find(lapack->trsm, "dtrsm_") &&
                     find(lapack->syrk, "dsyrk_") && find(lapack->pbtrf, "dpbtrf_") &&
                     find(lapack->trsv, "dtrsv_") && find(lapack->gemv, "dgemv_");
  return found ? lapack : nullptr;
}

// In place. Row-major lower triangles are column-major upper ones, A = Ut U, and the last block
// goes first: a row-major lower block is then what dtrsm solves for without a transposition.
int lapack_thomas(const Lapack* lapack, int blocks, int size, double* diagonal, double* lower) {
  const double one = 1.0, minus = -1.0;
  const long entries = static_cast<long>(size) * size;
  int info = 0;
  for (int i = blocks - 1;; --i) {
    lapack->potrf("U", &size, diagonal + i * entries, &size, &info);
    if (info != 0 || i == 0) return info;
    double* s = lower + (i - 1) * entries;
    lapack->trsm("R", "U", "N", "N", &size, &size, &one, diagonal + i * entries, &size, s, &size);
    lapack->syrk("U", "N", &size, &size, &minus, s, &size, &one, diagonal + (i - 1) * entries,
                 &size);
  }
}

// One right-hand side with the factors above: A = Ut U with U_ii upper, s = A[i-1, i] U_ii^-1.
int lapack_solve(const Lapack* lapack, int blocks, int size, const double* diagonal,
                 const double* lower, double* x) {
  const double one = 1.0, minus = -1.0;
  const long entries = static_cast<long>(size) * size;
  const int step = 1;
  for (int i = blocks - 1; i >= 0; --i) {
    double* xi = x + static_cast<long>(i) * size;
    lapack->trsv("U", "T", "N", &size, diagonal + i * entries, &size, xi, &step);
    if (i > 0) {
      lapack->gemv("N", &size, &size, &minus, lower + (i - 1) * entries, &size, xi, &step, &one,
                   xi - size, &step);
    }
  }
  for (int i = 0; i < blocks; ++i) {
    double* xi = x + static_cast<long>(i) * size;
    if (i > 0) {
      lapack->gemv("T", &size, &size, &minus, lower + (i - 1) * entries, &size, xi - size, &step,
                   &one, xi, &step);
    }
    lapack->trsv("U", "N", "N", &size, diagonal + i * entries, &size, xi, &step);
  }
  return 0;
}

int lapack_band(const Lapack* lapack, int rows, int width, double* band) {
  const int ld = width + 1;
  int info = 0;
  lapack->pbtrf("L", &rows, &width, band, &ld, &info);
  return info;
}

// BLASFEO, panel-major ---------------------------------------------------------------------------

struct BlasfeoMatrix {
  double* mem;
  double* pA;
  double* dA;
  int m, n, pm, cn, use_dA;
  int memsize;
};

struct Blasfeo {
  using M = BlasfeoMatrix*;
  int (*memsize)(int, int);
  void (*create)(int, int, M, void*);
  void (*pack)(int, int, double*, int, M, int, int);
  void (*unpack)(int, int, M, int, int, double*, int);
  void (*potrf)(int, M, int, int, M, int, int);
  void (*trsm)(int, int, double, M, int, int, M, int, int, M, int, int);
  void (*syrk)(int, int, double, M, int, int, M, int, int, double, M, int, int, M, int, int);
  int blocks = 0, size = 0;
  char* memory = nullptr;
  std::vector<BlasfeoMatrix> d, e, l, m;  // the matrix and its factors
};

void* blasfeo_open(Chars path) {
  void* library = open_library(path, false);
  if (!library) return nullptr;
  auto* b = new Blasfeo;
  const auto find = [&](auto& function, const char* name) {
    void* symbol = dlsym(library, name);
    std::memcpy(&function, &symbol, sizeof symbol);
    return symbol != nullptr;
  };
  const bool found = find(b->memsize, "blasfeo_memsize_dmat") &&
                     find(b->create, "blasfeo_create_dmat") && find(b->pack, "blasfeo_pack_dmat") &&
                     find(b->unpack, "blasfeo_unpack_dmat") && find(b->potrf, "blasfeo_dpotrf_l") &&
                     find(b->trsm, "blasfeo_dtrsm_rltn") && find(b->syrk, "blasfeo_dsyrk_ln");
  return found ? b : nullptr;
}

// The lower triangles of `diagonal` may be row-major: BLASFEO reads column-major ones, so both
// triangles have to be there. lower[i] = A[i+1, i] is packed transposed for the same reason.
void blasfeo_set(Blasfeo* b, int blocks, int size, double* diagonal, double* lower_transposed) {
  std::free(b->memory);
  const std::size_t bytes = (static_cast<std::size_t>(b->memsize(size, size)) + 63) / 64 * 64;
  b->memory = huge_memory(bytes * 4 * blocks);
  b->blocks = blocks;
  b->size = size;
  char* next = b->memory;
  for (auto* list : {&b->d, &b->e, &b->l, &b->m}) {
    list->assign(blocks, BlasfeoMatrix{});
    for (auto& matrix : *list) {
      b->create(size, size, &matrix, next);
      next += bytes;
    }
  }
  const long entries = static_cast<long>(size) * size;
  for (int i = 0; i < blocks; ++i) {
    b->pack(size, size, diagonal + i * entries, size, &b->d[i], 0, 0);
    if (i + 1 < blocks) b->pack(size, size, lower_transposed + i * entries, size, &b->e[i], 0, 0);
  }
}

int blasfeo_thomas(Blasfeo* b) {
  const int n = b->size;
  b->potrf(n, &b->d[0], 0, 0, &b->l[0], 0, 0);
  for (int i = 0; i + 1 < b->blocks; ++i) {
    b->trsm(n, n, 1.0, &b->l[i], 0, 0, &b->e[i], 0, 0, &b->m[i], 0, 0);
    b->syrk(n, n, -1.0, &b->m[i], 0, 0, &b->m[i], 0, 0, 1.0, &b->d[i + 1], 0, 0, &b->l[i + 1], 0,
            0);
    b->potrf(n, &b->l[i + 1], 0, 0, &b->l[i + 1], 0, 0);
  }
  return 0;
}

// Column-major factor of the last block, to check the result.
void blasfeo_last(Blasfeo* b, double* factor) {
  b->unpack(b->size, b->size, &b->l[b->blocks - 1], 0, 0, factor, b->size);
}

// CHOLMOD ----------------------------------------------------------------------------------------

#ifdef HAVE_CHOLMOD

struct Cholmod {
  cholmod_common common;
  cholmod_sparse matrix;
  cholmod_factor* factor = nullptr;
  int (*factorize)(cholmod_sparse*, cholmod_factor*, cholmod_common*);
  int (*get_levels)();
  void (*set_levels)(int);
};

// Its BLAS is the one in the global scope when the library is first opened, else its own.
// The lower triangle in compressed columns; ordering 0: as it is, 1: CHOLMOD's choice.
void* cholmod_open_matrix(Chars path, int rows, int* column, int* row, double* value,
                          int own_ordering) {
  void* library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
  if (!library) return nullptr;
  auto* c = new Cholmod;
  int (*start)(cholmod_common*) = nullptr;
  cholmod_factor* (*analyze)(cholmod_sparse*, cholmod_common*) = nullptr;
  const auto find = [&](auto& function, const char* name) {
    void* symbol = dlsym(library, name);
    std::memcpy(&function, &symbol, sizeof symbol);
    return symbol != nullptr;
  };
  if (!find(start, "cholmod_start") || !find(analyze, "cholmod_analyze") ||
      !find(c->factorize, "cholmod_factorize")) {
    return nullptr;
  }
  // Debian's CHOLMOD asks OpenMP for four threads in the loops around the BLAS, whatever
  // OMP_NUM_THREADS says: on fewer cores they wait for each other most of the time.
  void* openmp = dlopen("libgomp.so.1", RTLD_NOW | RTLD_LOCAL);
  if (!openmp) return nullptr;
  library = openmp;
  if (!find(c->get_levels, "omp_get_max_active_levels") ||
      !find(c->set_levels, "omp_set_max_active_levels")) {
    return nullptr;
  }
  start(&c->common);
  // Dense blocks are what supernodes are made for; left alone it goes without them below some size.
  c->common.supernodal = CHOLMOD_SUPERNODAL;
  if (!own_ordering) {
    c->common.nmethods = 1;
    c->common.method[0].ordering = CHOLMOD_NATURAL;
  }
  std::memset(&c->matrix, 0, sizeof c->matrix);
  c->matrix.nrow = c->matrix.ncol = static_cast<std::size_t>(rows);
  c->matrix.nzmax = static_cast<std::size_t>(column[rows]);
  c->matrix.p = column;
  c->matrix.i = row;
  c->matrix.x = value;
  c->matrix.stype = -1;
  c->matrix.itype = CHOLMOD_INT;
  c->matrix.xtype = CHOLMOD_REAL;
  c->matrix.dtype = CHOLMOD_DOUBLE;
  c->matrix.sorted = c->matrix.packed = 1;
  c->factor = analyze(&c->matrix, &c->common);
  return c->factor ? c : nullptr;
}

// With one thread.
int cholmod_refactor(Cholmod* c) {
  const int levels = c->get_levels();
  c->set_levels(0);
  const bool good =
      c->factorize(&c->matrix, c->factor, &c->common) && c->factor->minor == c->factor->n;
  c->set_levels(levels);
  return good ? 0 : 1;
}

#endif

}  // extern "C"
