// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a driver runs for each job: the body, and who is told when a job is skipped instead.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"
#include "redag/model/job_event.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::runtime {

/// Describes a job to its body.
struct Job {
  TaskId task;
  std::uint32_t number = 0;  // within its task, from 0
  Time release = 0;          // nominal
  Time origin = 0;           // the earliest release whose data it carries
  JobSlot slot;
  WorkerId worker;  // the scheduler's: threads are not tied to workers; with `os` the first one of the job
};

/// Runs one job. The engine turns a thrown redag::BudgetExceeded into Outcome::BudgetExceeded, and any other exception
/// into Outcome::Threw.
using Body = std::function<sched::Outcome(const Job &)>;

/// Called for every exception that leaves a body, on the worker's thread, before the job counts as ended. Must not
/// throw.
using ExceptionHandler = std::function<void(const Job &, std::exception_ptr)>;

/// Called when a released job is skipped before it starts, even inside release(), but not for miss(). Runs on the
/// thread that asked the scheduler for decisions, without the engine's lock.
class SkipListener {
 public:
  virtual ~SkipListener() = default;
  virtual void skipped(Reason reason) noexcept = 0;
};

}  // namespace redag::runtime
