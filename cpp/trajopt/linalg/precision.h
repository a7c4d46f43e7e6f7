// Scalar type of factors, on every executor.
#pragma once

namespace trajopt::linalg {

// The matrix, right-hand sides and residuals are float64 in any case, so refinement recovers full
// accuracy from float32 factors of a matrix they can represent.
enum class Precision { float64, float32 };

inline const char* precision_name(Precision precision) {
  return precision == Precision::float64 ? "float64" : "float32";
}

}  // namespace trajopt::linalg
