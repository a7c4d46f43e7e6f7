#include "trajopt/problem/frontal_kkt.h"

#include <algorithm>
#include <string>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/linalg/pivot_error.h"

namespace trajopt {

namespace {

// Of the nodes outside of the root, how many go up.
int upward(int nodes) { return nodes > 2 ? (nodes - 2) * 3 / 7 : 0; }

void grow(linalg::BlockBuffer& buffer, std::size_t size) {
  if (buffer.size() < size) buffer = linalg::BlockBuffer(size);
}

}  // namespace

FrontalKkt::FrontalKkt(int nodes, int primal, int dual, Isa isa, linalg::Storage storage)
    : nodes_(nodes),
      primal_(primal),
      dual_(dual),
      width_(primal + dual),
      signs_(2 * width_, 1),
      down_(nodes, nodes - std::min(nodes, 2) - upward(nodes), primal, dual,
            FrontSweep::Direction::down, isa, storage),
      up_(nodes, upward(nodes), primal, dual, FrontSweep::Direction::up, isa, storage),
      root_node_(upward(nodes)),
      root_nodes_(std::min(nodes, 2)),
      root_ld_(linalg::padded(2 * width_)),
      root_(2 * width_ * root_ld_),
      root_inverse_(2 * width_),
      root_packed_(linalg::PackedTriangle<double>::length(2 * width_)),
      root_before_(2 * width_),
      root_coupling_(2 * primal_ * width_),
      chunk_max_((nodes + kChunk - 1) / kChunk),
      kernels_(linalg::block_kernels(isa)),
      row_kernels_(node_row_kernels(isa)),
      products_(row_product_kernels(isa)) {
  for (int node = 0; node < 2; ++node)
    std::fill_n(signs_.begin() + node * width_, dual_, static_cast<signed char>(-1));
}

void FrontalKkt::factor(const NodeRows& rows, double epsilon, int threads) {
  factor_and_begin(rows, epsilon, nullptr, 0, threads);
}

void FrontalKkt::factor_and_begin(const NodeRows& rows, double epsilon, double* x, int m,
                                  int threads) {
  factored_ = false;
  begun_ = 0;
  grow_kept(m);
  FrontSweep* sweeps[] = {&up_, &down_};
  double* kept[] = {kept_up_.data(), kept_down_.data()};
  parallel_for(2, threads, [&](long k, int) {
    sweeps[k]->factor(rows, signs_.data(), epsilon, x, m, kept[k]);
  });
  for (const FrontSweep* sweep : sweeps)  // the upward one has the lower nodes
    if (sweep->failed_node() >= 0) fail(sweep->failed_node(), sweep->pivot());
  factor_root(rows, epsilon);
  factored_ = true;
  begun_ = m;
}

void FrontalKkt::fail(int node, const linalg::Pivot& pivot) const {
  throw linalg::pivot_error(-1, node, pivot.row, pivot.value, pivot.row >= dual_, 0.0);
}

void FrontalKkt::factor_root(const NodeRows& rows, double epsilon) {
  double* root = root_.data();
  const int size = root_nodes_ * width_, m = dual_;
  std::fill_n(root, root_.size(), 0.0);
  for (int k = 0; k < root_nodes_; ++k) {
    double* block = root + k * width_ * (root_ld_ + 1);
    row_kernels_.write_pivots(rows, root_node_ + k, block, root_ld_);
    for (int r = 0; r < m; ++r) block[r * (root_ld_ + 1)] = -epsilon;
  }
  if (root_nodes_ == 2) {  // the second by the tangent of the first
    double* coupling = root_coupling_.data();
    row_kernels_.write_couplings_before(rows, root_node_ + 1, coupling, 2L * primal_);
    for (int r = 0; r < width_; ++r)
      std::copy_n(coupling + (2L * r + 1) * primal_, primal_, root + (width_ + r) * root_ld_ + m);
  }
  for (int r = 0; r < size; ++r) root_before_.data()[r] = root[r * (root_ld_ + 1)];
  add_schur_to_root();
  linalg::Elimination e;
  e.size = size;
  e.ld = e.diagonal_ld = root_ld_;
  e.diagonal = e.u = root;
  e.original = root_before_.data();
  e.original_step = 1;
  e.signs = signs_.data();
  e.w = root_packed_.data();
  e.inverse = root_inverse_.data();
  linalg::Pivot pivot = kernels_.eliminate(e);
  if (pivot.row >= 0) {
    const int node = root_node_ + pivot.row / width_;
    pivot.row %= width_;
    fail(node, pivot);
  }
}

// The sweep from below has left the root's first node as the far one, the sweep from above as the
// near one.
void FrontalKkt::add_schur_to_root() {
  double* root = root_.data();
  const auto at = [&](int r, int c) -> double& { return root[r * root_ld_ + c]; };
  if (down_.count() > 0) {
    const int d = primal_;
    const auto row = [&](int r) { return r < d ? dual_ + r : width_ + dual_ + r - d; };
    for (int r = 0; r < 2 * d; ++r)
      for (int c = 0; c <= r; ++c) at(row(r), row(c)) += down_.schur()[r * down_.schur_ld() + c];
  }
  if (up_.count() > 0) {
    const int w = width_;
    const auto row = [&](int r) { return r < w ? w + r : r - w; };
    for (int r = 0; r < 2 * w; ++r)
      for (int c = 0; c <= r; ++c)
        at(std::max(row(r), row(c)), std::min(row(r), row(c))) +=
            up_.schur()[r * up_.schur_ld() + c];
  }
}

void FrontalKkt::grow_kept(int m) {
  grow(kept_down_, down_.kept_size(m));
  grow(kept_up_, up_.kept_size(m));
}

void FrontalKkt::solve(double* x, int m, int threads) {
  if (!factored_) throw ArgumentError("solve: there is no factorization, factor() has to succeed");
  begun_ = 0;
  grow_kept(m);
  const FrontSweep* sweeps[] = {&up_, &down_};
  double* kept[] = {kept_up_.data(), kept_down_.data()};
  parallel_for(2, threads, [&](long k, int) { sweeps[k]->forward(x, m, kept[k]); });
  second_half(x, m, threads);
}

void FrontalKkt::finish(double* x, int m, int threads) {
  if (begun_ == 0)
    throw ArgumentError("finish: nothing is begun, factor_and_begin() has to succeed");
  if (begun_ != m) {
    throw ArgumentError("finish: m = " + std::to_string(m) + ", expected the " +
                        std::to_string(begun_) + " columns begun");
  }
  begun_ = 0;
  second_half(x, m, threads);
}

void FrontalKkt::second_half(double* x, int m, int threads) {
  solve_root(x, m);
  const FrontSweep* sweeps[] = {&up_, &down_};
  double* kept[] = {kept_up_.data(), kept_down_.data()};
  parallel_for(2, threads, [&](long k, int) { sweeps[k]->backward(x, m, kept[k]); });
}

void FrontalKkt::solve_root(double* x, int m) {
  const int size = root_nodes_ * width_;
  double* root = x + static_cast<long>(root_node_) * width_ * m;
  // body(row of the root, row of what a sweep keeps)
  const auto each = [&](const FrontSweep& sweep, bool down, const auto& body) {
    if (sweep.count() == 0) return;
    const int half = sweep.half();
    for (int node = 0; node < 2; ++node) {
      const long from = static_cast<long>(down ? node : 1 - node) * half * m;
      const long to = (static_cast<long>(node) * width_ + sweep.offset()) * m;
      for (long j = 0; j < static_cast<long>(half) * m; ++j) body(root[to + j], from + j);
    }
  };
  each(down_, true, [&](double& value, long j) { value += kept_down_.data()[j]; });
  each(up_, false, [&](double& value, long j) { value += kept_up_.data()[j]; });
  kernels_.substitute_transposed(size, root_packed_.data(), root, m, m, 0);
  for (int r = 0; r < size; ++r) {
    for (int j = 0; j < m; ++j) root[static_cast<long>(r) * m + j] *= root_inverse_.data()[r];
  }
  kernels_.substitute(size, root_packed_.data(), root, m, m, 0);
  each(down_, true, [&](const double& value, long j) { kept_down_.data()[j] = value; });
  each(up_, false, [&](const double& value, long j) { kept_up_.data()[j] = value; });
}

// Of columns [first, first + count) of m, for nodes [begin, end). A node's rows serve itself and
// the two nodes before it, so of the two nodes behind the end only what they have for others is
// used; what the first two have for nodes before the chunk is not.
void FrontalKkt::residual_of_chunk(const NodeRows& rows, const double* rhs, const double* x,
                                   double* r, int m, int first, int count, long begin, long end,
                                   double* scratch) const {
  const int kept = rows.kept(), columns = rows.columns(), d = primal_;
  const long node = static_cast<long>(width_) * m, ld = product_ld();
  double *xs = scratch, *sums = xs + count * ld, *lanes = sums + count * ld;
  std::fill_n(scratch, 2 * count * ld, 0.0);
  const auto read = [&](const double* from, int n, double* to) {
    for (int j = 0; j < count; ++j)
      for (int k = 0; k < n; ++k) to[j * ld + k] = from[static_cast<long>(k) * m + first + j];
  };
  const auto write = [&](const double* from, int n, double* to) {
    for (int j = 0; j < count; ++j)
      for (int k = 0; k < n; ++k) to[static_cast<long>(k) * m + first + j] = from[j * ld + k];
  };
  for (long back = std::min(begin, 2L); back > 0; --back)
    read(x + (begin - back) * node + static_cast<long>(dual_) * m, d, xs + (2 - back) * d);
  for (long i = begin; i < end + 2; ++i) {
    if (i < nodes_) {
      read(x + i * node, width_, xs + kept);
      if (i < end && rhs != nullptr) {
        read(rhs + i * node, width_, sums + kept);
      } else {
        for (int j = 0; j < count; ++j) std::fill_n(sums + j * ld + kept, width_, 0.0);
      }
      products_.subtract_lower(kept, width_, rows.row(i, 0), columns, xs, ld, sums, ld, lanes,
                               count);
      if (i < end) write(sums + kept, dual_, r + i * node);
    }
    if (i >= begin + 2) write(sums, d, r + (i - 2) * node + static_cast<long>(dual_) * m);
    for (int j = 0; j < count; ++j) {
      for (double* column : {xs + j * ld, sums + j * ld}) {
        std::copy_n(column + d, d, column);
        std::copy_n(column + kept + dual_, d, column + d);
      }
    }
  }
}

double FrontalKkt::residual(const NodeRows& rows, const double* rhs, const double* x, double* r,
                            int m, int threads) {
  constexpr int kMost = RowProductKernels::kMost;
  const long each = kMost * (2 * product_ld() + RowProductKernels::kLanes * width_);
  grow(scratch_, each * std::max(threads, 1));
  const long chunks = static_cast<long>(chunk_max_.size()), node = static_cast<long>(width_) * m;
  parallel_for(chunks, threads, [&](long chunk, int worker) {
    const long begin = chunk * kChunk, end = std::min<long>(begin + kChunk, nodes_);
    for (int first = 0; first < m; first += kMost)
      residual_of_chunk(rows, rhs, x, r, m, first, std::min(m - first, kMost), begin, end,
                        scratch_.data() + worker * each);
    for (long i = begin; i < end; ++i) row_kernels_.subtract_damping(rows, i, x, r, m);
    chunk_max_.data()[chunk] =
        linalg::largest_magnitude(r + begin * node, (end - begin) * width_, m, m);
  });
  return linalg::largest_magnitude(chunk_max_.data(), chunks, 1, 1);
}

linalg::Refinement FrontalKkt::refine(const NodeRows& rows, const double* rhs, double* x, int m,
                                      int max_steps, double tolerance, int threads) {
  const long count = row_count() * m;
  grow(residual_, count);
  grow(saved_, count);
  double *r = residual_.data(), *saved = saved_.data();
  const double size = linalg::largest_magnitude(rhs, row_count(), m, m);
  const double scale = size > 0.0 ? size : 1.0;
  return linalg::refine_loop(
      max_steps, tolerance, [&] { return residual(rows, rhs, x, r, m, threads) / scale; },
      [&] {
        solve(r, m, threads);
        for (long i = 0; i < count; ++i) {
          saved[i] = x[i];
          x[i] += r[i];
        }
      },
      [&] { std::copy_n(saved, count, x); });
}

}  // namespace trajopt
