// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/spins.hpp"

#include <algorithm>
#include <limits>

#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"

namespace redag::runtime {
namespace {

constexpr std::uint32_t kSample = 256;

// Returns the time of the fastest of a few samples: the others were interrupted.
Duration measure() {
  Parker parker;
  Duration fastest = kNever;
  for (int i = 0; i < 8; ++i) {
    const Time begin = monotonic_now();
    static_cast<void>(parker.spin(kSample));
    fastest = std::min(fastest, monotonic_now() - begin);
  }
  return std::max<Duration>(fastest, 1);
}

}  // namespace

std::uint32_t spins_in(Duration duration) {
  static const Duration sample = measure();
  const double spins = static_cast<double>(duration) * kSample / static_cast<double>(sample);
  return static_cast<std::uint32_t>(
      std::clamp(spins, duration > 0 ? 1.0 : 0.0, static_cast<double>(std::numeric_limits<std::uint32_t>::max())));
}

std::uint32_t spins_before_sleep(Setup &setup, Duration spin) {
  if (spin <= 0) return 0;
  if (setup.mode.mode != PreemptionMode::Os) return spins_in(spin);
  setup.warnings.push_back("workers do not spin in this mode: spinning needs preemption none or cooperative");
  return 0;
}

}  // namespace redag::runtime
