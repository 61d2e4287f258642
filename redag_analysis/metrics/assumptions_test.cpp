// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/assumptions.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/testing/builders.hpp"

namespace redag::metrics {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;
using ::testing::HasSubstr;

constexpr Duration kUs = kMicrosecond;
constexpr Duration kMs = kMillisecond;
constexpr Duration kBound = 3 * kMs;

Workload two_tasks() {
  return make_workload({make_dag("fast", {{.name = "imu", .period = 10, .wcet = 1}}),
                        make_dag("slow", {{.name = "plan", .period = 50, .wcet = 20}})},
                       1, PreemptionMode::Os);
}

// The measured overheads of a quiet machine.
Overheads quiet() {
  return {.timer = 5 * kUs,
          .dispatch = 50 * kUs,
          .preempt = 10 * kUs,
          .lateness = 100 * kUs,
          .stall = {.longest = 300 * kUs, .per_second = 2 * kMs},
          .noise = {.longest = 60 * kUs, .per_second = 1 * kMs},
          .clock = kUs};
}

struct Times {
  Duration seen = 0;   // after the release
  Duration start = 0;  // after the release
  Duration on_worker = kMs;
  Duration processor = kMs;
  Duration response = kMs;
};

// Jobs of a run on threads, each 10 ms after the one before.
class Jobs {
 public:
  Jobs &add(std::uint32_t task, const Times &times) {
    jobs_.push_back({TaskId(task), static_cast<Time>(jobs_.size()) * 10 * kMs, times});
    return *this;
  }
  Jobs &add(std::size_t count, std::uint32_t task, const Times &times) {
    for (std::size_t i = 0; i < count; ++i) add(task, times);
    return *this;
  }
  Jobs &at_once_with_the_last() {
    jobs_.back().release -= 10 * kMs;
    return *this;
  }

  [[nodiscard]] AssumptionCheck check(const std::optional<Overheads> &calibrated,
                                      const Workload &workload = two_tasks()) const {
    trace::RunInfo run;
    run.workload = workload;
    run.config.workers = 1;
    run.driver = trace::Driver::Threads;
    if (calibrated) run.overheads = to_string(*calibrated);
    return check_assumptions(run, events(), [](TaskId task) { return task == TaskId(0) ? kBound : Duration{0}; });
  }

 private:
  struct OneJob {
    TaskId task;
    Time release = 0;
    Times times;
  };

  [[nodiscard]] std::vector<JobEvent> events() const {
    std::vector<JobEvent> events;
    for (std::size_t i = 0; i < jobs_.size(); ++i) {
      const OneJob &job = jobs_[i];
      const auto add = [&](JobEventKind kind, Time time, std::int64_t value) {
        JobEvent event;
        event.time = time;
        event.value = value;
        event.task = job.task;
        event.job = static_cast<std::uint32_t>(i);
        event.worker = 0;
        event.kind = kind;
        events.push_back(event);
      };
      const Time start = job.release + std::max(job.times.seen, job.times.start);
      const Time finish = job.release + job.times.response;
      add(JobEventKind::Released, job.release + job.times.seen, job.release);
      add(JobEventKind::Dispatched, start, finish);
      if (start + job.times.on_worker < finish) {  // it lost its worker, and got it back at its finish
        add(JobEventKind::Preempted, start + job.times.on_worker, 0);
        add(JobEventKind::Resumed, finish, 0);
      }
      add(JobEventKind::Executed, finish, job.times.processor);
      add(JobEventKind::Finished, finish, finish);
    }
    std::stable_sort(events.begin(), events.end(),
                     [](const JobEvent &a, const JobEvent &b) { return a.time < b.time; });
    return events;
  }

  std::vector<OneJob> jobs_;
};

ExecutionCheck execution(const Jobs &jobs, const std::optional<Overheads> &calibrated = quiet()) {
  return jobs.check(calibrated).tasks.at(0).execution;
}

ResponseCheck response(const Jobs &jobs, const std::optional<Overheads> &calibrated = quiet()) {
  return jobs.check(calibrated).tasks.at(0).response;
}

std::string text(const Jobs &jobs, const std::optional<Overheads> &calibrated = quiet()) {
  const std::vector<Remark> all = remarks(jobs.check(calibrated), two_tasks());
  return all.empty() ? "" : (all.front().is_alarm ? "alarm " : "note ") + all.front().text;
}

// ---- executions ----

TEST(Execution, IsProcessorTime) {
  const Jobs preempted = Jobs().add(100, 0, {.on_worker = 2 * kMs, .processor = kMs, .response = 2 * kMs});
  EXPECT_EQ(execution(preempted).above, 0U) << "it held its worker for longer, and did not execute for longer";
  EXPECT_EQ(text(preempted), "");
}

TEST(Execution, WhatTheClockExplainsIsNotAbove) {
  EXPECT_EQ(execution(Jobs().add(100, 0, {.processor = kMs + 11 * kUs})).above, 0U);
  EXPECT_EQ(execution(Jobs().add(100, 0, {.processor = kMs + 12 * kUs})).above, 100U);
}

TEST(Execution, AnOverrunOfATwentiethInEveryJobIsAnAlarm) {
  const Jobs jobs = Jobs().add(100, 0, {.processor = kMs + 50 * kUs});
  EXPECT_TRUE(execution(jobs).is_exceeded);
  EXPECT_EQ(text(jobs),
            "alarm fast.imu: wcet exceeded: 1.05ms of processor time, 100 of 100 executions exceeded the wcet of 1ms");
}

TEST(Execution, OneBeyondAnyStallIsAnAlarm) {
  Jobs jobs;
  jobs.add(1000, 0, {});
  EXPECT_FALSE(execution(Jobs(jobs).add(0, {.processor = kMs + 130 * kUs})).is_exceeded) << "twice 60 us, and 1 us";
  EXPECT_TRUE(execution(Jobs(jobs).add(0, {.processor = kMs + 140 * kUs})).is_exceeded);
}

TEST(Execution, AFewThatStallsExplainAreANote) {
  const Jobs jobs = Jobs().add(1000, 0, {}).add(5, 0, {.processor = kMs + 60 * kUs});
  EXPECT_FALSE(execution(jobs).is_exceeded);
  EXPECT_EQ(text(jobs),
            "note fast.imu: 5 of 1 005 executions exceeded the wcet of 1ms, with up to 1.06ms of processor time; "
            "stalls of the machine can explain this");
}

// The hypervisor stopped the machine, and the kernel charged the job for that time. The release timer was late as well.
TEST(Execution, WhileTheTimerStoodStillIsThePlatform) {
  Jobs stopped;
  stopped.add(100, 0, {}).add(0, {.on_worker = 90 * kMs, .processor = 89 * kMs, .response = 90 * kMs});
  EXPECT_TRUE(execution(stopped).is_exceeded);
  stopped.add(0, {.seen = 78 * kMs, .start = 78 * kMs, .response = 80 * kMs});
  EXPECT_FALSE(execution(stopped).is_exceeded);
  EXPECT_EQ(execution(stopped).above, 1U);
}

TEST(Execution, WithoutACalibrationMoreIsNoise) {
  const Jobs jobs = Jobs().add(1000, 0, {}).add(0, {.processor = kMs + 900 * kUs});
  EXPECT_TRUE(execution(jobs).is_exceeded);
  EXPECT_FALSE(execution(jobs, std::nullopt).is_exceeded);
  EXPECT_TRUE(execution(Jobs().add(100, 0, {.processor = kMs + 200 * kUs}), std::nullopt).is_exceeded) << "every job";
}

TEST(Execution, ShortJobsAreChargedTheirDispatch) {
  Workload workload = two_tasks();
  workload.dags[0].tasks[0].wcet = 2 * kUs;
  const Jobs jobs = Jobs().add(50, 0, {.on_worker = 9 * kUs, .processor = 9 * kUs, .response = 9 * kUs});
  EXPECT_EQ(jobs.check(quiet(), workload).tasks[0].execution.above, 0U);
}

DurationSketch times(std::size_t count, Duration time, std::size_t most_exact = 1000) {
  DurationSketch sketch(most_exact);
  for (std::size_t i = 0; i < count; ++i) sketch.add(time);
  return sketch;
}

TEST(Noise, IsHeldToMarkov) {
  const Loss noise{.longest = 100, .per_second = 10 * kMs};  // in an execution of 1 us: 10 ns
  EXPECT_FALSE(is_beyond_noise(times(0, 0), 10, 1000, noise));
  EXPECT_FALSE(is_beyond_noise(times(4, 20), 4, 1000, noise)) << "too few to tell";
  EXPECT_FALSE(is_beyond_noise(times(50, 20), 100, 1000, noise)) << "half of them can meet that much";
  EXPECT_TRUE(is_beyond_noise(times(95, 20), 100, 1000, noise));
  EXPECT_TRUE(is_beyond_noise(times(50, 60), 100, 1000, noise)) << "a sixth of them can";
  EXPECT_TRUE(is_beyond_noise(times(1, 211), 100, 1000, noise));
  EXPECT_FALSE(is_beyond_noise(times(1, 210), 100, 1000, noise));
}

TEST(Noise, OfMoreTimesThanAreKeptIsJudgedTheSame) {
  const Loss noise{.longest = 100, .per_second = 10 * kMs};
  for (const Duration time : {20, 60}) {
    for (const std::size_t count : {4U, 50U, 95U}) {
      EXPECT_EQ(is_beyond_noise(times(count, time, 2), 100, 1000, noise),
                is_beyond_noise(times(count, time), 100, 1000, noise));
    }
  }
}

TEST(Noise, IsSeenInPercentiles) {
  const auto is_alarm = [](const ExecutionPercentiles &executions,
                           const std::optional<Overheads> &calibrated = std::nullopt) {
    return is_beyond_noise(executions, 2 * kMs, calibrated);
  };
  EXPECT_FALSE(is_alarm({}));
  EXPECT_FALSE(is_alarm({.jobs = 1000, .p50 = 2 * kMs, .p99 = 2 * kMs, .longest = 2 * kMs}));
  EXPECT_FALSE(is_alarm({.jobs = 1000, .p50 = 2 * kMs, .p99 = 2 * kMs, .longest = 4 * kMs})) << "one stall";
  EXPECT_TRUE(is_alarm({.jobs = 1000, .p50 = 2 * kMs, .p99 = 2 * kMs, .longest = 5 * kMs})) << "longer than a stall";
  EXPECT_TRUE(is_alarm({.jobs = 1000, .p50 = 3 * kMs, .p99 = 3 * kMs, .longest = 3 * kMs})) << "every job";
  EXPECT_FALSE(is_alarm({.jobs = 8, .p50 = 3 * kMs, .p99 = 3 * kMs, .longest = 3 * kMs})) << "too few to tell";
  EXPECT_FALSE(is_alarm({.jobs = 1000, .p50 = 2 * kMs, .p99 = 3 * kMs, .longest = 3 * kMs})) << "one of 32 can";
  EXPECT_FALSE(is_alarm({.jobs = 1000, .p50 = 2200 * kUs, .p99 = 2200 * kUs, .longest = 2200 * kUs}))
      << "the histogram is no more exact";
  Overheads exact = quiet();
  exact.noise = {.longest = kMs, .per_second = 0};
  EXPECT_FALSE(is_alarm({.jobs = 400, .p50 = 2 * kMs, .p99 = 3 * kMs, .longest = 3 * kMs}, exact)) << "too few to tell";
  EXPECT_TRUE(is_alarm({.jobs = 1000, .p50 = 2 * kMs, .p99 = 3 * kMs, .longest = 3 * kMs}, exact)) << "ten and more";
}

// ---- responses ----

TEST(Response, WithinTheBoundIsNothing) { EXPECT_EQ(response(Jobs().add(10, 0, {.response = kBound})).exceeded, 0U); }

TEST(Response, NamesTheTaskWhoseWcetBroke) {
  const Jobs jobs = Jobs()
                        .add(0, {.start = kMs, .response = 4 * kMs})
                        .add(1, {.on_worker = 25 * kMs, .processor = 25 * kMs, .response = 26 * kMs})
                        .at_once_with_the_last();
  const ResponseCheck broken = response(jobs);
  EXPECT_EQ(broken.broken, Broken::Wcet);
  EXPECT_EQ(broken.task, TaskId(1));
  EXPECT_TRUE(broken.is_alarm);
  EXPECT_TRUE(response(jobs, std::nullopt).is_alarm) << "calibrated or not";
  const std::vector<Remark> all = remarks(jobs.check(quiet()), two_tasks());
  EXPECT_THAT(all.at(0).text, HasSubstr("wcet exceeded: slow.plan used 25ms of processor time"));
}

TEST(Response, NamesALateRelease) {
  const Jobs jobs = Jobs().add(0, {.seen = 2500 * kUs, .start = 2500 * kUs, .response = 3500 * kUs});
  EXPECT_EQ(response(jobs).broken, Broken::Release);
  EXPECT_EQ(text(jobs),
            "alarm fast.imu: 1 response exceeded the bound of 3ms, the longest is 3.5ms; late release: by 2.5ms "
            "(the calibration allows 100us)");
}

TEST(Response, NamesThePlatform) {
  const Jobs jobs = Jobs().add(0, {.on_worker = 3500 * kUs, .response = 3500 * kUs});
  EXPECT_EQ(response(jobs).broken, Broken::Platform);
  EXPECT_EQ(text(jobs),
            "alarm fast.imu: 1 response exceeded the bound of 3ms, the longest is 3.5ms; machine: jobs that held "
            "their workers got no processor for 2.5ms (the calibration allows 300us)");
}

TEST(Response, OfThePlatformOnlyWhatWasNotCharged) {
  const Jobs jobs = Jobs().add(0, {.seen = 90 * kUs, .on_worker = kMs + 300 * kUs, .response = 3500 * kUs});
  EXPECT_EQ(response(jobs).broken, Broken::Nothing);
  EXPECT_THAT(text(jobs), HasSubstr("every assumption of the bound that can be checked held"));
  EXPECT_TRUE(response(jobs).is_alarm);
}

TEST(Response, WithoutACalibrationANoteUpToPlausibleNoise) {
  const Jobs jobs = Jobs().add(0, {.on_worker = 3500 * kUs, .response = 3500 * kUs});
  EXPECT_FALSE(response(jobs, std::nullopt).is_alarm);
  EXPECT_EQ(text(jobs, std::nullopt),
            "note fast.imu: 1 response exceeded the bound of 3ms, the longest is 3.5ms; machine: jobs that held "
            "their workers "
            "got no processor for 2.5ms (the analysis allows none)");
  const Jobs more = Jobs().add(0, {.on_worker = 30 * kMs, .response = 30 * kMs});
  EXPECT_TRUE(response(more, std::nullopt).is_alarm);
}

TEST(Assumptions, OfSeveralRunsAreAddedUp) {
  AssumptionCheck sum = Jobs().add(0, {.response = 4 * kMs}).check(quiet());
  sum.add(Jobs().add(0, {.seen = 4 * kMs, .start = 4 * kMs, .response = 5 * kMs}).check(quiet()));
  EXPECT_EQ(sum.tasks[0].response.exceeded, 2U);
  EXPECT_EQ(sum.tasks[0].response.worst, 5 * kMs);
  EXPECT_EQ(sum.tasks[0].response.broken, Broken::Release);
  EXPECT_EQ(sum.tasks[0].execution.jobs, 2U);
  EXPECT_TRUE(sum.has_alarms());
}

TEST(Assumptions, ProcessorTimeComesFromTheTrace) {
  trace::RunInfo run;
  run.workload = two_tasks();
  run.config.workers = 1;
  run.driver = trace::Driver::Threads;
  std::vector<JobEvent> events;
  const auto add = [&](JobEventKind kind, Time time, std::int64_t value) {
    JobEvent event;
    event.time = time;
    event.value = value;
    event.task = TaskId(0);
    event.worker = 0;
    event.kind = kind;
    events.push_back(event);
  };
  add(JobEventKind::Released, 10, 0);
  add(JobEventKind::Ready, 10, 0);
  add(JobEventKind::Dispatched, 10, 10 * kMs);
  add(JobEventKind::Started, 12, 12);
  add(JobEventKind::Executed, 2 * kMs, 1300 * kUs);
  add(JobEventKind::Finished, 2 * kMs, 2 * kMs);
  const AssumptionCheck check = check_assumptions(run, events, [](TaskId) { return kMs; });
  EXPECT_FALSE(check.is_calibrated);
  EXPECT_EQ(check.tasks[0].execution.jobs, 1U);
  EXPECT_EQ(check.tasks[0].execution.longest, 1300 * kUs);
  EXPECT_EQ(check.tasks[0].response.exceeded, 1U);
  run.overheads = to_string(quiet());
  EXPECT_TRUE(check_assumptions(run, events, [](TaskId) { return kMs; }).is_calibrated);
}

}  // namespace
}  // namespace redag::metrics
