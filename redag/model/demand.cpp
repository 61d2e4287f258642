// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/model/demand.hpp"

#include <algorithm>
#include <cmath>

#include "redag/base/rng.hpp"

namespace redag {
namespace {

// Two streams for each task: adding jitter to a workload does not change its execution times.
Rng job_rng(std::uint64_t seed, TaskId id, std::uint32_t number, unsigned stream) {
  return Rng::stream(seed, std::uint64_t{id.value} * 2 + stream, number);
}

}  // namespace

Duration execution_time(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed) {
  using Kind = ExecutionTime::Kind;
  const ExecutionTime &model = task.execution;
  if (model.kind == Kind::Constant) return task.wcet;
  Rng rng = job_rng(seed, id, number, 0);
  switch (model.kind) {
    case Kind::Uniform: return std::max<Duration>(1, rng.uniform(task.bcet, task.wcet));
    case Kind::Normal: {
      const double drawn = static_cast<double>(model.mean) + static_cast<double>(model.stddev) * rng.normal();
      const double bounded =
          std::clamp(std::round(drawn), static_cast<double>(task.bcet), static_cast<double>(task.wcet));
      return std::clamp<Duration>(static_cast<Duration>(bounded), std::max<Duration>(1, task.bcet), task.wcet);
    }
    case Kind::Empirical: {
      const auto last = static_cast<std::int64_t>(model.samples.size()) - 1;
      return std::max<Duration>(1, model.samples[static_cast<std::size_t>(rng.uniform(0, last))]);
    }
    case Kind::Constant: break;
  }
  return task.wcet;
}

Duration release_jitter(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed) {
  return task.jitter == 0 ? 0 : job_rng(seed, id, number, 1).uniform(0, task.jitter);
}

bool demand_varies(const Task &task) {
  using Kind = ExecutionTime::Kind;
  if (task.jitter > 0) return true;
  const ExecutionTime &model = task.execution;
  const bool has_range = std::max<Duration>(1, task.bcet) < task.wcet;
  switch (model.kind) {
    case Kind::Constant: return false;
    case Kind::Uniform: return has_range;
    case Kind::Normal: return has_range && model.stddev > 0;
    case Kind::Empirical: {
      const auto [least, most] = std::minmax_element(model.samples.begin(), model.samples.end());
      return std::max<Duration>(1, *least) < *most;
    }
  }
  return false;
}

}  // namespace redag
