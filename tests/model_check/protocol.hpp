// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Shared by the protocol tests: an engine whose every job is watched, and the exploration of a scenario with it.
//
// Watching a job is an operation of the explorer only where the engine itself must keep two things apart. As long as
// the engine does so, watching adds no executions. If it does not, every order is explored.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/lock_class.hpp"
#include "redag/engine/engine.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/engine/running_job.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/explorer.hpp"

namespace redag::model_check {

using runtime::Engine;
using runtime::Job;
using sched::Outcome;
using sched::Preemption;
using testing::Exploration;
using testing::ExploreOptions;
using testing::ladder;
namespace explored = testing::explored;

/// Explores all of `scenario`, prints the size of the exploration, and expects that no check fails.
inline Exploration expect_holds(const std::function<void()> &scenario, ExploreOptions options = {}) {
  if (const char *most = std::getenv("REDAG_EXPLORE")) options.max_executions = std::strtoull(most, nullptr, 10);
  const testing::ThreadState running_job{
      [] { return reinterpret_cast<std::uintptr_t>(runtime::RunningJob::current()); },
      [](std::uintptr_t job) { runtime::RunningJob::set_current(reinterpret_cast<runtime::RunningJob *>(job)); }};
  const testing::ThreadState bounded_locks{
      [] { return std::uintptr_t{detail::bounded_locks}; },
      [](std::uintptr_t count) { detail::bounded_locks = static_cast<std::uint32_t>(count); }};
  const testing::ThreadState must_react{
      [] { return std::uintptr_t{detail::must_react}; },
      [](std::uintptr_t count) { detail::must_react = static_cast<std::uint32_t>(count); }};
  Exploration all = testing::explore(scenario, options, {running_job, bounded_locks, must_react});
  const auto *test = ::testing::UnitTest::GetInstance()->current_test_info();
  std::printf(
      "[  STATES  ] %s.%s: %llu executions (+ %llu cut short), %llu transitions, up to %u in one, %u threads%s\n",
      test->test_suite_name(), test->name(), static_cast<unsigned long long>(all.executions),
      static_cast<unsigned long long>(all.redundant), static_cast<unsigned long long>(all.transitions), all.longest,
      all.threads, all.complete ? "" : " (not complete)");
  EXPECT_EQ(all.failure, "");
  EXPECT_TRUE(all.complete);
  return all;
}

/// Counts the jobs within a region. Entering and leaving are operations of the explorer.
class Room {
 public:
  explicit Room(int most) : most_(most) {}
  void enter() {
    explored::write(object_, "enter");
    explored::check(++count_ <= most_, "more jobs at a time than the bound allows");
  }
  void leave() {
    explored::write(object_, "leave");
    --count_;
  }

 private:
  int most_;
  int count_ = 0;
  testing::ObjectId object_ = explored::new_object();
};

/// Checks that no job is in progress from begin() to end().
class Quiet {
 public:
  void begin() {
    explored::write(object_, "quiet");
    explored::check(inside_ == 0, "a job is in progress after it was promised that none is");
    quiet_ = true;
  }
  void end() {
    explored::write(object_, "quiet ends");
    quiet_ = false;
  }
  void job_begins() {
    explored::read(object_, "job begins");
    explored::check(!quiet_, "a job begins after it was promised that none does");
    ++inside_;
  }
  void job_ends() {
    explored::read(object_, "job ends");
    explored::check(!quiet_, "a job ends after it was promised that none is in progress");
    --inside_;
  }

 private:
  bool quiet_ = false;
  int inside_ = 0;
  testing::ObjectId object_ = explored::new_object();
};

/// Lets a thread wait until something has happened `count` times. It does not use the engine's primitives, whose errors
/// it would share.
class Countdown {
 public:
  explicit Countdown(int count) : left_(count) {}
  void count() {
    explored::write(object_, "count");
    --left_;
    if (left_ == 0) explored::wake(object_, 100);
  }
  void wait() {
    while (explored::wait(
               object_, [this] { return left_ > 0; }, explored::kForever) &&
           left_ > 0) {
    }
  }

 private:
  int left_;
  testing::ObjectId object_ = explored::new_object();
};

struct Platform {
  Preemption preemption = Preemption::None;
  std::uint32_t workers = 1;
  std::uint32_t threads = 0;  // full preemption: jobs that can be in progress
  bool start_paused = false;
  std::size_t trace_capacity = 0;
  std::uint32_t spins = 0;          // looks for a job before a thread sleeps
  std::uint32_t spare_threads = 0;  // for jobs that block
};

/// An engine with given task bodies. Checks that every job runs once, and that the scheduler's counts match.
class Machine {
 public:
  using Work = std::function<Outcome(const Job &)>;

  Machine(const Workload &workload, const Platform &platform, std::vector<Work> works)
      : works_(std::move(works)), ran_(works_.size()) {
    runtime::EngineOptions options;
    options.config.workers = platform.workers;
    options.config.preemption = platform.preemption;
    options.config.policy = workload.policy;
    if (platform.preemption == Preemption::Full) {
      options.config.max_started = platform.threads;
      options.config.levels = 8;
      options.band = runtime::PriorityBand{8, 9};
    }
    options.trace_capacity = platform.trace_capacity;
    options.spins = platform.spins;
    options.spare_threads = platform.spare_threads;
    options.on_exception = [this](const Job &, const std::exception_ptr &) { ++exceptions; };
    engine = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    std::vector<runtime::Body> bodies;
    for (std::size_t t = 0; t < works_.size(); ++t) {
      bodies.emplace_back([this, t](const Job &job) { return run(t, job); });
    }
    engine->bind(workload, std::move(bodies));
    if (platform.start_paused) engine->pause();
  }

  void start() { explored::check(engine->start().has_value(), "the engine does not start"); }
  /// Calls start() and waits until the threads sleep; not explored.
  void start_calmly() {
    explored::calm(true);
    start();
    explored::settle();
    explored::calm(false);
  }
  /// Calls finish() once no thread can go on; not explored.
  void finish_calmly() {
    explored::settle();
    explored::calm(true);
    finish();
  }
  /// Runs enough jobs of the first `tasks` tasks, one after the other, for them to be expected to be tiny; not
  /// explored.
  void run_tiny_jobs(std::size_t tasks) {
    explored::calm(true);
    for (std::size_t i = 0; i < tasks * runtime::TaskEntry::kStreak; ++i) {
      release(i % tasks);
      explored::settle();
    }
    explored::calm(false);
  }
  void release(std::size_t task) { engine->release(TaskId(task), 0); }

  /// Halts, waits, ends the threads, and compares the jobs that ran with the counts.
  void finish() {
    engine->halt();
    explored::check(engine->wait_idle(kNever), "wait_idle() for ever came back without");
    quiet.begin();
    explored::check(engine->started().empty(), "idle, and a job has started and not ended");
    engine->join();
    for (std::size_t t = 0; t < works_.size(); ++t) {
      const sched::Accounting jobs = engine->figures(TaskId(t)).jobs;
      explored::check(jobs.finished + jobs.aborted == ran_[t].size(),
                      "not every job that ended has run, or vice versa");
      explored::check(jobs.in_flight() <= 1, "more than one job of a task waits");
    }
  }
  /// The body of a task, for its next jobs.
  [[nodiscard]] Work &work(std::size_t task) { return works_[task]; }
  [[nodiscard]] std::size_t ran(std::size_t task) const { return ran_[task].size(); }

  std::unique_ptr<Engine> engine;
  Quiet quiet;
  int exceptions = 0;

 private:
  Outcome run(std::size_t t, const Job &job) {
    quiet.job_begins();
    explored::check(job.task.value == t, "a job runs another task's body");
    // Jobs of a task follow each other, and each begins only once.
    explored::check(ran_[t].empty() || ran_[t].back() < job.number, "a job runs twice, or before an earlier one");
    ran_[t].push_back(job.number);
    struct Leave {
      Quiet &quiet;
      ~Leave() { quiet.job_ends(); }
    } leave{quiet};
    return works_[t] ? works_[t](job) : Outcome::Finished;
  }

  std::vector<Work> works_;
  std::vector<std::vector<std::uint32_t>> ran_;
};

}  // namespace redag::model_check
