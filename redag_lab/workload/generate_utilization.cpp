// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/workload/generate_utilization.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "redag/base/check.hpp"

namespace redag::lab {
namespace {

using Vector = std::vector<double>;

double sum(const Vector &values) { return std::accumulate(values.begin(), values.end(), 0.0); }

/// Draws a point uniformly on the standard simplex (the flat Dirichlet distribution).
Vector draw_simplex(std::size_t count, Rng &rng) {
  Vector point(count);
  for (double &x : point) x = -std::log(1.0 - rng.uniform01());
  const double total = sum(point);
  for (double &x : point) x /= total;
  return point;
}

/// The points of the simplex with x >= violated form a smaller simplex. This maps that simplex onto the whole one,
/// repeatedly while the point stays inside. One application is x -> (x - v) / (1 - sum v), a dilation about v / sum v.
/// Its powers therefore have a closed form.
void expand(Vector &point, const Vector &violated) {
  const double total = sum(violated);
  const double scale = 1.0 - total;
  double power = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < point.size(); ++i) {
    const double centre = violated[i] / total;
    if (point[i] < centre) power = std::min(power, std::log(1.0 - point[i] / centre) / std::log(scale));
  }
  // Takes the largest whole power strictly inside. A point at the centre moves nowhere; one step shows this.
  power = std::isfinite(power) ? std::max(1.0, std::ceil(power) - 1.0) : 1.0;
  const double factor = std::pow(scale, power);
  for (std::size_t i = 0; i < point.size(); ++i) {
    const double centre = violated[i] / total;
    point[i] = centre + (point[i] - centre) / factor;
  }
}

/// Moves `point` until it keeps the limits. Returns false if rounding errors, which every step magnifies, grow too
/// large.
bool rescale(Vector &point, const Vector &limits) {
  constexpr int kMaxRescales = 1000;
  constexpr double kEpsilon = 1e-9;
  Vector violated(point.size());
  for (int round = 0; round < kMaxRescales; ++round) {
    bool any = false;
    for (std::size_t i = 0; i < point.size(); ++i) {
      const bool over = point[i] > limits[i];
      violated[i] = over ? limits[i] : 0.0;
      any = any || over;
    }
    if (!any) return std::all_of(point.begin(), point.end(), [](double x) { return x >= 0; });
    expand(point, violated);
    const double total = sum(point);
    if (!(std::abs(total - 1.0) < kEpsilon)) return false;
  }
  return false;
}

}  // namespace

std::optional<Vector> drs(double total, const Vector &upper, Rng &rng) {
  REDAG_CHECK(total > 0 && !upper.empty(), "there is something to share");
  Vector limits(upper.size());
  std::transform(upper.begin(), upper.end(), limits.begin(), [total](double u) { return std::min(1.0, u / total); });
  const double slack = sum(limits) - 1.0;
  constexpr double kNoChoice = 1e-12;
  if (slack <= kNoChoice) {
    if (slack < -kNoChoice) return std::nullopt;
    for (double &x : limits) x *= total;
    return limits;  // every task at its bound
  }
  // With tight bounds (sum of limits below 2), the simplex of the slacks limit - x is the smaller one. Then the slacks
  // are drawn.
  const bool draw_slacks = slack < 1.0;
  Vector bounds = limits;
  if (draw_slacks) {
    for (double &x : bounds) x /= slack;
  }
  constexpr int kAttempts = 1000;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    Vector point = draw_simplex(upper.size(), rng);
    if (!rescale(point, bounds)) continue;
    for (std::size_t i = 0; i < point.size(); ++i) {
      const double share = draw_slacks ? limits[i] - slack * point[i] : point[i];
      point[i] = std::clamp(share * total, 0.0, upper[i]);
    }
    return point;
  }
  return std::nullopt;
}

}  // namespace redag::lab
