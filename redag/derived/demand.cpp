// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/derived/demand.hpp"

#include <algorithm>
#include <cmath>

#include "redag/derived/rng.hpp"
#include "redag/derived/waits.hpp"

namespace redag {
namespace {

// Two streams for each task: adding jitter to a workload does not change its execution times. Waits have a seed of
// their own for the same reason.
constexpr std::uint64_t kSeedOfWaits = 0x7761697473ULL;

Rng job_rng(std::uint64_t seed, TaskId id, std::uint32_t number, unsigned stream) {
  return Rng::stream(seed, std::uint64_t{id.value} * 2 + stream, number);
}

Duration draw_execution_time(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed) {
  using Distribution = ExecutionTime::Kind;
  const ExecutionTime &model = task.execution;
  if (model.kind == Distribution::Constant) return task.wcet;
  Rng rng = job_rng(seed, id, number, 0);
  switch (model.kind) {
    case Distribution::Uniform: return std::max<Duration>(1, rng.uniform(task.bcet, task.wcet));
    case Distribution::Normal: {
      const double drawn = static_cast<double>(model.mean) + static_cast<double>(model.stddev) * rng.normal();
      const double bounded =
          std::clamp(std::round(drawn), static_cast<double>(task.bcet), static_cast<double>(task.wcet));
      return std::clamp<Duration>(static_cast<Duration>(bounded), std::max<Duration>(1, task.bcet), task.wcet);
    }
    case Distribution::Empirical: {
      const auto last = static_cast<std::int64_t>(model.samples.size()) - 1;
      return std::max<Duration>(1, model.samples[static_cast<std::size_t>(rng.uniform(0, last))]);
    }
    case Distribution::Constant: break;
  }
  return task.wcet;
}

}  // namespace

Duration execution_time(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed) {
  const Duration drawn = draw_execution_time(task, id, number, seed);
  return task.waits.empty() ? drawn : std::max(drawn, shortest_demand(task));
}

Duration wait_time(const Task &task, TaskId id, std::uint32_t number, std::size_t wait, std::uint64_t seed) {
  const Wait &drawn = task.waits[wait];
  if (drawn.shortest == 0 || drawn.shortest == drawn.longest) return drawn.longest;
  const std::uint64_t stream = (std::uint64_t{wait} << 32U) + id.value;
  return Rng::stream(seed ^ kSeedOfWaits, stream, number).uniform(drawn.shortest, drawn.longest);
}

Duration release_jitter(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed) {
  return task.jitter == 0 ? 0 : job_rng(seed, id, number, 1).uniform(0, task.jitter);
}

bool demand_varies(const Task &task) {
  using Distribution = ExecutionTime::Kind;
  if (task.jitter > 0) return true;
  const auto varies = [](const Wait &wait) { return wait.shortest > 0 && wait.shortest < wait.longest; };
  if (std::any_of(task.waits.begin(), task.waits.end(), varies)) return true;
  const ExecutionTime &model = task.execution;
  const bool has_range = std::max<Duration>(1, task.bcet) < task.wcet;
  switch (model.kind) {
    case Distribution::Constant: return false;
    case Distribution::Uniform: return has_range;
    case Distribution::Normal: return has_range && model.stddev > 0;
    case Distribution::Empirical: {
      const auto [least, most] = std::minmax_element(model.samples.begin(), model.samples.end());
      return std::max<Duration>(1, *least) < *most;
    }
  }
  return false;
}

}  // namespace redag
