// Configurations on the manifold: q (quaternions), x (rotation vectors), tangent steps in R^D.
#pragma once

#include "trajopt/model/model.h"

namespace trajopt {

void configuration_from_vector(const Model& model, const double* x, double* q);

// Rotation vectors of length at most pi.
void configuration_to_vector(const Model& model, const double* q, double* x);

// out = q (+) step: slides and hinges add, balls R <- exp(step) R. out may be q.
void integrate(const Model& model, const double* q, const double* step, double* out);

// a (-) b: the step that carries b to a.
void difference(const Model& model, const double* a, const double* b, double* step);

}  // namespace trajopt
