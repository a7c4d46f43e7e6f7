// Minimizer of a convex quadratic in two variables over a disc: the whole of a two-subspace
// trust-region problem (Nocedal and Wright, chapter 4).
#pragma once

#include <array>
#include <cmath>

namespace trajopt {

// argmin g.y + y.B y / 2 over |y| <= radius, B = [[b00, b01], [b01, b11]] positive semidefinite.
inline std::array<double, 2> minimize_in_disc(double b00, double b01, double b11, double g0,
                                              double g1, double radius) {
  // Eigenvectors (c, s) and (-s, c) turn B into diag(l0, l1).
  const double angle = 0.5 * std::atan2(2 * b01, b00 - b11);
  const double c = std::cos(angle), s = std::sin(angle);
  const double l0 = std::fmax(b00 * c * c + 2 * b01 * c * s + b11 * s * s, 0.0);
  const double l1 = std::fmax(b00 * s * s - 2 * b01 * c * s + b11 * c * c, 0.0);
  const double h0 = c * g0 + s * g1, h1 = -s * g0 + c * g1;
  const auto point = [&](double shift) {  // of the eigenbasis
    return std::array<double, 2>{h0 == 0 ? 0 : -h0 / (l0 + shift),
                                 h1 == 0 ? 0 : -h1 / (l1 + shift)};
  };
  const auto length = [](const std::array<double, 2>& y) { return std::hypot(y[0], y[1]); };
  std::array<double, 2> y = point(0.0);
  if (!(length(y) <= radius)) {
    // |y(shift)| falls with the shift, and |g| / radius is enough of it.
    double low = 0, high = std::hypot(h0, h1) / radius;
    for (int k = 0; k < 200 && high - low > 1e-15 * high; ++k) {
      const double middle = 0.5 * (low + high);
      (length(point(middle)) > radius ? low : high) = middle;
    }
    y = point(high);
  }
  return {c * y[0] - s * y[1], s * y[0] + c * y[1]};
}

}  // namespace trajopt
