// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/preemption_point.hpp"

#include "redag/engine/running_job.hpp"

namespace redag {
namespace runtime::detail {

constinit thread_local RunningJob *current_job = nullptr;

}  // namespace runtime::detail

void preemption_point() {
  runtime::RunningJob *job = runtime::RunningJob::current();
  if (job == nullptr) return;
  if (job->limit != kNever) {
    const Duration used = job->cpu_time();
    if (used > job->limit) job->reach_limit(used);
  }
  if (job->outranked->load(std::memory_order_relaxed)) job->reach_preemption_point();
}

Duration job_cpu_time() {
  const runtime::RunningJob *job = runtime::RunningJob::current();
  return job == nullptr ? 0 : job->cpu_time();
}

}  // namespace redag
