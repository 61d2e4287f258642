// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "lqr.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

namespace closed_loop {
namespace {

constexpr int kMostIterations = 200'000;
constexpr double kSettled = 1e-10;

Matrix product(const Matrix &x, const Matrix &y) {
  Matrix result(x.rows, y.columns);
  for (std::size_t i = 0; i < x.rows; ++i) {
    for (std::size_t k = 0; k < x.columns; ++k) {
      for (std::size_t j = 0; j < y.columns; ++j) result.at(i, j) += x.at(i, k) * y.at(k, j);
    }
  }
  return result;
}

Matrix transposed(const Matrix &x) {
  Matrix result(x.columns, x.rows);
  for (std::size_t i = 0; i < x.rows; ++i) {
    for (std::size_t j = 0; j < x.columns; ++j) result.at(j, i) = x.at(i, j);
  }
  return result;
}

// Solves left X = right by Gaussian elimination with pivots; left is small and positive definite.
Matrix solved(Matrix left, Matrix right) {
  const std::size_t n = left.rows;
  for (std::size_t p = 0; p < n; ++p) {
    std::size_t pivot = p;
    for (std::size_t i = p + 1; i < n; ++i) {
      if (std::abs(left.at(i, p)) > std::abs(left.at(pivot, p))) pivot = i;
    }
    for (std::size_t j = 0; j < n; ++j) std::swap(left.at(p, j), left.at(pivot, j));
    for (std::size_t j = 0; j < right.columns; ++j) std::swap(right.at(p, j), right.at(pivot, j));
    for (std::size_t i = 0; i < n; ++i) {
      if (i == p) continue;
      const double factor = left.at(i, p) / left.at(p, p);
      for (std::size_t j = p; j < n; ++j) left.at(i, j) -= factor * left.at(p, j);
      for (std::size_t j = 0; j < right.columns; ++j) right.at(i, j) -= factor * right.at(p, j);
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < right.columns; ++j) right.at(i, j) /= left.at(i, i);
  }
  return right;
}

}  // namespace

Matrix lqr(const Matrix &a, const Matrix &b, const std::vector<double> &q, const std::vector<double> &r) {
  const std::size_t n = a.rows;
  const Matrix bt = transposed(b);
  Matrix p(n, n);
  for (std::size_t i = 0; i < n; ++i) p.at(i, i) = q[i];
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    Matrix weight = product(bt, product(p, b));
    for (std::size_t i = 0; i < weight.rows; ++i) weight.at(i, i) += r[i];
    Matrix gain = solved(std::move(weight), product(bt, product(p, a)));
    // P+ = Q + K'RK + (A - BK)'P(A - BK). This form keeps P symmetric in spite of rounding; the shorter form does not.
    Matrix closed = product(b, gain);
    for (std::size_t i = 0; i < closed.values.size(); ++i) closed.values[i] = a.values[i] - closed.values[i];
    Matrix weighted = gain;
    for (std::size_t i = 0; i < gain.rows; ++i) {
      for (std::size_t j = 0; j < n; ++j) weighted.at(i, j) *= r[i];
    }
    Matrix next = product(transposed(closed), product(p, closed));
    const Matrix effort = product(transposed(gain), weighted);
    double change = 0;
    double size = 0;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        next.at(i, j) += (i == j ? q[i] : 0) + effort.at(i, j);
        change = std::max(change, std::abs(next.at(i, j) - p.at(i, j)));
        size = std::max(size, std::abs(next.at(i, j)));
      }
    }
    if (!std::isfinite(size)) break;
    p = std::move(next);
    if (change < kSettled * size) return gain;
  }
  throw std::runtime_error("the Riccati equation does not converge, so this plant cannot be stabilised");
}

}  // namespace closed_loop
