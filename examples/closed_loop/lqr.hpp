// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Computes the gain of the linear-quadratic regulator in discrete time by iterating the Riccati equation. It is meant
// for a plant with a handful of states. Pure.
#pragma once

#include <cstddef>
#include <vector>

namespace closed_loop {

/// A dense matrix, stored row by row.
struct Matrix {
  std::size_t rows = 0;
  std::size_t columns = 0;
  std::vector<double> values;

  Matrix(std::size_t r, std::size_t c) : rows(r), columns(c), values(r * c, 0.0) {}
  double &at(std::size_t r, std::size_t c) { return values[r * columns + c]; }
  [[nodiscard]] double at(std::size_t r, std::size_t c) const { return values[r * columns + c]; }
};

/// Returns the K that minimises the sum of x'Qx + u'Ru under x+ = A x + B u, u = -K x. Q and R are diagonal. Throws
/// std::runtime_error if the iteration does not converge; then the system cannot be stabilised.
[[nodiscard]] Matrix lqr(const Matrix &a, const Matrix &b, const std::vector<double> &q, const std::vector<double> &r);

}  // namespace closed_loop
