#include "trajopt/cuda/linalg/factorization.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "trajopt/cuda/linalg/launches.h"
#include "trajopt/linalg/pivot_error.h"

namespace trajopt::cuda {

using linalg::GroupFailure;
using linalg::GroupMatrix;
using linalg::GroupSystem;
using linalg::Ordering;
using linalg::Precision;

namespace {

linalg::Schedule schedule_for(int blocks, Ordering ordering, int chunks, int batch,
                              int multiprocessors) {
  if (ordering == Ordering::automatic) {
    // With a problem for every multiprocessor there is no need to buy parallelism with flops.
    ordering = batch >= multiprocessors ? Ordering::chunked : Ordering::cyclic;
    chunks = 2;
  }
  return linalg::make_schedule(blocks, ordering, chunks);
}

template <class T>
DeviceBuffer<T> copy_of(const std::vector<T>& values, const Stream& stream) {
  DeviceBuffer<T> buffer(values.size());
  buffer.upload(values.data(), values.size(), stream);
  return buffer;
}

}  // namespace

Factorization::Factorization(int blocks, int size, Ordering ordering, int chunks, int batch,
                             Precision precision)
    : stream_((require_device(), Stream())) {
  if (blocks < 1 || size < 1 || batch < 0 || chunks < 1) {
    throw ArgumentError(
        "a factorization needs at least one block of at least one row: " + std::to_string(blocks) +
        " blocks of size " + std::to_string(size) + ", batch of " + std::to_string(batch) + ", " +
        std::to_string(chunks) + " chunks");
  }
  const DeviceInfo device = current_device();
  plan_ = linalg::make_group_plan(
      blocks, schedule_for(blocks, ordering, chunks, batch, device.multiprocessors));
  shape_.blocks = blocks;
  shape_.size = size;
  batch_ = shape_.batch = batch;
  if (precision == Precision::float64) {
    factors_ = make_factors<double>(device);
  } else {
    factors_ = make_factors<float>(device);
  }
  const std::size_t items = batch;
  failures_ = DeviceBuffer<GroupFailure>(items * plan_.runs);
  failed_stage_ = DeviceBuffer<int>(items);
  failed_item_ = DeviceBuffer<int>(1);
  host_failed_item_ = PinnedBuffer<int>(1);
  eliminations_ = copy_of(plan_.eliminations, stream_);
  updates_ = copy_of(plan_.updates, stream_);
  stream_.synchronize();
}

template <class T>
Factors<T> Factorization::make_factors(const DeviceInfo& device) const {
  const std::size_t needed = linalg_shared_memory<T>(size());
  if (needed > device.shared_memory) {
    throw DeviceError("blocks of size " + std::to_string(size()) + " need " +
                      std::to_string(needed) + " bytes of shared memory in a thread block, " +
                      device.name + " has " + std::to_string(device.shared_memory));
  }
  load_linalg_kernels<T>();
  // Two thread blocks of a multiprocessor should find room, or waiting is not hidden.
  const bool stage_w = linalg_shared_memory_with_w<T>(size()) <= device.shared_memory / 2;
  return Factors<T>(plan_, blocks(), size(), batch(), stage_w);
}

std::size_t Factorization::device_bytes() const {
  std::size_t bytes = eliminations_.bytes() + updates_.bytes() + signs_.bytes() +
                      failures_.bytes() + failed_stage_.bytes() + failed_item_.bytes() +
                      states_.bytes() + active_.bytes() + rounded_.bytes();
  bytes += std::visit([](const auto& factors) { return factors.bytes(); }, factors_);
  for (const DeviceBuffer<double>* buffer :
       {&regularization_, &x_, &rhs_, &residual_, &saved_, &norm_, &peak_, &scale_}) {
    bytes += buffer->bytes();
  }
  const std::size_t block = sizeof(double) * matrix_.size() * matrix_.size();
  return bytes + block * (2 * matrix_.blocks() - (matrix_.blocks() > 0)) * matrix_.batch();
}

GroupMatrix Factorization::matrix_of(const BlockTridiagonal& a) const {
  if (a.blocks() != blocks() || a.size() != size() || a.batch() != batch()) {
    throw ArgumentError("the matrix on the device has " + std::to_string(a.blocks()) +
                        " blocks of size " + std::to_string(a.size()) + " in a batch of " +
                        std::to_string(a.batch()) + ", this factorization is for " +
                        std::to_string(blocks()) + ", " + std::to_string(size()) + ", " +
                        std::to_string(batch()));
  }
  GroupMatrix matrix = shape_;
  matrix.diagonal = a.diagonal();
  matrix.lower = a.lower();
  return matrix;
}

template <class T>
linalg::BasicGroupSystem<T> Factorization::complete(const Factors<T>& factors,
                                                    const GroupMatrix& a) const {
  linalg::BasicGroupSystem<T> s = factors.system(a);
  s.failures = failures_.data();
  s.failed_stage = failed_stage_.data();
  s.failed_item = failed_item_.data();
  return s;
}

template <class Body>
void Factorization::with_system(const GroupMatrix& a, const Body& body) const {
  std::visit(
      [&](const auto& factors) {
        auto s = complete(factors, a);
        body(s);
      },
      factors_);
}

linalg::GroupSystem Factorization::system() const {
  return complete(std::get<Factors<double>>(factors_), shape_);
}

linalg::GroupSystem Factorization::system_of(const BlockTridiagonal& a) const {
  return complete(std::get<Factors<double>>(factors_), matrix_of(a));
}

// In device memory -------------------------------------------------------------------------------

void Factorization::enqueue_factor(const BlockTridiagonal& a, const signed char* signs,
                                   const double* regularization, const Stream& stream) {
  const GroupMatrix matrix = matrix_of(a);
  failures_.set_bytes(0xff, stream);  // block -1
  failed_stage_.set_bytes(GroupSystem::kNever & 0xff, stream);
  failed_item_.set_bytes(GroupSystem::kNever & 0xff, stream);
  with_system(matrix, [&](auto& s) {
    s.signs = signs;
    s.regularization = regularization;
    launch_factor(plan_, entries(), s, stream);
  });
}

void Factorization::check(const signed char* host_signs, double regularization,
                          const Stream& stream) {
  factored_ = false;
  failed_item_.download(host_failed_item_.data(), 1, stream);
  stream.synchronize();
  const int item = host_failed_item_[0];
  if (item != GroupSystem::kNever) {
    const signed char* signs = host_signs ? host_signs + item * rows() : nullptr;
    throw failure(item, signs, regularization, batch() > 1 ? item : -1, stream);
  }
  factored_ = true;
}

FactorizationError Factorization::failure(int item, const signed char* signs, double regularization,
                                          int name, const Stream& stream) const {
  std::vector<GroupFailure> failures(plan_.runs);
  failures_.download(failures.data(), failures.size(), stream,
                     static_cast<std::size_t>(item) * plan_.runs);
  stream.synchronize();
  GroupFailure lowest{-1, -1, 0.0};
  for (const GroupFailure& f : failures) {
    if (f.block >= 0 && (lowest.block < 0 || f.block < lowest.block)) lowest = f;
  }
  const bool positive = !signs || signs[static_cast<long>(lowest.block) * size() + lowest.row] > 0;
  return linalg::pivot_error(name, lowest.block, lowest.row, lowest.value, positive,
                             regularization);
}

void Factorization::list(const int* listed, int places) {
  shape_.listed = listed;
  shape_.batch = places;
}

void Factorization::reserve_solution(int m) {
  if (precision() == Precision::float64 || m <= solve_columns_) return;
  const std::size_t columns = static_cast<std::size_t>(batch()) * m;
  solve_columns_ = solve_graph_columns_ = 0;
  solve_graph_ = Graph();  // it works on the old room
  rounded_ = DeviceBuffer<float>(columns * rows());
  peak_ = DeviceBuffer<double>(columns);
  scale_ = DeviceBuffer<double>(columns);
  peak_.set_zero(stream_);  // every solution leaves zeros
  stream_.synchronize();
  solve_columns_ = m;
}

void Factorization::enqueue_solve(double* x, int m, const Stream& stream) const {
  if (precision() == Precision::float32 && m > solve_columns_) {
    throw ArgumentError("enqueue_solve: " + std::to_string(m) + " columns, reserved are " +
                        std::to_string(solve_columns_));
  }
  with_system(shape_,
              [&](const auto& s) { launch_solve(plan_, entries(), s, x, m, room(), stream); });
}

void Factorization::reserve_refinement(int m) {
  reserve_solution(m);
  if (m <= refine_columns_) return;
  const std::size_t values = static_cast<std::size_t>(batch()) * rows() * m;
  const std::size_t lanes = static_cast<std::size_t>(batch()) * linalg::column_chunks(m);
  refine_columns_ = 0;
  residual_ = DeviceBuffer<double>(values);
  saved_ = DeviceBuffer<double>(values);
  norm_ = DeviceBuffer<double>(lanes);
  states_ = DeviceBuffer<linalg::GroupRefinement>(lanes);
  active_ = DeviceBuffer<int>(lanes);
  norm_.set_zero(stream_);  // every refinement leaves zeros
  stream_.synchronize();
  refine_columns_ = m;
}

linalg::RefineArrays Factorization::refine_arrays(const double* rhs) const {
  return {rhs,   residual_.data(), saved_.data(), norm_.data(), states_.data(), active_.data(),
          room()};
}

void Factorization::enqueue_refine(const BlockTridiagonal& a, const double* rhs, double* x, int m,
                                   int max_steps, double tolerance, const Stream& stream) const {
  if (m > refine_columns_) {
    throw ArgumentError("enqueue_refine: " + std::to_string(m) + " columns, reserved are " +
                        std::to_string(refine_columns_));
  }
  const GroupMatrix matrix = matrix_of(a);
  const linalg::RefineArrays arrays = refine_arrays(rhs);
  lanes_ = static_cast<long>(batch()) * linalg::column_chunks(m);
  launch_refine_start(matrix, x, m, max_steps, tolerance, arrays, stream);
  with_system(matrix, [&](const auto& s) {
    for (int k = 0; k < max_steps; ++k) {
      launch_refine_step(plan_, entries(), s, x, m, max_steps, tolerance, arrays, stream);
    }
  });
}

linalg::Refinement Factorization::refinement(const Stream& stream) const {
  std::vector<linalg::GroupRefinement> states(lanes_);
  states_.download(states.data(), states.size(), stream);
  stream.synchronize();
  linalg::Refinement worst;
  for (const linalg::GroupRefinement& state : states) {
    worst.steps = std::max(worst.steps, state.steps);
    if (!(state.residual <= worst.residual)) worst.residual = state.residual;
  }
  return worst;
}

// In host memory ---------------------------------------------------------------------------------

void Factorization::upload(const linalg::SymmetricBlockTridiagonal& a, const char* what) {
  if (a.blocks() != blocks() || a.size() != size() || a.batch() != batch()) {
    throw ArgumentError(std::string(what) + ": the matrix has " + std::to_string(a.blocks()) +
                        " blocks of size " + std::to_string(a.size()) + " in a batch of " +
                        std::to_string(a.batch()) + ", this factorization is for " +
                        std::to_string(blocks()) + ", " + std::to_string(size()) + ", " +
                        std::to_string(batch()));
  }
  if (matrix_.blocks() == 0) {
    BlockTridiagonal matrix(blocks(), size(), batch());
    signs_ = DeviceBuffer<signed char>(static_cast<std::size_t>(batch()) * rows());
    regularization_ = DeviceBuffer<double>(1);
    host_regularization_ = PinnedBuffer<double>(1);
    matrix_ = std::move(matrix);
  }
  matrix_.upload(a, stream_);
}

void Factorization::factor(const linalg::SymmetricBlockTridiagonal& a, const signed char* signs,
                           double regularization) {
  factored_ = false;
  upload(a, "factor");
  if (signs) {
    signs_.upload(signs, signs_.size(), stream_);
  } else {
    signs_.set_bytes(1, stream_);
  }
  host_regularization_[0] = regularization;
  if (!factor_graph_) {
    factor_graph_ = Graph::capture(stream_, [&] {
      regularization_.upload(host_regularization_.data(), 1, stream_);
      enqueue_factor(matrix_, signs_.data(), regularization_.data(), stream_);
    });
  }
  factor_graph_.launch(stream_);
  check(signs, regularization, stream_);
}

void Factorization::require_factors(const char* what) const {
  if (!factored_) {
    throw ArgumentError(std::string(what) + ": there is no factorization, factor() has to succeed");
  }
}

void Factorization::reserve_columns(int m) {
  const std::size_t values = static_cast<std::size_t>(batch()) * rows() * m;
  if (values > x_.size()) {
    solve_graph_ = Graph();  // it works on the old buffer
    solve_graph_columns_ = 0;
    x_ = DeviceBuffer<double>(values);
  }
  reserve_solution(m);
}

void Factorization::solve(double* rhs, int m) {
  require_factors("solve");
  if (m < 1) return;
  reserve_columns(m);
  if (solve_graph_columns_ != m) {
    solve_graph_columns_ = 0;
    solve_graph_ = Graph::capture(stream_, [&] { enqueue_solve(x_.data(), m, stream_); });
    solve_graph_columns_ = m;
  }
  const std::size_t values = static_cast<std::size_t>(batch()) * rows() * m;
  x_.upload(rhs, values, stream_);
  solve_graph_.launch(stream_);
  x_.download(rhs, values, stream_);
  stream_.synchronize();
}

bool Factorization::refinement_goes_on() {
  std::vector<int> active(lanes_);
  active_.download(active.data(), active.size(), stream_);
  stream_.synchronize();
  return std::find(active.begin(), active.end(), 1) != active.end();
}

linalg::Refinement Factorization::refine(const linalg::SymmetricBlockTridiagonal& a,
                                         const double* rhs, double* x, int m, int max_steps,
                                         double tolerance) {
  require_factors("refine");
  if (m < 1 || batch() == 0) return {};
  const std::size_t values = static_cast<std::size_t>(batch()) * rows() * m;
  upload(a, "refine");
  reserve_refinement(m);
  reserve_columns(m);
  if (rhs_.size() < values) rhs_ = DeviceBuffer<double>(values);
  rhs_.upload(rhs, values, stream_);
  x_.upload(x, values, stream_);
  const GroupMatrix matrix = matrix_of(matrix_);
  const linalg::RefineArrays arrays = refine_arrays(rhs_.data());
  lanes_ = static_cast<long>(batch()) * linalg::column_chunks(m);
  launch_refine_start(matrix, x_.data(), m, max_steps, tolerance, arrays, stream_);
  with_system(matrix, [&](const auto& s) {
    for (int k = 0; k < max_steps && refinement_goes_on(); ++k) {
      launch_refine_step(plan_, entries(), s, x_.data(), m, max_steps, tolerance, arrays, stream_);
    }
  });
  const linalg::Refinement result = refinement(stream_);
  x_.download(x, values, stream_);
  stream_.synchronize();
  return result;
}

}  // namespace trajopt::cuda
