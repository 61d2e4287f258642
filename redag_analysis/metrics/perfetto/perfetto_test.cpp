// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/perfetto/perfetto.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "redag/trace/output_file.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/perfetto_reader.hpp"
#include "tests/testing/random_workloads.hpp"
#include "tests/testing/timeline.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::metrics {
namespace {

using ::testing::ElementsAre;
using testing::make_dag;
using testing::make_workload;
using testing::Picture;
using testing::PictureCount;
using testing::PictureEvent;
using testing::TraceBuilder;
constexpr Duration kMs = kMillisecond;

class Perfetto : public ::testing::Test {
 protected:
  ~Perfetto() override { std::filesystem::remove(path_); }

  Picture picture_of(const trace::Trace &trace) {
    const Result<void> written = write_perfetto(path_, trace);
    EXPECT_TRUE(written) << to_string(written.error());
    return testing::read_picture(path_);
  }

  const std::string path_ =
      (std::filesystem::path(::testing::TempDir()) / ("redag_perfetto." + std::to_string(::getpid()))).string();
};

std::vector<std::string> texts(const std::vector<PictureCount> &counts) {
  std::vector<std::string> texts;
  for (const PictureCount &one : counts) {
    texts.push_back(std::to_string(one.time / kMs) + ":" + std::to_string(one.value));
  }
  return texts;
}

std::string text(const PictureEvent &slice) {
  std::string text = slice.name + " " + std::to_string(slice.begin / kMs) + "-" + std::to_string(slice.end / kMs);
  for (const auto &[name, value] : slice.arguments) text += " " + name + "=" + value;
  return text;
}

std::vector<std::string> texts(const std::vector<PictureEvent> &slices) {
  std::vector<std::string> all;
  std::transform(slices.begin(), slices.end(), std::back_inserter(all),
                 [](const PictureEvent &one) { return text(one); });
  return all;
}

// src -> sink (data), end-to-end deadline 4 ms, max_active 1. lo shares their worker, without preemption.
trace::Trace example() {
  Dag chain = make_dag("chain", {{"src", 10, 1}, {"sink", 0, 2, {0}}}, 1);
  chain.deadline = 4 * kMs;
  TraceBuilder t(make_workload({chain, make_dag("b", {{"lo", 20, 6, {}, "", 0, 8}})}, 1));
  t.at(0).arrives("src", 0).arrives("lo", 0).dispatched("src", 0, 0, 10);
  t.at(1).finished("src", 0, 0).released("sink", 0).ready("sink", 0, 0).dispatched("sink", 0, 0, 11);
  t.at(3).finished("sink", 0, 0).dispatched("lo", 0, 0, 8);
  t.at(10).arrives("src", 1).at(11).finished("lo", 0, 0).dispatched("src", 1, 0, 20);
  t.at(12).finished("src", 1, 0).released("sink", 1).ready("sink", 1, 10).dispatched("sink", 1, 0, 22);
  t.at(15).finished("sink", 1, 0).at(20).arrives("src", 2).arrives("lo", 1).dispatched("src", 2, 0, 30);
  t.at(21).aborted("src", 2, 0, Reason::Exception).dispatched("lo", 1, 0, 28);
  t.at(30).released("src", 3).skipped("src", 3, Reason::DagFull);
  return t.until(40);
}

TEST_F(Perfetto, ShowsWorkersTasksMissesAndCounters) {
  trace::Trace trace = example();
  trace.info.provenance.created = "2026-01-31T12:00:00Z";
  trace.info.provenance.command = "redag simulate " + std::string(300, 'x');  // a length of two bytes
  const Picture picture = picture_of(trace);
  EXPECT_THAT(texts(picture.slices_of("workers (redag, none)/worker 0")),
              ElementsAre("src 0-1 job=0", "sink 1-3 job=0", "lo 3-11 job=0", "src 11-12 job=1", "sink 12-15 job=1",
                          "src 20-21 job=2", "lo 21-40 job=1"));
  EXPECT_THAT(texts(picture.slices_of("DAG chain/src")),
              ElementsAre("src 0-1 job=0 outcome=finished slack_ns=9000000",
                          "src 10-12 job=1 outcome=finished slack_ns=8000000",
                          "src 20-21 job=2 miss=lost outcome=aborted reason=exception",
                          "src 30-30 job=3 miss=lost outcome=skipped reason=dag_full"));
  EXPECT_THAT(texts(picture.slices_of("DAG chain/sink")),
              ElementsAre("sink 1-3 job=0 outcome=finished slack_ns=8000000",
                          "sink 12-15 job=1 miss=end_to_end outcome=finished slack_ns=7000000"));
  EXPECT_THAT(texts(picture.slices_of("DAG b/lo")),
              ElementsAre("lo 0-11 job=0 miss=deadline outcome=finished slack_ns=-3000000",
                          "lo 20-40 job=1 miss=deadline outcome=in_flight"));

  std::vector<std::string> marks;
  for (const PictureEvent &one : picture.instants) {
    if (one.name != "run") marks.push_back(one.track + ": " + one.name + " " + std::to_string(one.begin / kMs));
  }
  EXPECT_THAT(marks, ElementsAre("DAG b/lo: deadline missed 8", "DAG chain/src: skipped: dag_full 30",
                                 "DAG b/lo: deadline missed 28"));
  EXPECT_THAT(texts(picture.counters.at("DAG chain/misses")), ElementsAre("0:0", "15:1", "21:2", "30:3"));
  EXPECT_THAT(texts(picture.counters.at("DAG b/misses")), ElementsAre("0:0", "11:1", "40:2"));

  const PictureEvent &run = picture.instants.front();
  EXPECT_EQ(run.name, "run");
  EXPECT_EQ(run.arguments.at("command"), trace.info.provenance.command);
  EXPECT_EQ(run.arguments.at("executor"), "redag");
}

TEST_F(Perfetto, ArrowsLeadFromAJobToTheOneThatUsesItsData) {
  const Picture picture = picture_of(example());
  std::map<std::uint64_t, std::string> begun;
  std::vector<std::string> arrows;
  for (const PictureEvent &slice : picture.slices) {
    for (const std::uint64_t flow : slice.flows_out) EXPECT_TRUE(begun.emplace(flow, text(slice)).second);
  }
  for (const PictureEvent &slice : picture.slices) {
    for (const std::uint64_t flow : slice.flows_in) arrows.push_back(begun.at(flow) + " -> " + text(slice));
  }
  EXPECT_THAT(arrows, ElementsAre("src 0-1 job=0 -> sink 1-3 job=0", "src 11-12 job=1 -> sink 12-15 job=1"));
}

// Jobs of one task that overlap have tracks of their own, of one name. A preempted job has several slices.
TEST_F(Perfetto, OverlappingAndPreemptedJobs) {
  TraceBuilder t(make_workload({make_dag("d", {{"a", 10, 1}, {"b", 20, 1}})}, 1, PreemptionMode::Os));
  t.at(0)
      .arrives("b", 0)
      .dispatched("b", 0, 0, 20)
      .at(2)
      .arrives("a", 0)
      .preempted("b", 0, 0)
      .dispatched("a", 0, 0, 12);
  t.at(3).arrives("a", 1).finished("a", 0, 0).dispatched("a", 1, 0, 13).at(4).finished("a", 1, 0).resumed("b", 0, 0);
  t.at(6).finished("b", 0, 0);
  const Picture picture = picture_of(t.until(10));
  EXPECT_THAT(texts(picture.slices_of("workers (redag, os)/worker 0")),
              ElementsAre("b 0-2 job=0", "a 2-3 job=0", "a 3-4 job=1", "b 4-6 job=0"));
  const std::vector<PictureEvent> jobs = picture.slices_of("DAG d/a");
  EXPECT_THAT(texts(jobs), ElementsAre("a 2-3 job=0 outcome=finished slack_ns=9000000",
                                       "a 3-4 job=1 outcome=finished slack_ns=9000000"));
  EXPECT_NE(jobs[0].track_id, jobs[1].track_id);
}

// A job whose end is missing must not keep those after it from having slices.
TEST_F(Perfetto, ATraceWithHoles) {
  TraceBuilder t(make_workload({make_dag("d", {{"a", 10, 1}, {"b", 20, 1}})}, 1));
  t.at(0).arrives("a", 0).dispatched("a", 0, 0, 10).at(5).arrives("b", 0).dispatched("b", 0, 0, 25);
  t.at(7).finished("b", 0, 0).finished("b", 9, 0).dispatched("b", 8, 4000000000U, 1);
  const Picture picture = picture_of(t.until(20));
  EXPECT_THAT(texts(picture.slices_of("workers (redag, none)/worker 0")), ElementsAre("a 0-5 job=0", "b 5-7 job=0"));
  EXPECT_THAT(texts(picture.slices_of("DAG d/a")), ElementsAre("a 0-20 job=0 miss=deadline outcome=in_flight"));
}

// Every job of random runs is there with its times, and worker slices add up to its time on a worker.
TEST_F(Perfetto, AgreesWithTheJobsOfRandomRuns) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Rng rng(seed);
    const trace::Trace trace =
        testing::simulated(testing::run_info(testing::contended(rng, true), "redag", seed), 100 * kMs);
    const Picture picture = picture_of(trace);
    using Key = std::pair<std::string, std::string>;  // task and job
    std::map<Key, Duration> on_worker;
    std::map<Key, PictureEvent> spans;
    for (const PictureEvent &slice : picture.slices) {
      const std::string &job = slice.arguments.at("job");
      if (slice.track.rfind("workers", 0) == 0) {
        on_worker[{"DAG " + slice.category + "/" + slice.name, job}] += slice.end - slice.begin;
      } else {
        EXPECT_TRUE(spans.emplace(Key{slice.track, job}, slice).second);
      }
    }
    const std::vector<JobRecord> jobs = fold_jobs(trace.info.workload, trace.events);
    ASSERT_EQ(spans.size(), jobs.size()) << seed;
    const std::vector<TaskRef> refs = flatten(trace.info.workload);
    for (const JobRecord &job : jobs) {
      const TaskRef &ref = refs[job.task.value];
      const Key key{"DAG " + trace.info.workload.dags[ref.dag.value].name + "/" + ref.task->name,
                    std::to_string(job.number)};
      const PictureEvent &span = spans.at(key);
      EXPECT_EQ(span.begin, job.release);
      EXPECT_EQ(span.arguments.at("outcome"), to_string(job.outcome));
      if (job.outcome == JobOutcome::InFlight) continue;
      EXPECT_EQ(span.end, job.finish);
      EXPECT_EQ(on_worker[key], job.on_worker) << seed << " " << key.first << " " << key.second;
    }
  }
}

TEST_F(Perfetto, LongRunsAreWrittenInBlocks) {
  TraceBuilder t(make_workload({make_dag("d", {{"a", 10, 1}})}, 1));
  constexpr std::uint32_t kJobs = 20000;
  for (std::uint32_t job = 0; job < kJobs; ++job) {
    const Time at = 10 * job;
    t.at(at).arrives("a", job).dispatched("a", job, 0, at + 10).at(at + 1).finished("a", job, 0);
  }
  const Picture picture = picture_of(t.until(10 * kJobs));
  EXPECT_EQ(picture.slices.size(), 2 * kJobs);
  EXPECT_GT(picture.bytes, 3U << 18U) << "this test needs several blocks";
  EXPECT_LT(std::filesystem::file_size(path_) * 4, picture.bytes);
}

TEST_F(Perfetto, UnwritablePlaceIsAnError) { EXPECT_FALSE(write_perfetto("/nonexistent/trace.pftrace", example())); }

}  // namespace
}  // namespace redag::metrics
