// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/run_workload.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "redag/threads/setup.hpp"
#include "redag/threads/threads.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "tests/testing/builders.hpp"

namespace redag::lab {
namespace {

// Returns two DAGs: a fast chain, and a slow one whose jobs are longer than the fast period.
Workload two_rates(std::uint32_t workers, PreemptionMode mode) {
  using redag::testing::make_dag;
  std::vector<redag::testing::TestTask> slow;
  for (std::uint32_t i = 0; i < workers; ++i) slow.push_back({"slow" + std::to_string(i), 100, 30});
  Workload workload = redag::testing::make_workload(
      {make_dag("fast", {{"sense", 10'000, 500}, {"act", 0, 300, {0}}}, 1, kMicrosecond), make_dag("slow", slow)},
      workers, mode);
  workload.dags[0].criticality = Criticality::High;
  workload.dags[1].criticality = Criticality::Low;
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) task.region = task.wcet / 10;
  }
  return workload;
}

RunResult run(const Workload &workload, const RunOptions &options) {
  Result<RunResult> result = run_workload(workload, options);
  if (!result) {
    ADD_FAILURE() << to_string(result.error());
    return {};
  }
  return *std::move(result);
}

void expect_lawful(const RunResult &result) {
  const auto report = metrics::check_trace(result.trace);
  EXPECT_TRUE(report.ok()) << report.to_string();
}

bool has_preemption(const RunResult &result) {
  return std::any_of(result.trace.events.begin(), result.trace.events.end(),
                     [](const JobEvent &e) { return e.kind == JobEventKind::Preempted; });
}

class EveryMode : public ::testing::TestWithParam<std::tuple<PreemptionMode, std::uint32_t>> {
 protected:
  void SetUp() override {
    if (mode() == PreemptionMode::Os && runtime::probe_priority_band().top_job == 0) {
      GTEST_SKIP() << "this process may not use SCHED_FIFO";
    }
  }
  static PreemptionMode mode() { return std::get<0>(GetParam()); }
  static std::uint32_t workers() { return std::get<1>(GetParam()); }
};

TEST_P(EveryMode, RunsAsTheModelSays) {
  RunOptions options;
  options.duration = 400 * kMillisecond;
  const RunResult result = run(two_rates(workers(), mode()), options);
  expect_lawful(result);
  EXPECT_EQ(result.mode.mode, mode());
  EXPECT_EQ(result.trace.info.lost_events, 0U);
  EXPECT_TRUE(result.unfinished.empty());
  // The fast timer has 40 grid points in [0, 400 ms). Each is reported, however late.
  const auto released = std::count_if(result.trace.events.begin(), result.trace.events.end(), [](const JobEvent &e) {
    return e.kind == JobEventKind::Released && e.task == TaskId(0);
  });
  EXPECT_EQ(released, 40);
  // On one worker the long job delays the short ones. Preemption then occurs exactly in the modes that allow it.
  if (workers() == 1) {
    EXPECT_EQ(has_preemption(result), mode() != PreemptionMode::None);
  }
}

TEST_P(EveryMode, RunsClustersSideBySide) {
  const std::vector<int> usable = runtime::usable_cpus();
  if (usable.size() < 2) GTEST_SKIP() << "two clusters need two processors";
  Workload workload = two_rates(workers(), mode());
  workload.platform.clusters = {Cluster{"left", workers(), {usable[0]}}, Cluster{"right", 1, {usable[1]}}};
  workload.platform.workers = workers() + 1;
  workload.dags[0].cluster = "right";
  workload.dags[1].cluster = "left";
  RunOptions options;
  options.duration = 400 * kMillisecond;
  const RunResult result = run(workload, options);
  expect_lawful(result);
  EXPECT_EQ(result.trace.info.config.workers, workers() + 1);
  EXPECT_EQ(result.trace.info.lost_events, 0U);
  EXPECT_TRUE(result.unfinished.empty());
  EXPECT_EQ(result.usage.size(), workload.task_count());
  std::uint64_t sensed = 0;
  for (const JobEvent &event : result.trace.events) {
    if (event.kind == JobEventKind::Released && event.task == TaskId(0)) ++sensed;
    if (event.kind != JobEventKind::Dispatched) continue;
    EXPECT_EQ(event.task.value < 2, event.worker == workers()) << "the cluster 'right' has the last worker";
  }
  EXPECT_EQ(sensed, 40U);
}

INSTANTIATE_TEST_SUITE_P(Modes, EveryMode,
                         ::testing::Combine(::testing::Values(PreemptionMode::None, PreemptionMode::Cooperative,
                                                              PreemptionMode::Os),
                                            ::testing::Values(1U, 2U, 8U)),
                         [](const auto &instance) {
                           return std::string(to_string(std::get<0>(instance.param))) + "_" +
                                  std::to_string(std::get<1>(instance.param));
                         });

TEST(RunWorkload, WorkersAreOnTheProcessorsOfThePlatform) {
  const int cpu = runtime::usable_cpus().back();
  Workload workload = two_rates(1, PreemptionMode::None);
  workload.platform.cpus = {cpu};
  RunOptions options;
  options.duration = 50 * kMillisecond;
  std::atomic<int> elsewhere{0};
  options.bodies = [&](std::vector<runtime::Body> bodies, const Now &) {
    for (runtime::Body &body : bodies) {
      body = [&elsewhere, cpu, body = std::move(body)](const runtime::Job &job) {
        if (sched_getcpu() != cpu) ++elsewhere;
        return body(job);
      };
    }
    return bodies;
  };
  expect_lawful(run(workload, options));
  EXPECT_EQ(elsewhere, 0);
}

TEST(RunWorkload, RefusesProcessorsThatTheProcessCannotUse) {
  Workload workload = two_rates(1, PreemptionMode::None);
  workload.platform.cpus = {4095};
  Result<RunResult> result = run_workload(workload, {});
  ASSERT_FALSE(result);
  EXPECT_THAT(to_string(result.error()), ::testing::HasSubstr("the platform has processor 4095, which this process "
                                                              "cannot use (change 'cpus:' in the file: usable "
                                                              "processors are "));
  workload.platform.cpus.clear();
  workload.platform.clusters = {Cluster{"far", 1, {runtime::usable_cpus()[0], 4095}}};
  for (Dag &dag : workload.dags) dag.cluster = "far";
  result = run_workload(workload, {});
  ASSERT_FALSE(result);
  EXPECT_THAT(to_string(result.error()), ::testing::HasSubstr("cluster 'far' has processor 4095, which this process"));
}

TEST(RunWorkload, StopsEarlyWhenAskedAndTheTraceIsStillLawful) {
  std::atomic<bool> stop{false};
  RunOptions options;
  options.duration = 3600 * kSecond;
  options.stop = &stop;
  options.progress = [&](Time now, std::span<const JobEvent>) { stop = now > 50 * kMillisecond; };
  const RunResult result = run(two_rates(1, PreemptionMode::None), options);
  EXPECT_TRUE(result.stopped);
  EXPECT_LT(result.trace.info.end, options.duration);
  expect_lawful(result);
}

TEST(RunWorkload, JobsThatDoNotEndAreNamed) {
  Workload workload = two_rates(1, PreemptionMode::None);
  workload.dags[1].tasks[0].wcet = workload.dags[1].tasks[0].bcet = 3600 * kSecond;
  std::atomic<bool> stop{false};
  RunOptions options;
  options.duration = 3600 * kSecond;
  options.drain_timeout = kMillisecond;
  options.stop = &stop;
  std::uint32_t number = 0;  // not always the first job, where the machine stalls
  options.progress = [&](Time, std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      if (event.kind != JobEventKind::Started || event.task != TaskId(2)) continue;
      number = event.job;
      stop = true;
    }
  };
  const RunResult result = run(workload, options);
  EXPECT_EQ(result.unfinished, std::vector<std::string>{"slow.slow0 #" + std::to_string(number)});
  expect_lawful(result);
}

TEST(RunWorkload, TheWatchdogNamesAJobWhileItRuns) {
  Workload workload = two_rates(1, PreemptionMode::None);
  workload.dags[1].tasks[0].wcet = workload.dags[1].tasks[0].bcet = 3600 * kSecond;
  std::atomic<bool> stop{false};
  RunOptions options;
  options.duration = 3600 * kSecond;
  options.drain_timeout = kMillisecond;
  options.stop = &stop;
  options.watchdog = runtime::WatchdogOptions{{20 * kMillisecond, 0}, 5 * kMillisecond};
  // On a stalling machine other jobs may be reported as well, and earlier jobs skipped. Only this report ends the run.
  const auto is_it = [](const std::string &text) {
    return text.starts_with("slow.slow0 #") && text.find(" is overdue") != std::string::npos;
  };
  options.on_overdue = [&](const std::string &text) { stop = stop || is_it(text); };
  const RunResult result = run(workload, options);
  EXPECT_EQ(std::count_if(result.overdue.begin(), result.overdue.end(), is_it), 1);
  EXPECT_EQ(result.usage[2].overdue, 1U);
}

TEST(RunWorkload, ABudgetCutsAJobOff) {
  Workload workload = two_rates(1, PreemptionMode::Cooperative);
  workload.dags[1].tasks[0].budget = 2 * kMillisecond;
  const auto find_cut = [](std::span<const JobEvent> events) {
    return std::find_if(events.begin(), events.end(),
                        [](const JobEvent &e) { return e.kind == JobEventKind::Aborted; });
  };
  std::atomic<bool> stop{false};
  RunOptions options;
  options.duration = 3600 * kSecond;
  options.stop = &stop;
  options.progress = [&](Time, std::span<const JobEvent> events) { stop = find_cut(events) != events.end(); };
  const RunResult result = run(workload, options);
  expect_lawful(result);
  const std::span<const JobEvent> events = result.trace.events;
  const auto cut = find_cut(events);
  ASSERT_NE(cut, events.end());
  EXPECT_EQ(cut->reason, Reason::Budget);
  EXPECT_EQ(cut->task, TaskId(2));
}

// Each of two long jobs of one task keeps its thread while it is preempted. A third job needs another thread.
TEST(RunWorkload, ThereIsAThreadForEveryJobThatCanBeInProgress) {
  if (runtime::probe_priority_band().top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  Workload workload = two_rates(2, PreemptionMode::Os);
  workload.dags[1].tasks.resize(1);
  workload.dags[1].tasks[0].concurrency = 2;
  RunOptions options;
  options.duration = 150 * kMillisecond;
  const auto too_few = [](const RunResult &result) {
    return std::count_if(result.warnings.begin(), result.warnings.end(), [](const std::string &warning) {
      return warning.find("2 threads serve up to 3 jobs in progress") != std::string::npos;
    });
  };
  const RunResult enough = run(workload, options);
  EXPECT_EQ(enough.trace.info.config.max_started, 3U);
  EXPECT_EQ(too_few(enough), 0);
  options.threads = 2;
  const RunResult few = run(workload, options);
  EXPECT_EQ(few.trace.info.config.max_started, 2U);
  EXPECT_EQ(too_few(few), 1);
  options.preemption = PreemptionMode::None;
  EXPECT_EQ(too_few(run(workload, options)), 0) << "nothing is preempted";
}

TEST(RunWorkload, EveryExecutorRunsOnThreads) {
  for (const executors::ExecutorKind &kind : executors::all()) {
    RunOptions options;
    options.duration = 150 * kMillisecond;
    options.executor = kind.name;
    options.realtime_threads = runtime::probe_priority_band().top_job > 0;
    const RunResult result = run(two_rates(2, PreemptionMode::Auto), options);
    EXPECT_EQ(result.mode.mode == PreemptionMode::None, !kind.ours) << kind.name;
    EXPECT_EQ(result.trace.info.config.workers, kind.single_worker ? 1U : 2U);
    EXPECT_GT(result.usage[0].jobs + result.usage[2].jobs, 0U) << kind.name;
    if (kind.name == "redag") expect_lawful(result);
  }
  RunOptions options;
  options.executor = "nobody's";
  EXPECT_FALSE(run_workload(two_rates(1, PreemptionMode::None), options));
}

TEST(RunWorkload, BodiesOfOnesOwn) {
  const Workload workload = two_rates(1, PreemptionMode::Cooperative);
  std::atomic<std::uint64_t> sensed{0};
  std::atomic<Time> last{-1};
  std::size_t offered = 0;
  RunOptions options;
  options.duration = 200 * kMillisecond;
  options.bodies = [&](std::vector<runtime::Body> synthetic, const Now &now) {
    offered = synthetic.size();
    synthetic[0] = [&, now](const runtime::Job & /*job*/) {
      ++sensed;
      last = now();
      return sched::Outcome::Finished;
    };
    return synthetic;
  };
  const RunResult result = run(workload, options);
  EXPECT_EQ(offered, 3U);
  const auto finished = std::count_if(result.trace.events.begin(), result.trace.events.end(), [](const JobEvent &e) {
    return e.kind == JobEventKind::Finished && e.task == TaskId(0);
  });
  EXPECT_GT(finished, 0);
  EXPECT_GE(sensed, static_cast<std::uint64_t>(finished));
  EXPECT_GE(last, 0);  // relative to the origin of the run, not of the clock
  EXPECT_LT(last, 10 * kSecond);
}

// The record holds the trace, and has no end: the caller replaces it.
TEST(RunWorkload, RecordsWhatHappens) {
  const std::string file = ::testing::TempDir() + "redag_run_record." + std::to_string(::getpid()) + ".redag";
  RunOptions options;
  options.duration = 300 * kMillisecond;
  options.record = file;
  const Result<RunResult> result = run_workload(two_rates(1, PreemptionMode::None), options);
  ASSERT_TRUE(result) << to_string(result.error());
  const Result<trace::Trace> recorded = trace::read_trace(file);
  ASSERT_TRUE(recorded) << to_string(recorded.error());
  const std::vector<JobEvent> &events = recorded->events;
  ASSERT_GT(events.size(), 100U);
  ASSERT_LE(events.size(), result->trace.events.size() + 16) << "the trace ends at the halt";
  const std::size_t common = std::min(events.size(), result->trace.events.size());
  EXPECT_TRUE(
      std::equal(events.begin(), events.begin() + static_cast<std::ptrdiff_t>(common), result->trace.events.begin()));
  EXPECT_EQ(recorded->info.executor, "redag");
  const Result<RunResult> second = run_workload(two_rates(1, PreemptionMode::None), options);
  ASSERT_TRUE(second) << to_string(second.error());
  ASSERT_FALSE(second->warnings.empty());
  EXPECT_NE(second->warnings.front().find(".1.redag"), std::string::npos) << "the first record is not lost";
  std::filesystem::remove(file);
  std::filesystem::remove(file.substr(0, file.size() - 6) + ".1.redag");
}

TEST(RunClusters, RefusesProcessorsOfTheCommandLine) {
  Workload workload = two_rates(1, PreemptionMode::None);
  workload.platform.clusters = {Cluster{"only", 1, {}}};
  RunOptions options;
  options.cpus = {0};
  const Result<RunResult> result = run_workload(workload, options);
  ASSERT_FALSE(result);
  EXPECT_NE(to_string(result.error()).find("whose processors are not chosen by --affinity"), std::string::npos);
}

TEST(RunClusters, OsNeedsTheProcessorsOfEach) {
  if (runtime::probe_priority_band().top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  Workload workload = two_rates(1, PreemptionMode::Os);
  workload.platform.clusters = {Cluster{"left", 1, {0}}, Cluster{"right", 1, {}}};
  workload.platform.workers = 2;
  workload.dags[0].cluster = "left";
  workload.dags[1].cluster = "right";
  const Result<RunResult> result = run_workload(workload, {});
  ASSERT_FALSE(result);
  EXPECT_NE(to_string(result.error()).find("cluster 'right' has no 'cpus'"), std::string::npos);
}

}  // namespace
}  // namespace redag::lab
