// Loops of a constant length, written out by the compiler before it decides what stays in
// registers: an array that is only indexed by constants does.
#pragma once

#include <utility>

#include "trajopt/base/hd.h"

namespace trajopt::inline TRAJOPT_ISA {

// Its value as a type, and as a number on host and device alike.
template <int I>
struct Index {
  static constexpr int value = I;
  TRAJOPT_HD constexpr operator int() const { return I; }  // NOLINT(google-explicit-constructor)
};

namespace unrolled_detail {
template <class Body, int... I>
__attribute__((always_inline)) TRAJOPT_HD inline void run(const Body& body,
                                                          std::integer_sequence<int, I...>) {
  (body(Index<I>{}), ...);
}
}  // namespace unrolled_detail

// body(i) for i = 0 .. N - 1, i a compile-time constant; declare the body's lambda always inline
// with TRAJOPT_INLINE_BODY.
template <int N, class Body>
__attribute__((always_inline)) TRAJOPT_HD inline void unrolled(const Body& body) {
  unrolled_detail::run(body, std::make_integer_sequence<int, N>{});
}

}  // namespace trajopt::inline TRAJOPT_ISA

#define TRAJOPT_INLINE_BODY __attribute__((always_inline))
