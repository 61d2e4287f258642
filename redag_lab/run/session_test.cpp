// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/session.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/files/summary_json.hpp"
#include "tests/testing/builders.hpp"

namespace redag::lab {
namespace {

namespace fs = std::filesystem;

// Returns two tasks on one worker; `slow` always makes `fast` miss unless it is preempted.
Workload fast_and_slow() {
  return testing::make_workload(
      {testing::make_dag("fast", {{"f", 10, 1}}), testing::make_dag("slow", {{"s", 100, 30}})});
}

SessionOptions simulated(Duration duration) {
  SessionOptions options;
  options.duration = duration;
  return options;
}

Session run(const std::string &variant, const SessionOptions &options, const ProgressHook &progress = {}) {
  Result<Session> session = run_session(fast_and_slow(), *parse_variant(variant), options, progress);
  if (!session) {
    ADD_FAILURE() << to_string(session.error());
    return {};
  }
  return *std::move(session);
}

TEST(Session, TheVariantDecidesThePreemption) {
  const Session none = run("redag-none", simulated(kSecond));
  const Session full = run("redag-os", simulated(kSecond));
  EXPECT_EQ(none.info.preemption, "none");
  EXPECT_EQ(full.info.preemption, "os");
  // In each 100 ms, slow runs from 1 to 31 ms. The jobs of fast released at 10 and 20 ms are skipped. The job released
  // at 30 ms starts at 31 ms and finishes in time.
  EXPECT_GT(none.summary.dags[0].jobs.miss_ratio_with_lost(), 0.0);
  EXPECT_EQ(full.summary.total.miss_ratio_with_lost(), 0.0);
  EXPECT_TRUE(none.check.ok()) << none.check.to_string();
  EXPECT_TRUE(full.check.ok()) << full.check.to_string();
}

TEST(Session, ACutTraceIsThatOfAShorterRun) {
  // Both runs state this time of day.
  ::setenv("SOURCE_DATE_EPOCH", "1700000000", 1);
  SessionOptions options = simulated(2 * kSecond);
  const Session whole = run("redag", options);
  EXPECT_FALSE(whole.cut_at.has_value());
  options.max_events = whole.trace.events.size() / 3;
  const Session cut = run("redag", options);
  ASSERT_TRUE(cut.cut_at.has_value());
  EXPECT_LT(cut.trace.events.size(), whole.trace.events.size() / 2);
  EXPECT_GE(cut.trace.events.size(), options.max_events);
  EXPECT_LT(cut.trace.events.back().time, *cut.cut_at);
  EXPECT_EQ(cut.trace.info.end, *cut.cut_at);
  EXPECT_TRUE(cut.check.ok()) << cut.check.to_string();
  EXPECT_GT(cut.check.checks(metrics::Rule::Grid), 0U);
  // The summary covers the whole run.
  EXPECT_EQ(metrics::summary_to_json(cut.summary, cut.info), metrics::summary_to_json(whole.summary, whole.info));
  ::unsetenv("SOURCE_DATE_EPOCH");
}

TEST(Session, StopEndsItWithWhatThereIs) {
  std::atomic<bool> stop{false};
  SessionOptions options = simulated(3600 * kSecond);
  options.stop = &stop;
  Time seen = 0;
  const Session session = run("redag", options, [&](Time now, const auto &) {
    seen = now;
    stop = true;
  });
  EXPECT_TRUE(session.stopped);
  EXPECT_GE(session.info.end, seen);
  EXPECT_LT(session.info.end, options.duration);
  EXPECT_TRUE(session.check.ok()) << session.check.to_string();
}

TEST(Session, ThreadsAndSimulatorGetTheSameJobs) {
  SessionOptions options = simulated(200 * kMillisecond);
  const Session simulation = run("redag-none", options);
  options.driver = trace::Driver::Threads;
  const Session real = run("redag-none", options);
  EXPECT_EQ(real.summary.total.released, simulation.summary.total.released);
  EXPECT_EQ(real.info.driver, trace::Driver::Threads);
}

TEST(Session, ALongRunOnThreadsKeepsItsFirstEventsAndSummarizesAll) {
  SessionOptions options = simulated(500 * kMillisecond);
  options.driver = trace::Driver::Threads;
  options.max_events = 8;
  const Session cut = run("redag-none", options);
  ASSERT_TRUE(cut.cut_at.has_value());
  EXPECT_GE(cut.trace.events.size(), options.max_events);
  EXPECT_LT(cut.trace.events.size(), cut.events);
  EXPECT_LT(cut.trace.events.back().time, *cut.cut_at);
  EXPECT_TRUE(cut.check.ok()) << cut.check.to_string();
  EXPECT_EQ(cut.info.end, options.duration);
  // The summary includes every release: in 100 ms, fast has ten and slow has one.
  EXPECT_EQ(cut.summary.total.released, run("redag-none", simulated(500 * kMillisecond)).summary.total.released);
}

// The files of a run, in a folder that is removed at the end.
class SessionFiles : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  [[nodiscard]] trace::Trace events() const {
    Result<trace::Trace> trace = trace::read_trace((folder_ / "events.redag").string());
    EXPECT_TRUE(trace) << to_string(trace.error());
    return *std::move(trace);
  }

  fs::path folder_ = fs::path(::testing::TempDir()) / ("redag_session." + std::to_string(::getpid()));
};

TEST_F(SessionFiles, HoldTheEventsOfTheRunAndTheTraceNone) {
  SessionOptions options = simulated(2 * kSecond);
  const Session kept = run("redag", options);
  options.files.folder = folder_.string();
  options.keep_trace = false;
  const Session streamed = run("redag", options);
  EXPECT_TRUE(fs::is_empty(folder_)) << "files appear when they are complete";
  EXPECT_TRUE(streamed.files->commit(streamed.info.end, 0).empty());
  EXPECT_EQ(streamed.files->names(), "jobs.csv, events.redag, trace.pftrace");
  EXPECT_TRUE(streamed.trace.events.empty());
  EXPECT_EQ(streamed.checked, kept.trace.events.size());
  EXPECT_EQ(streamed.check.checks_by_rule, kept.check.checks_by_rule);
  EXPECT_TRUE(events().events == kept.trace.events);
  EXPECT_EQ(events().info.end, kept.info.end);
}

TEST_F(SessionFiles, OfALongRunOnThreadsAreWrittenMeanwhile) {
  SessionOptions options = simulated(300 * kMillisecond);
  options.driver = trace::Driver::Threads;
  options.max_events = kMostKeptEvents + 1;
  options.files.folder = folder_.string();
  const Session session = run("redag-none", options);
  EXPECT_TRUE(session.check.ok()) << session.check.to_string();
  EXPECT_TRUE(session.files->commit(session.info.end, session.info.lost_events).empty());
  EXPECT_EQ(events().events.size(), session.events);
  EXPECT_TRUE(events().events == session.trace.events);
}

TEST_F(SessionFiles, AFolderThatIsGoneIsAnError) {
  SessionOptions options = simulated(kSecond);
  options.files.folder = (folder_ / "nowhere").string();
  for (const trace::Driver driver : {trace::Driver::Simulator, trace::Driver::Threads}) {
    options.driver = driver;
    options.duration = 50 * kMillisecond;
    const Result<Session> session = run_session(fast_and_slow(), *parse_variant("redag-none"), options);
    ASSERT_FALSE(session);
    EXPECT_EQ(session.error().front().file, options.files.folder + "/events.redag");
  }
}

TEST(SensibleDuration, IsWholeHyperperiods) {
  Workload workload = fast_and_slow();
  EXPECT_EQ(sensible_duration(workload), 10 * kSecond);
  workload.dags[1].tasks[0].period = 700 * kMillisecond;
  EXPECT_EQ(sensible_duration(workload), Duration{15} * 700 * kMillisecond);
  workload.dags[0].tasks[0].period = 999'999'937;
  EXPECT_EQ(sensible_duration(workload), 10 * kSecond) << "nobody waits for that hyperperiod";
}

TEST(SensibleDuration, HoldsAFewMillionJobs) {
  Workload workload = testing::make_workload({testing::tick_dag("fast", {{"a", 1000}, {"b", 1000}})});
  EXPECT_EQ(sensible_duration(workload), 2 * kSecond);
  workload.dags[0].tasks[0].period = 1;
  workload.dags[0].tasks[1].period = 7;
  EXPECT_EQ(sensible_duration(workload) % 7, 0);
  EXPECT_NEAR(static_cast<double>(sensible_duration(workload)), 3.5e6, 10);
  workload.dags[0].tasks[1].period = 999'999'937;
  EXPECT_NEAR(static_cast<double>(sensible_duration(workload)), 4e6, 10);
}

}  // namespace
}  // namespace redag::lab
