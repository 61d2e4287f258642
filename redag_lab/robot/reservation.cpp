// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/reservation.hpp"

namespace redag::robot {
namespace {

// Periods are at most 4 s and ticks 10 ms, so that their product does not overflow.
Duration divided_up(Duration a, Duration b) { return (a + b - 1) / b; }

}  // namespace

ReservedLoad load_of(const Reservation &reservation) {
  const auto [budget, period, tick] = reservation;
  if (budget == period) return {period, period, 0};
  const Duration rest = period - budget;
  const Duration jitter = rest + divided_up(2 * tick * period, budget) - tick;
  const Duration jobs = divided_up(jitter, rest);
  return {jobs * budget, jobs * period, jitter};
}

}  // namespace redag::robot
