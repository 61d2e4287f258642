// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ExecutorOptions::record: what is left of a run, and of a process that is killed.
#include "redag/runtime/recorder.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "redag/runtime/executor.hpp"
#include "redag/threads/clock.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "tests/testing/one_worker.hpp"
#include "tests/testing/recorded_run.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

class Record : public ::testing::Test {
 protected:
  [[nodiscard]] ExecutorOptions recording(PreemptionMode mode = PreemptionMode::None) const {
    ExecutorOptions options = testing::one_worker(mode);
    options.name = "robot";
    options.record = folder_.string();
    return options;
  }
  [[nodiscard]] trace::Trace trace() const { return run_.trace(); }

  testing::RecordedRun run_;
  const fs::path &folder_ = run_.folder();
};

TEST_F(Record, ARunBecomesATraceThatTheCheckerAccepts) {
  for (const PreemptionMode mode : {PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Auto}) {
    std::uint64_t finished = 0;
    {
      Executor executor(recording(mode));
      DagBuilder control("control", {.max_active = 1, .deadline = 5ms});
      int jobs = 0;
      const TaskHandle imu = control.timer("imu", 2ms, [] {}, {.wcet = 300us});
      const TaskHandle ekf = control.data("ekf", {imu}, [] {});
      control.data("pid", {ekf}, [&] {
        if (++jobs == 100) executor.stop();
      });
      const DagId dag = executor.add(std::move(control));
      executor.run();
      finished = executor.stats(dag)[2].jobs.finished;
      EXPECT_TRUE(fs::exists(folder_ / "events.redag")) << "written when run() returns";
    }
    const trace::Trace recorded = trace();
    testing::expect_right(recorded);
    EXPECT_EQ(recorded.info.lost_events, 0U);
    EXPECT_EQ(recorded.info.workload.name, "robot");
    ASSERT_EQ(recorded.info.workload.dags.size(), 1U);
    EXPECT_EQ(recorded.info.workload.dags[0].deadline, 5 * kMillisecond);
    EXPECT_EQ(recorded.info.workload.dags[0].tasks[0].wcet, 300 * kMicrosecond);
    EXPECT_GT(recorded.info.workload.dags[0].tasks[1].wcet, 0) << "measured";
    const metrics::Summary summary = metrics::summarize(recorded);
    // The job that stopped the run ended after it.
    EXPECT_GE(summary.tasks[2].jobs.finished + 1, finished);
    EXPECT_GE(summary.tasks[2].jobs.finished, 99U);
  }
}

TEST_F(Record, DagsThatComeAndGoAndEventsAreInIt) {
  {
    Executor executor(recording());
    std::atomic<int> scans{0};
    int rounds = 0;
    DagBuilder lidar("lidar");
    const EventHandle scan = lidar.event("scan", 1ms, [&] { ++scans; });
    lidar.data("detect", {scan}, [] {});
    executor.add(std::move(lidar));
    DagId inspection;
    DagBuilder supervisor("supervisor");
    supervisor.timer("decide", 10ms, [&] {
      if (rounds > 0) executor.remove(inspection);
      DagBuilder dag("inspection");
      const TaskHandle camera = dag.timer("camera", 2ms, [] {});
      dag.timer("check", 2ms, [] {}, {.after = {camera}});
      inspection = executor.add(std::move(dag));
      if (++rounds == 4) executor.stop();
    });
    executor.add(std::move(supervisor));
    executor.start();
    while (scans < 5) {
      executor.release(scan);
      std::this_thread::sleep_for(1ms);
    }
    executor.wait();
  }
  const trace::Trace recorded = trace();
  testing::expect_right(recorded);
  EXPECT_EQ(recorded.info.event_tasks, std::vector<TaskId>{TaskId(0)});
  ASSERT_EQ(recorded.info.workload.dags.size(), 6U);
  EXPECT_EQ(recorded.info.workload.dags[2].name, "inspection");
  EXPECT_EQ(recorded.info.workload.dags[3].name, "inspection #2");
  EXPECT_GE(recorded.info.workload.dags[3].tasks[0].offset, 10 * kMillisecond) << "its grid begins when it was added";
}

// Nothing says so but the record: no job of it was skipped.
TEST_F(Record, ADagIsRemovedWhileAPredecessorRuns) {
  {
    Executor executor(recording());
    Event begun;
    Event removed;
    DagBuilder dag("gone");
    const TaskHandle first = dag.timer("first", 1h, [&] {
      begun.set();
      removed.wait();
    });
    dag.data("second", {first}, [] {});
    const DagId gone = executor.add(std::move(dag));
    DagBuilder other("stays");
    other.timer("t", 1ms, [] {});
    executor.add(std::move(other));
    executor.start();
    begun.wait();
    executor.remove(gone);
    removed.set();
    std::this_thread::sleep_for(5ms);
    executor.stop();
  }
  const trace::Trace recorded = trace();
  testing::expect_right(recorded);
  EXPECT_EQ(recorded.info.removals.size(), 2U);
}

// Rates that do not fit into the levels of the kernel are added. Two tasks that had levels of their own share one then.
TEST_F(Record, LevelsThatAreSharedLaterMakeNoViolation) {
  {
    Executor executor(recording(PreemptionMode::Auto));
    if (executor.mode().mode != PreemptionMode::Os) GTEST_SKIP() << "SCHED_FIFO is not to be had here";
    const auto compute = [](Duration time) {
      for (const Time end = thread_cpu_now() + time; thread_cpu_now() < end;) {
      }
    };
    std::atomic<int> jobs{0};
    DagBuilder first("first");
    first.timer("a", 10ms, [&] {
      compute(200 * kMicrosecond);
      ++jobs;
    });
    first.timer("b", 11ms, [&] { compute(4 * kMillisecond); });
    executor.add(std::move(first));
    executor.start();
    while (jobs < 25) std::this_thread::sleep_for(1ms);
    for (int i = 0; i < 160; ++i) {
      DagBuilder more("more" + std::to_string(i));
      more.timer("x", i < 120 ? std::chrono::microseconds(9'000'000 - i * 1000) : std::chrono::microseconds(9'990 - i),
                 [] {});
      executor.add(std::move(more));
    }
    executor.stop();
  }
  trace::Trace recorded = trace();
  testing::expect_right(recorded);
  recorded.info.settled.reset();
  EXPECT_FALSE(metrics::check_trace(recorded, metrics::rules_for(recorded.info)).ok()) << "no job was preempted";
}

TEST_F(Record, AnEarlierRunIsReplacedAndAnUnfinishedOneIsMovedAside) {
  const auto run = [&] {
    Executor executor(recording());
    DagBuilder dag("dag");
    dag.timer("t", 1ms, [] {});
    executor.add(std::move(dag));
    executor.run_for(20ms);
    return executor.warnings();
  };
  run();
  const trace::Trace first = trace();
  EXPECT_TRUE(run().empty());
  EXPECT_NE(trace().info.provenance.created + std::to_string(trace().info.end),
            first.info.provenance.created + std::to_string(first.info.end));
  fs::resize_file(folder_ / "events.redag", fs::file_size(folder_ / "events.redag") - 1);
  const std::vector<std::string> warnings = run();
  ASSERT_FALSE(warnings.empty());
  EXPECT_NE(warnings.back().find("events.1.redag"), std::string::npos) << warnings.back();
  EXPECT_TRUE(trace::read_trace((folder_ / "events.1.redag").string()));
}

TEST_F(Record, AKilledProcessLeavesARecord) {
  const pid_t child = ::fork();
  if (child == 0) {
    Executor executor(recording());
    DagBuilder dag("dag");
    int jobs = 0;
    dag.timer("t", 1ms, [&] {
      // By then the recorder has written several times.
      if (++jobs == 500) ::kill(::getpid(), SIGKILL);
    });
    executor.add(std::move(dag));
    executor.run();
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  const trace::Trace recorded = trace();
  testing::expect_right(recorded);
  ASSERT_EQ(recorded.info.remarks.size(), 1U);
  EXPECT_NE(recorded.info.remarks[0].text.find("the run was killed"), std::string::npos);
  EXPECT_GT(metrics::summarize(recorded).tasks[0].jobs.finished, 100U);
}

TEST_F(Record, AFolderThatCannotBeWrittenIsRefusedAtOnce) {
  std::ofstream(folder_.string()) << "a file";
  try {
    const Executor executor(recording());
    FAIL() << "accepted";
  } catch (const std::runtime_error &error) {
    EXPECT_NE(std::string(error.what()).find(folder_.string()), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("cannot create the folder"), std::string::npos) << error.what();
  }
}

TEST_F(Record, ARunThatNeverBeganLeavesNothing) {
  {
    Executor executor(recording());
    DagBuilder dag("dag");
    dag.timer("t", 1ms, [] {});
    executor.add(std::move(dag));
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Record, ARunWithoutDagsLeavesNothing) {
  {
    Executor executor(recording());
    executor.run_for(10ms);
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Record, TheEventsBelongToTheRecord) {
  Executor executor(recording());
  std::vector<JobEvent> events;
  EXPECT_THROW(executor.drain(events), std::logic_error);
}

TEST_F(Record, AFullRecordKeepsTheNewestEvents) {
  ExecutorOptions options = recording();
  options.record_bytes = std::uint64_t{64} << 10U;
  {
    Executor executor(options);
    DagBuilder dag("dag");
    int jobs = 0;
    dag.timer("t", 100us, [&] {
      if (++jobs == 10'000) executor.stop();
    });
    executor.add(std::move(dag));
    executor.run();
  }
  const trace::Trace recorded = trace();
  EXPECT_GT(recorded.info.lost_events, 0U);
  ASSERT_FALSE(recorded.events.empty());
  EXPECT_GT(recorded.events.back().job, 9000U);
}

}  // namespace
}  // namespace redag::runtime
