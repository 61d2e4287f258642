// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/summary.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "redag_analysis/metrics/files/summary_json.hpp"
#include "redag_analysis/metrics/perfetto/perfetto.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::metrics {
namespace {

using testing::make_dag;
using testing::make_workload;
using testing::TraceBuilder;
constexpr Duration kMs = kMillisecond;

TEST(Percentile, IsTheNearestRank) {
  std::vector<Duration> values;
  for (Duration v = 1; v <= 20; ++v) values.push_back(v);
  EXPECT_EQ(percentile(values, 50), 10);
  EXPECT_EQ(percentile(values, 95), 19);
  EXPECT_EQ(percentile(values, 99), 20);
  EXPECT_EQ(percentile(values, 100), 20);
  EXPECT_EQ(percentile(values, 1), 1);
  EXPECT_EQ(percentile({7}, 50), 7);
}

TEST(Distribution, TheWorstOfSeveralIsSoFigureByFigure) {
  const Distribution steady = distribution_of({20, 20, 20, 20});
  const Distribution rare = distribution_of({1, 1, 1, 90});
  const Distribution worst = worst_of(std::vector{Distribution(), steady, rare});
  EXPECT_EQ(worst.count, 8U);
  EXPECT_EQ(worst.p50, 20);
  EXPECT_EQ(worst.max, 90);
  EXPECT_EQ(worst.min, 1);
  EXPECT_DOUBLE_EQ(worst.mean, 23.25);
  EXPECT_EQ(worst_of(std::vector{rare}), rare);
  EXPECT_EQ(worst_of({}), Distribution());
}

TEST(Distribution, OfFewValues) {
  const Distribution d = distribution_of({30, 10, 20});
  EXPECT_EQ(d.count, 3U);
  EXPECT_DOUBLE_EQ(d.mean, 20.0);
  EXPECT_EQ(d.min, 10);
  EXPECT_EQ(d.p50, 20);
  EXPECT_EQ(d.max, 30);
  EXPECT_EQ(distribution_of({}), Distribution{});
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

TEST(Summary, CountsPerTaskDagAndTotal) {
  const Summary s = summarize(example());
  ASSERT_EQ(s.tasks.size(), 3U);
  ASSERT_EQ(s.dags.size(), 2U);
  const JobStats &src = s.tasks[0].jobs;
  EXPECT_EQ(src.released, 4U);
  EXPECT_EQ(src.finished, 2U);
  EXPECT_EQ(src.aborted, 1U);
  EXPECT_EQ(src.skipped, 1U);
  EXPECT_EQ(src.by_reason[static_cast<std::size_t>(Reason::DagFull)], 1U);
  EXPECT_EQ(src.by_reason[static_cast<std::size_t>(Reason::Exception)], 1U);
  EXPECT_EQ(src.late, 0U);
  EXPECT_DOUBLE_EQ(src.miss_ratio_with_lost(), 0.5);
  EXPECT_EQ(src.response.max, 2 * kMs);
  EXPECT_EQ(src.start_latency.max, 1 * kMs);

  const JobStats &lo = s.tasks[2].jobs;
  EXPECT_EQ(lo.late, 2U);  // one finished 3 ms late, one in flight since its deadline at 28
  EXPECT_EQ(lo.overdue, 1U);
  EXPECT_EQ(lo.in_flight, 1U);
  EXPECT_DOUBLE_EQ(lo.miss_ratio(), 1.0);
  EXPECT_EQ(lo.max_lateness, 3 * kMs);
  EXPECT_EQ(lo.on_worker.max, 8 * kMs);

  EXPECT_EQ(s.dags[0].jobs.released, 6U);
  EXPECT_EQ(s.dags[0].jobs.lost(), 2U);
  EXPECT_EQ(s.dags[0].jobs.missed(), 2U);
  EXPECT_EQ(s.total.released, 8U);
  EXPECT_EQ(s.total.released, s.total.finished + s.total.skipped + s.total.aborted + s.total.in_flight);
  EXPECT_DOUBLE_EQ(s.total.miss_ratio(), 2.0 / 8.0);
}

// A job that found no data is aborted, and is neither a miss nor a response.
TEST(Summary, AJobWithoutDataIsNoMiss) {
  TraceBuilder t(make_workload({make_dag("a", {{"t", 10, 1}})}, 1));
  t.at(0).arrives("t", 0).at(1).dispatched("t", 0, 0, 10).at(2).aborted("t", 0, 0, Reason::NoData);
  t.at(10).arrives("t", 1).dispatched("t", 1, 0, 20).at(11).aborted("t", 1, 0, Reason::Exception);
  const Summary s = summarize(t.until(20));
  EXPECT_EQ(s.total.aborted, 2U);
  EXPECT_EQ(s.total.no_data(), 1U);
  EXPECT_DOUBLE_EQ(s.total.miss_ratio_with_lost(), 0.5);
  EXPECT_EQ(s.tasks[0].jobs.start_latency.count, 1U);
  EXPECT_EQ(s.tasks[0].jobs.response.count, 0U);
}

TEST(Summary, EndToEndGoesBackToTheSource) {
  const Summary s = summarize(example());
  const EndToEnd &chain = s.dags[0].end_to_end;
  EXPECT_EQ(chain.response.count, 2U);
  EXPECT_EQ(chain.response.min, 3 * kMs);
  EXPECT_EQ(chain.response.max, 5 * kMs);  // released at 10, finished at 15
  EXPECT_EQ(chain.late, 1U);
  EXPECT_EQ(s.dags[1].end_to_end.late, 0U);  // no deadline
  ASSERT_EQ(chain.sinks.size(), 1U);
  EXPECT_EQ(chain.sinks[0].task, TaskId(std::size_t{1}));
  EXPECT_EQ(chain.sinks[0].due, 4U);  // all releases of the source, however they ended
}

// Two sinks: `near` answers after 1 ms, then 4 ms; `far` after 2 ms both times.
TEST(Summary, OfSeveralSinksEachFigureIsThatOfTheWorstOne) {
  Dag fork = make_dag("fork", {{"src", 10, 1}, {"near", 0, 1, {0}}, {"far", 0, 1, {0}}});
  TraceBuilder t(make_workload({fork}, 2));
  const auto period = [&t](std::uint32_t k, Time near, Time far) {
    const Time r = 10 * static_cast<Time>(k);
    t.at(r).arrives("src", k).dispatched("src", k, 0, r + 10).finished("src", k, 0);
    t.released("near", k).ready("near", k, r).dispatched("near", k, 0, r + 10);
    t.released("far", k).ready("far", k, r).dispatched("far", k, 1, r + 10);
    t.at(r + std::min(near, far)).finished(near < far ? "near" : "far", k, near < far ? 0 : 1);
    t.at(r + std::max(near, far)).finished(near < far ? "far" : "near", k, near < far ? 1 : 0);
  };
  period(0, 1, 2);
  period(1, 4, 2);
  const Summary s = summarize(t.until(20));
  const EndToEnd &end_to_end = s.dags[0].end_to_end;
  ASSERT_EQ(end_to_end.sinks.size(), 2U);
  EXPECT_EQ(end_to_end.sinks[0].response.max, 4 * kMs);
  EXPECT_EQ(end_to_end.sinks[1].response.max, 2 * kMs);
  EXPECT_EQ(end_to_end.response.p50, 2 * kMs) << "far's; the two mixed would have it, too";
  EXPECT_EQ(end_to_end.response.max, 4 * kMs) << "near's";
  EXPECT_EQ(end_to_end.response.mean, 2.5 * kMs) << "near's, not 2.25 of both";
}

TEST(Summary, MissesSoFarAreThoseOfTheEnd) {
  const trace::Trace trace = example();
  Summarizer summarizer(trace.info);
  summarizer.add(trace.events);
  EXPECT_EQ(summarizer.missed(), (std::vector<std::uint64_t>{2, 1})) << "lo#1 is in flight";
  const Summary s = summarizer.finish(trace.info.end);
  EXPECT_EQ(summarizer.missed(), (std::vector<std::uint64_t>{s.dags[0].jobs.missed(), s.dags[1].jobs.missed()}));
}

TEST(Summary, AJobInFlightBeyondTheEndToEndDeadlineIsLate) {
  Dag chain = make_dag("chain", {{"src", 10, 1}, {"sink", 0, 2, {0}}}, 1);
  chain.deadline = 4 * kMs;
  TraceBuilder t(make_workload({chain}, 1));
  t.at(0).arrives("src", 0).dispatched("src", 0, 0, 10);
  t.at(1).finished("src", 0, 0).released("sink", 0).ready("sink", 0, 0).dispatched("sink", 0, 0, 11);
  EXPECT_EQ(summarize(t.until(4)).dags[0].end_to_end.late, 0U);
  EXPECT_EQ(summarize(t.until(5)).dags[0].end_to_end.late, 1U);
}

TEST(Summary, BusyWorkersPeaksAndInversions) {
  const Summary s = summarize(example());
  ASSERT_EQ(s.worker_busy.size(), 1U);
  EXPECT_DOUBLE_EQ(s.worker_busy[0], (15.0 + 20.0) / 40.0);
  EXPECT_EQ(s.dags[0].peak_active, 1U);
  EXPECT_TRUE(s.all_enforced);
  // src#1 waited from 10 to 11 while lo ran.
  EXPECT_EQ(s.inversions, (Inversions{1, 1 * kMs, 1 * kMs}));
}

// hi waits for the only thread, which lo holds. This counts although no decision of the scheduler is wrong.
TEST(Summary, AJobThatLacksAThreadIsInverted) {
  TraceBuilder t(make_workload({make_dag("a", {{"hi", 10, 1, {}, "", 2}}), make_dag("b", {{"lo", 20, 5}})}, 1,
                               PreemptionMode::Os));
  t.at(0).arrives("lo", 0).dispatched("lo", 0, 0, 20).at(2).arrives("hi", 0);
  t.at(5).finished("lo", 0, 0).dispatched("hi", 0, 0, 12).at(6).finished("hi", 0, 0);
  trace::Trace trace = t.until(7);
  trace.info.config.max_started = 1;
  EXPECT_EQ(summarize(trace).inversions, (Inversions{1, 3 * kMs, 3 * kMs}));
}

TEST(Summary, WarmUpIsNotCounted) {
  trace::Trace trace = example();
  trace.info.warm_up = 10 * kMs;
  const Summary s = summarize(trace);
  EXPECT_EQ(s.total.released, 5U);  // src 1..3, sink 1, lo 1
  EXPECT_EQ(s.begin, 10 * kMs);
  EXPECT_DOUBLE_EQ(s.worker_busy[0], (5.0 + 20.0) / 30.0);
}

TEST(Summary, SaysWhenABoundWasBroken) {
  TraceBuilder t(make_workload({make_dag("a", {{"x", 10, 2}, {"y", 10, 2}}, 1)}, 2));
  t.at(0).arrives("x", 0).arrives("y", 0).dispatched("x", 0, 0, 10).dispatched("y", 0, 1, 10);
  const Summary bound = summarize(t.until(1));
  EXPECT_EQ(bound.dags[0].peak_active, 2U);
  EXPECT_FALSE(bound.all_enforced);

  TraceBuilder g(make_workload({make_dag("a", {{"x", 10, 2, {}, "g"}, {"y", 10, 2, {}, "g"}})}, 2));
  g.at(0).arrives("x", 0).arrives("y", 0).dispatched("x", 0, 0, 10).dispatched("y", 0, 1, 10);
  const Summary group = summarize(g.until(1));
  EXPECT_EQ(group.group_overlaps, 1U);
  EXPECT_FALSE(group.all_enforced);
}

TEST(SummaryJson, HasEverything) {
  const trace::Trace trace = example();
  const std::string text = summary_to_json(summarize(trace), trace.info);
  EXPECT_EQ(text, summary_to_json(summarize(trace), trace.info));
  const nlohmann::json json = nlohmann::json::parse(text);
  EXPECT_EQ(json["format"], "redag.summary/2");
  EXPECT_EQ(json["total"]["missed"], 4);
  EXPECT_FALSE(json["total"].contains("response")) << "of jobs of several tasks";
  EXPECT_FALSE(json["dags"][0].contains("response"));
  EXPECT_EQ(json["run"]["executor"], "redag");
  EXPECT_EQ(json["total"]["released"], 8);
  EXPECT_EQ(json["tasks"][2]["name"], "lo");
  EXPECT_EQ(json["tasks"][2]["max_lateness_ns"], 3 * kMs);
  EXPECT_EQ(json["tasks"][0]["lost_by_reason"]["dag_full"], 1);
  EXPECT_EQ(json["dags"][0]["end_to_end"]["response"]["max_ns"], 5 * kMs);
  EXPECT_EQ(json["inversions"]["count"], 1);
  EXPECT_EQ(json["all_enforced"], true);
}

TEST(SummaryJson, UnwritablePlaceIsAnError) {
  const trace::Trace trace = example();
  EXPECT_FALSE(write_summary("/nonexistent/summary.json", summarize(trace), trace.info));
  EXPECT_FALSE(write_perfetto("/nonexistent/trace.pftrace", trace));
}

}  // namespace
}  // namespace redag::metrics
