// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Counts how often an explanation names the cause that a workload was built to have, and how often its remedy ends the
// miss: a hundred workloads for each kind.
// The oracle is the construction. In each, one job of "v.victim" misses its deadline by one known cause, whose size,
// place in time and company are drawn.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "redag/derived/rng.hpp"
#include "redag_analysis/metrics/why/why.hpp"
#include "redag_analysis/metrics/why/why_remedy.hpp"
#include "redag_analysis/metrics/why/why_text.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::metrics {
namespace {

using testing::between;
using testing::make_workload;
using testing::TestTask;

constexpr int kInjections = 100;

/// One constructed miss. Times are in microseconds.
struct Injection {
  Workload workload;
  sim::Options options = {};
  std::string culprit = {};  // "dag.task"; empty: no job causes it
  std::uint32_t max_started = 0;
  std::string overheads = {};
  bool end_to_end = false;
  std::uint32_t number = 0;  // of the victim's job
};

Dag dag_of(const char *name, const std::vector<TestTask> &tasks, std::uint32_t max_active = 0) {
  return testing::make_dag(name, tasks, max_active, kMicrosecond);
}

Duration drawn(Rng &rng, Duration low, Duration high) {
  return between(rng, static_cast<std::uint32_t>(low), static_cast<std::uint32_t>(high));
}

// Two tasks that run often and briefly, one more urgent than everything else and one less.
void add_company(Rng &rng, Workload &workload) {
  workload.dags.push_back(dag_of(
      "often", {{.name = "t", .period = drawn(rng, 800, 900), .wcet = drawn(rng, 1, 5), .offset = drawn(rng, 0, 50)}}));
  workload.dags.push_back(
      dag_of("rare", {{.name = "t", .period = 2'000'000, .wcet = drawn(rng, 1, 5), .offset = drawn(rng, 0, 50)}}));
}

// The victim: released at 1000 + something, executes 100 us, has to end within 400 us.
TestTask victim(Rng &rng, Duration period = 100'000) {
  return {.name = "victim", .period = period, .wcet = 100, .offset = drawn(rng, 1000, 3000), .deadline = 400};
}

// The culprit: executes long.
TestTask culprit(Rng &rng, Duration period, Duration offset) {
  return {.name = "culprit", .period = period, .wcet = drawn(rng, 1000, 9000), .offset = offset};
}

Injection queued(Rng &rng) {
  const TestTask job = victim(rng);
  const PreemptionMode mode = testing::chance(rng, 0.5) ? PreemptionMode::None : PreemptionMode::Os;
  return {.workload = make_workload(
              {dag_of("v", {job}), dag_of("c", {culprit(rng, 50'000, job.offset - drawn(rng, 0, 50))})}, 1, mode),
          .culprit = "c.culprit"};
}

Injection blocked(Rng &rng) {
  const TestTask job = victim(rng);
  return {.workload = make_workload(
              {dag_of("v", {job}), dag_of("c", {culprit(rng, 500'000, job.offset - drawn(rng, 1, 200))})}),
          .culprit = "c.culprit"};
}

Injection preempted(Rng &rng) {
  const TestTask job = victim(rng);
  return {.workload =
              make_workload({dag_of("v", {job}), dag_of("c", {culprit(rng, 50'000, job.offset + drawn(rng, 20, 60))})},
                            1, PreemptionMode::Os),
          .culprit = "c.culprit"};
}

Injection group(Rng &rng) {
  TestTask job = victim(rng);
  TestTask holder = culprit(rng, 500'000, job.offset - drawn(rng, 1, 200));
  job.group = holder.group = "g";
  return {.workload = make_workload({dag_of("v", {job}), dag_of("c", {holder})}, 2, PreemptionMode::Os),
          .culprit = "c.culprit"};
}

Injection max_active(Rng &rng) {
  const TestTask job = victim(rng);
  const TestTask sibling = culprit(rng, 500'000, job.offset - drawn(rng, 1, 200));
  return {.workload = make_workload({dag_of("v", {job, sibling}, 1)}, 2, PreemptionMode::Os), .culprit = "v.culprit"};
}

Injection predecessor(Rng &rng) {
  TestTask job = victim(rng);
  TestTask before = culprit(rng, job.period, job.offset);
  job.after = {1};
  return {.workload = make_workload({dag_of("v", {job, before})}, 2, PreemptionMode::Os), .culprit = "v.culprit"};
}

// The predecessor is released with a lag and executes briefly.
Injection unreleased(Rng &rng) {
  TestTask job = victim(rng);
  const TestTask before{
      .name = "culprit", .period = job.period, .wcet = 10, .offset = job.offset + drawn(rng, 1000, 9000)};
  job.after = {1};
  return {.workload = make_workload({dag_of("v", {job, before})}, 2, PreemptionMode::Os), .culprit = "v.culprit"};
}

// The data is there early, and its reader comes late.
Injection sampling(Rng &rng) {
  TestTask job = victim(rng);
  job.after = {1};
  const TestTask before{
      .name = "source", .period = job.period, .wcet = 10, .offset = job.offset - drawn(rng, 600, 1000)};
  Injection injection{.workload = make_workload({dag_of("v", {job, before})}, 2, PreemptionMode::Os)};
  injection.workload.dags[0].deadline = 400 * kMicrosecond;
  injection.end_to_end = true;
  return injection;
}

std::function<Duration(const Task &, TaskId, std::uint32_t)> longer(std::string name, Duration by) {
  return [name = std::move(name), by](const Task &task, TaskId, std::uint32_t number) {
    return task.wcet + (task.name == name && number == 0 ? by * kMicrosecond : 0);
  };
}

Injection overrun(Rng &rng) {
  Injection injection{.workload = make_workload({dag_of("v", {victim(rng)})}, 2, PreemptionMode::Os),
                      .culprit = "v.victim"};
  injection.options.demand = longer("victim", drawn(rng, 1000, 9000));
  return injection;
}

// A predecessor that executes longer than stated.
Injection predecessor_overrun(Rng &rng) {
  TestTask job = victim(rng);
  job.after = {1};
  const TestTask before{.name = "culprit", .period = job.period, .wcet = 50, .offset = job.offset};
  Injection injection{.workload = make_workload({dag_of("v", {job, before})}, 2, PreemptionMode::Os),
                      .culprit = "v.culprit"};
  injection.options.demand = longer("culprit", drawn(rng, 1000, 9000));
  return injection;
}

Injection release_late(Rng &rng) {
  Injection injection{.workload = make_workload({dag_of("v", {victim(rng)})}, 2, PreemptionMode::Os)};
  injection.options.jitter = [late = drawn(rng, 1000, 9000)](const Task &task, TaskId, std::uint32_t) {
    return task.name == "victim" ? late * kMicrosecond : 0;
  };
  return injection;
}

// The victim uses its budget before the less urgent culprit, which preempts it only then.
Injection demoted(Rng &rng) {
  const TestTask job = victim(rng);
  Injection injection{.workload = make_workload(
                          {dag_of("v", {job}), dag_of("c", {culprit(rng, 500'000, job.offset + drawn(rng, 0, 40))})}, 1,
                          PreemptionMode::Os),
                      .culprit = "c.culprit"};
  injection.workload.dags[0].tasks[0].budget = 60 * kMicrosecond;
  injection.workload.dags[0].tasks[0].on_budget = OnBudget::Demote;
  return injection;
}

// Job 0 takes longer than a period; job 1, the victim, waits for it although a worker is free.
Injection own_task(Rng &rng) {
  TestTask job = victim(rng, 1000);
  Injection injection{.workload = make_workload({dag_of("v", {job})}, 3, PreemptionMode::Os), .culprit = "v.victim"};
  injection.workload.dags[0].tasks[0].wcet = 20 * kMillisecond;
  injection.number = 1;
  const Duration longest = drawn(rng, 1500, 1900);
  injection.options.demand = [longest](const Task &task, TaskId, std::uint32_t number) {
    return task.name != "victim" ? task.wcet : (number == 0 ? longest : 10) * kMicrosecond;
  };
  return injection;
}

Injection no_thread(Rng &rng) {
  const TestTask job = victim(rng);
  return {.workload = make_workload(
              {dag_of("v", {job}), dag_of("c", {culprit(rng, 500'000, job.offset - drawn(rng, 60, 200))})}, 1,
              PreemptionMode::Os),
          .culprit = "c.culprit",
          .max_started = 1};
}

Injection overhead(Rng &rng) {
  Injection injection{.workload = make_workload({dag_of("v", {victim(rng)})}, 3, PreemptionMode::Os),
                      .culprit = "v.victim",
                      .overheads = "dispatch"};
  injection.options.overheads.dispatch = drawn(rng, 350, 700) * kMicrosecond;
  return injection;
}

// The victim waits until its next release, which replaces it.
Injection lost(Rng &rng) {
  const TestTask job = victim(rng, 600);
  return {
      .workload = make_workload(
          {dag_of("v", {job}),
           dag_of("c",
                  {{.name = "culprit", .period = 500'000, .wcet = 2000, .offset = job.offset - drawn(rng, 1, 50)}})}),
      .culprit = "c.culprit"};
}

// What the remedies say, done.
Task &task_named(Injection &injection, const std::string &name) {
  for (Dag &dag : injection.workload.dags) {
    for (Task &task : dag.tasks) {
      if (task.name == name) return task;
    }
  }
  throw std::out_of_range(name);
}
void add_worker(Injection &injection) { ++injection.workload.platform.workers; }
void preempt(Injection &injection) { injection.workload.platform.preemption = PreemptionMode::Os; }
void leave_group(Injection &injection) { task_named(injection, "culprit").group.clear(); }
void lift_max_active(Injection &injection) { injection.workload.dags[0].max_active = 0; }
void shorten(Injection &injection) {
  task_named(injection, "culprit").wcet = task_named(injection, "culprit").bcet = 1;
}
void release_earlier(Injection &injection) {
  task_named(injection, "culprit").offset = task_named(injection, "victim").offset;
}
void start_by_data(Injection &injection) { task_named(injection, "victim").activation = Activation::Data; }
void release_on_time(Injection &injection) { injection.options.jitter = {}; }
void raise_budget(Injection &injection) { task_named(injection, "victim").budget = kMillisecond; }
void overlap(Injection &injection) { task_named(injection, "victim").concurrency = 2; }
void add_threads(Injection &injection) { injection.max_started = 0; }

struct Kind {
  const char *name;
  Cause cause;
  Injection (*make)(Rng &);
  const char *remedy;                   // part of its words
  void (*mend)(Injection &) = nullptr;  // null: no change of the workload ends this miss
};

class WhyInjection : public ::testing::TestWithParam<Kind> {};

struct Named {
  std::string cause;  // as `wanted` would say it
  std::string remedy;
};

// Returns the main cause of the victim's miss in words.
Named named(const Injection &injection, std::uint64_t seed, std::string &all) {
  trace::RunInfo info = testing::run_info(injection.workload, "redag", seed);
  info.config.max_started = injection.max_started;
  info.overheads = injection.overheads;
  const trace::Trace trace = testing::simulated(std::move(info), 30 * kMillisecond, injection.options);
  const Investigation investigation = Investigation::of(trace).value();
  for (const Subject &miss : investigation.misses()) {
    const JobId &job = miss.job;
    if (trace::task_name(trace.info.workload, job.task) != "v.victim" || job.number != injection.number) continue;
    if (miss.end_to_end != injection.end_to_end) continue;
    const Explanation one = investigation.explain(std::vector{miss}).value()[0];
    for (const Part &part : one.parts) {
      all += std::to_string(part.length) + " " + describe(part, trace.info.workload, job) + "\n";
    }
    const Culprit main = culprits_of(one).front();
    return {std::string(to_string(main.cause)) + " " + name_of(main, trace.info.workload), remedy(main, trace.info)};
  }
  return {"no miss", {}};
}

TEST_P(WhyInjection, NamesTheCauseInAHundredOfAHundred) {
  const Kind &kind = GetParam();
  int right = 0;
  for (int i = 0; i < kInjections; ++i) {
    Rng rng(static_cast<std::uint64_t>(i));
    Injection injection = kind.make(rng);
    if (injection.overheads.empty()) add_company(rng, injection.workload);
    const std::string wanted = std::string(to_string(kind.cause)) + " " + injection.culprit;
    std::string all;
    const Named found = named(injection, static_cast<std::uint64_t>(i), all);
    right += found.cause == wanted ? 1 : 0;
    EXPECT_EQ(found.cause, wanted) << "injection " << i << ":\n" << all;
    EXPECT_THAT(found.remedy, ::testing::HasSubstr(kind.remedy));
    EXPECT_THAT(found.remedy, ::testing::HasSubstr(injection.culprit));
    if (kind.mend == nullptr) continue;
    kind.mend(injection);
    EXPECT_EQ(named(injection, static_cast<std::uint64_t>(i), all).cause, "no miss") << found.remedy;
  }
  RecordProperty("named_rightly", right);
  EXPECT_EQ(right, kInjections);
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, WhyInjection,
    ::testing::Values(Kind{"queued", Cause::Queued, queued, "add a worker", add_worker},
                      Kind{"blocked", Cause::Blocked, blocked, "preemption: os", preempt},
                      Kind{"preempted", Cause::Preempted, preempted, "add a worker", add_worker},
                      Kind{"group", Cause::Group, group, "a group of its own", leave_group},
                      Kind{"max_active", Cause::MaxActive, max_active, "raise max_active of v (now 1), or remove it",
                           lift_max_active},
                      Kind{"predecessor", Cause::Predecessor, predecessor, "shorten v.culprit", shorten},
                      Kind{"unreleased", Cause::Unreleased, unreleased, "earlier (offset)", release_earlier},
                      Kind{"sampling", Cause::Sampling, sampling, "activation: data", start_by_data},
                      Kind{"overrun", Cause::Overrun, overrun,
                           "more than its wcet of 100us: the wcet of v.victim is too small"},
                      Kind{"predecessor_overrun", Cause::Overrun, predecessor_overrun, "more than its wcet of 50us"},
                      Kind{"release_late", Cause::ReleaseLate, release_late, "reduce the jitter", release_on_time},
                      Kind{"demoted", Cause::Demoted, demoted, "raise the budget", raise_budget},
                      Kind{"own_task", Cause::OwnTask, own_task, "overlap (concurrency)", overlap},
                      Kind{"no_thread", Cause::NoThread, no_thread, "more threads", add_threads},
                      Kind{"overhead", Cause::Overhead, overhead, "a faster machine"},
                      Kind{"lost", Cause::Blocked, lost, "preemption: os", preempt}),
    [](const ::testing::TestParamInfo<Kind> &kind) { return std::string(kind.param.name); });

}  // namespace
}  // namespace redag::metrics
