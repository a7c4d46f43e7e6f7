// Compiled once per instruction set: the interpreter of tapes.
#include <cmath>

#include "trajopt/base/pack.h"
#include "trajopt/base/sincos.h"
#include "trajopt/interior_point/tape.h"

namespace trajopt::interior_point::inline TRAJOPT_ISA {

namespace {

#if defined(__AVX512F__)
constexpr int kLanes = 8;
#elif defined(__AVX2__)
constexpr int kLanes = 4;
#else
constexpr int kLanes = 2;
#endif

using Lanes = Pack<kLanes>;

constexpr double kSinCosRange = 1e5;  // where sincos() keeps its accuracy

template <class F>
inline Lanes each(const Lanes& a, const F& f) {
  Lanes r;
  for (int i = 0; i < kLanes; ++i) r.set(i, f(a[i]));
  return r;
}

template <class F>
inline Lanes each(const Lanes& a, const Lanes& b, const F& f) {
  Lanes r;
  for (int i = 0; i < kLanes; ++i) r.set(i, f(a[i], b[i]));
  return r;
}

// A lane out of range (or not a number) takes the library's function, whatever its neighbours do.
inline Lanes sine_or_cosine(const Lanes& x, bool cosine) {
  Lanes s, c;
  sincos(x, s, c);
  Lanes r = cosine ? c : s;
  for (int i = 0; i < kLanes; ++i) {
    if (!(std::fabs(x[i]) <= kSinCosRange)) r.set(i, cosine ? std::cos(x[i]) : std::sin(x[i]));
  }
  return r;
}

// The rare operations, lane by lane.
Lanes rare(Operation operation, const Lanes& a, const Lanes& b) {
  switch (operation) {
    case Operation::exp:
      return each(a, [](double x) { return std::exp(x); });
    case Operation::log:
      return each(a, [](double x) { return std::log(x); });
    case Operation::pow:
    case Operation::constpow:
      return each(a, b, [](double x, double y) { return std::pow(x, y); });
    case Operation::tan:
      return each(a, [](double x) { return std::tan(x); });
    case Operation::asin:
      return each(a, [](double x) { return std::asin(x); });
    case Operation::acos:
      return each(a, [](double x) { return std::acos(x); });
    case Operation::atan:
      return each(a, [](double x) { return std::atan(x); });
    case Operation::lt:
      return each(a, b, [](double x, double y) { return x < y ? 1.0 : 0.0; });
    case Operation::le:
      return each(a, b, [](double x, double y) { return x <= y ? 1.0 : 0.0; });
    case Operation::eq:
      return each(a, b, [](double x, double y) { return x == y ? 1.0 : 0.0; });
    case Operation::ne:
      return each(a, b, [](double x, double y) { return x != y ? 1.0 : 0.0; });
    case Operation::logic_not:
      return each(a, [](double x) { return x == 0.0 ? 1.0 : 0.0; });
    case Operation::logic_and:
      return each(a, b, [](double x, double y) { return x != 0.0 && y != 0.0 ? 1.0 : 0.0; });
    case Operation::logic_or:
      return each(a, b, [](double x, double y) { return x != 0.0 || y != 0.0 ? 1.0 : 0.0; });
    case Operation::floor:
      return each(a, [](double x) { return std::floor(x); });
    case Operation::ceil:
      return each(a, [](double x) { return std::ceil(x); });
    case Operation::fmod:
      return each(a, b, [](double x, double y) { return std::fmod(x, y); });
    case Operation::sign:
      return each(a, [](double x) { return x < 0.0 ? -1.0 : x > 0.0 ? 1.0 : x; });
    case Operation::copysign:
      return each(a, b, [](double x, double y) { return std::copysign(x, y); });
    case Operation::if_else_zero:
      return each(a, b, [](double x, double y) { return x != 0.0 ? y : 0.0; });
    case Operation::erf:
      return each(a, [](double x) { return std::erf(x); });
    case Operation::fmin:
      return each(a, b, [](double x, double y) { return std::fmin(x, y); });
    case Operation::fmax:
      return each(a, b, [](double x, double y) { return std::fmax(x, y); });
    case Operation::sinh:
      return each(a, [](double x) { return std::sinh(x); });
    case Operation::cosh:
      return each(a, [](double x) { return std::cosh(x); });
    case Operation::tanh:
      return each(a, [](double x) { return std::tanh(x); });
    case Operation::asinh:
      return each(a, [](double x) { return std::asinh(x); });
    case Operation::acosh:
      return each(a, [](double x) { return std::acosh(x); });
    case Operation::atanh:
      return each(a, [](double x) { return std::atanh(x); });
    case Operation::atan2:
      return each(a, b, [](double x, double y) { return std::atan2(x, y); });
    default:
      return a;  // assign; the constructor has refused everything else
  }
}

void run(const Tape::View& view, int first, int copies, void* registers) {
  Lanes* w = static_cast<Lanes*>(registers);
  const Instruction* end = view.code + view.length;
  for (const Instruction* i = view.code; i != end; ++i) {
    switch (static_cast<Operation>(i->operation)) {
      case Operation::add:
        w[i->out] = w[i->a] + w[i->b];
        break;
      case Operation::sub:
        w[i->out] = w[i->a] - w[i->b];
        break;
      case Operation::mul:
        w[i->out] = w[i->a] * w[i->b];
        break;
      case Operation::div:
        w[i->out] = w[i->a] / w[i->b];
        break;
      case Operation::neg:
        w[i->out] = -w[i->a];
        break;
      case Operation::sq:
        w[i->out] = w[i->a] * w[i->a];
        break;
      case Operation::twice:
        w[i->out] = w[i->a] + w[i->a];
        break;
      case Operation::inv:
        w[i->out] = Lanes(1.0) / w[i->a];
        break;
      case Operation::sqrt:
        w[i->out] = sqrt(w[i->a]);
        break;
      case Operation::fabs:
        w[i->out] = each(w[i->a], [](double x) { return std::fabs(x); });
        break;
      case Operation::sin:
        w[i->out] = sine_or_cosine(w[i->a], false);
        break;
      case Operation::cos:
        w[i->out] = sine_or_cosine(w[i->a], true);
        break;
      case Operation::constant:
        w[i->out] = Lanes(view.constants[i->a]);
        break;
      case Operation::input: {
        // Lanes without a copy repeat the last one.
        const TapeInput& in = view.inputs[i->a];
        const double* p = in.data + first * in.step + i->b;
        Lanes x;
        for (int l = 0; l < kLanes; ++l) x.set(l, p[(l < copies ? l : copies - 1) * in.step]);
        w[i->out] = x;
        break;
      }
      case Operation::output: {
        const TapeOutput& out = view.outputs[i->out];
        double* p = out.data + first * out.step + i->b;
        const Lanes x = w[i->a];
        for (int l = 0; l < copies; ++l) p[l * out.step] = x[l];
        break;
      }
      default:
        w[i->out] = rare(static_cast<Operation>(i->operation), w[i->a], w[i->b]);
    }
  }
}

}  // namespace

extern const TapeKernel kTapeKernel;
const TapeKernel kTapeKernel = {kLanes, run};

}  // namespace trajopt::interior_point::inline TRAJOPT_ISA
