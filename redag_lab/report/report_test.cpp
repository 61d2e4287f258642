// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the way from runs to a document: bounds, verdicts, combined figures, and cuts.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "redag_lab/report/document.hpp"
#include "redag_lab/report/verdict.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/timeline.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::report {
namespace {

using nlohmann::json;
using testing::TraceBuilder;

Workload hi_and_lo(PreemptionMode mode) {
  Workload workload = testing::make_workload(
      {testing::make_dag("hi", {{"h", 10, 2}}), testing::make_dag("lo", {{"l", 50, 20}})}, 1, mode);
  workload.name = "two rates";
  return workload;
}

trace::Trace simulated(const Workload &workload, Duration length, const std::string &executor = "redag",
                       std::uint64_t seed = 1) {
  return testing::simulated(testing::run_info(workload, executor, seed), length);
}

Group group_of(const std::string &label, const std::vector<trace::Trace> &traces, DigestOptions options = {}) {
  GroupReader reader(label, options);
  for (std::size_t i = 0; i < traces.size(); ++i) {
    EXPECT_TRUE(reader.add(fmt::format("{}/repetition-{}", label, i + 1), traces[i]));
  }
  return reader.finish();
}

std::vector<Group> groups(Group first) {
  std::vector<Group> all;
  all.push_back(std::move(first));
  return all;
}

TEST(Bounds, AreThoseOfThePlatformThatRan) {
  const RunBounds preemptive = bounds_of(simulated(hi_and_lo(PreemptionMode::Os), kSecond).info);
  EXPECT_TRUE(preemptive.schedulable);
  ASSERT_EQ(preemptive.tasks.size(), 2U);
  EXPECT_EQ(preemptive.tasks[0].response, 2 * kMillisecond);
  EXPECT_EQ(preemptive.tasks[1].response, 26 * kMillisecond) << "20 ms and three of 2 ms";

  const RunBounds jobs_run_to_their_end = bounds_of(simulated(hi_and_lo(PreemptionMode::None), kSecond).info);
  EXPECT_FALSE(jobs_run_to_their_end.schedulable) << "20 ms of blocking, deadline 10 ms";
}

TEST(Bounds, ChargeTheRecordedOverheads) {
  trace::RunInfo run = simulated(hi_and_lo(PreemptionMode::Os), kSecond).info;
  run.overheads = "release 100us, dispatch 50us, preempt 0";
  const RunBounds bounds = bounds_of(run);
  ASSERT_EQ(bounds.tasks.size(), 2U) << bounds.absent;
  EXPECT_EQ(bounds.tasks[0].response, 2 * kMillisecond + 150 * kMicrosecond);
  run.overheads = "some";
  EXPECT_NE(bounds_of(run).absent.find("overheads"), std::string::npos) << "rather none than one that ignores them";
}

TEST(Bounds, OtherExecutorsHaveTheirOwnOrNone) {
  const Workload workload = testing::make_workload(
      {testing::make_dag("hi", {{"h", 100, 2}}), testing::make_dag("lo", {{"l", 120, 20}})}, 1, PreemptionMode::None);
  const trace::Trace ste = simulated(workload, kSecond, "ste");
  const RunBounds bounds = bounds_of(ste.info);
  ASSERT_EQ(bounds.tasks.size(), 2U) << bounds.absent;
  EXPECT_EQ(bounds.tasks[1].response, 22 * kMillisecond) << "h comes once while l waits; wait_set counts it twice";
  EXPECT_EQ(bounds.tasks[1].method, "dag_any");
  EXPECT_EQ(bounds.tasks[0].method, "wait_set");
  const RunBounds events = bounds_of(simulated(workload, kSecond, "events").info);
  ASSERT_EQ(events.tasks.size(), 2U) << events.absent;
  EXPECT_EQ(events.tasks[1].response, 22 * kMillisecond);
  EXPECT_EQ(events.tasks[1].method, "dag_any") << "nothing that counts on windows";
  trace::RunInfo unknown = ste.info;
  unknown.executor = "SingleThreadedExecutor";
  EXPECT_FALSE(bounds_of(unknown).absent.empty());
}

TEST(Verdict, ACleanRunIsGoodAndProven) {
  const Group group = group_of("redag", {simulated(hi_and_lo(PreemptionMode::Os), kSecond)});
  const std::vector<Sentence> sentences = verdict_of(group);
  EXPECT_EQ(sentences[0].tone, Tone::Good);
  EXPECT_EQ(sentences[0].text,
            "Every deadline was met: 120 jobs, none late, none lost. The closest to its deadline was lo.l, with 24ms "
            "to spare.");
  EXPECT_EQ(sentences[1].tone, Tone::Good) << sentences[1].text;
  EXPECT_NE(sentences[1].text.find("every deadline is met"), std::string::npos);
  EXPECT_EQ(sentences[2].tone, Tone::Good) << "the trace checker: " << sentences[2].text;
}

TEST(Verdict, WhatWasNoticedIsSaid) {
  trace::Trace trace = simulated(hi_and_lo(PreemptionMode::Os), kSecond);
  trace.info.remarks = {{.begun = kMillisecond, .ended = 3 * kMillisecond, .text = "deadlock: a"},
                        {.begun = 2 * kMillisecond, .text = "deadlock: b"}};
  const std::vector<Sentence> sentences = verdict_of(group_of("redag", {trace}));
  ASSERT_EQ(sentences.size(), 5U);
  EXPECT_EQ(sentences[3].tone, Tone::Bad);
  EXPECT_EQ(sentences[3].text, "Noticed 1ms after the start, for 2ms: deadlock: a");
  EXPECT_EQ(sentences[4].text, "Noticed 2ms after the start, until the end: deadlock: b");
  trace.info.remarks.resize(8);
  EXPECT_EQ(verdict_of(group_of("redag", {trace})).back().text, "3 more of this kind.");
}

TEST(Verdict, MissesAreCountedNamedAndNotProvenAway) {
  const Group group = group_of("none", {simulated(hi_and_lo(PreemptionMode::None), kSecond)});
  const std::vector<Sentence> sentences = verdict_of(group);
  EXPECT_EQ(sentences[0].tone, Tone::Bad);
  EXPECT_NE(sentences[0].text.find("hi "), std::string::npos) << sentences[0].text;
  EXPECT_NE(sentences[0].text.find(", none in the other one."), std::string::npos) << sentences[0].text;
  EXPECT_EQ(sentences[0].text.find("to spare"), std::string::npos) << sentences[0].text;
  EXPECT_NE(sentences[1].text.find("not every deadline is shown"), std::string::npos) << sentences[1].text;
}

// Returns a run in which one job of `hi.h`, whose wcet and bound are 2 ms, took 5 ms and `used_ms` of processor time.
trace::Trace late_run(Time used_ms) {
  TraceBuilder run(hi_and_lo(PreemptionMode::Os));
  run.at(0).arrives("h", 0).dispatched("h", 0, 0, 10).started("h", 0, 0);
  run.at(5).executed("h", 0, 0, used_ms).finished("h", 0, 0);
  trace::Trace trace = run.until(10);
  trace.info.driver = trace::Driver::Threads;
  return trace;
}

TEST(Verdict, AWcetThatWasExceededIsAnAlarm) {
  const std::vector<Sentence> sentences = verdict_of(group_of("late", {late_run(5)}));
  EXPECT_NE(sentences[1].text.find("overheads of the platform are not charged"), std::string::npos)
      << sentences[1].text;
  EXPECT_EQ(sentences[1].text.find("within its bound"), std::string::npos) << sentences[1].text;
  EXPECT_EQ(sentences[2].tone, Tone::Bad);
  EXPECT_NE(sentences[2].text.find("hi.h: wcet exceeded: 5ms of processor time, 1 of 1 execution exceeded"),
            std::string::npos)
      << sentences[2].text;
  EXPECT_EQ(sentences[3].tone, Tone::Bad);
  EXPECT_NE(sentences[3].text.find("hi.h: 1 response exceeded the bound of 2ms"), std::string::npos)
      << sentences[3].text;
}

TEST(Verdict, WhatAMachineMayTakeIsNoAlarmUnlessItWasCalibrated) {
  trace::Trace trace = late_run(2);
  const std::vector<Sentence> noted = verdict_of(group_of("late", {trace}));
  EXPECT_EQ(noted[2].tone, Tone::Plain);
  EXPECT_NE(noted[2].text.find("No alarm; the machine's noise may explain these deviations: hi.h: 1 response exceeded"),
            std::string::npos)
      << noted[2].text;
  trace.info.overheads = to_string(Overheads());
  const std::vector<Sentence> alarmed = verdict_of(group_of("late", {trace}));
  EXPECT_EQ(alarmed[2].tone, Tone::Bad);
  EXPECT_NE(alarmed[2].text.find("machine: jobs that held their workers got no processor for 3ms"), std::string::npos)
      << alarmed[2].text;
}

TEST(Verdict, RankingTellsOnlyWhatTheRangesTell) {
  const Contender a{"a", 10, 100, {0.1, 0.08, 0.12}};
  const Contender b{"b", 20, 100, {0.2, 0.15, 0.3}};
  const Contender touches{"c", 15, 100, {0.15, 0.12, 0.2}};
  const Contender clean{"d", 0, 100, {0, 0, 0}};
  const Contender clean_too{"e", 0, 100, {0, 0, 0}};
  const Contender once{"f", 1, 100, {0, 0, 0.01}};
  EXPECT_EQ(ranking(std::vector{a, b}), "a misses fewest");
  EXPECT_EQ(ranking(std::vector{b, a, touches}), "a and c do not differ clearly, b misses more");
  EXPECT_EQ(ranking(std::vector{a, touches}), "no clear difference");
  EXPECT_EQ(ranking(std::vector{a, clean, b, clean_too}), "d and e miss none, a and b miss more");
  EXPECT_EQ(ranking(std::vector{clean, once, b}), "d and f do not differ clearly, b misses more") << "f missed once";
}

TEST(Group, PoolsRepetitionsAndRefusesStrangers) {
  const Workload workload = hi_and_lo(PreemptionMode::Os);
  const trace::Trace one = simulated(workload, kSecond);
  GroupReader reader("redag", {});
  ASSERT_TRUE(reader.add("a", one));
  ASSERT_TRUE(reader.add("b", simulated(workload, kSecond, "redag", 2)));
  EXPECT_FALSE(reader.fits(simulated(workload, kSecond, "mte").info));
  EXPECT_FALSE(reader.fits(simulated(hi_and_lo(PreemptionMode::None), kSecond).info));
  Workload renamed = workload;
  renamed.dags[0].tasks[0].name = "other";
  EXPECT_FALSE(reader.fits(simulated(renamed, kSecond).info));
  const Group both = reader.finish();
  EXPECT_EQ(both.total.released, 240U);
  EXPECT_EQ(both.tasks[0].response.count, 200U);
  EXPECT_EQ(both.tasks[0].response.max, 2 * kMillisecond);
}

// Returns a run of a task released every 10 ms. Job k ends `ends[k]` ms after its release; 0: it is skipped.
trace::Trace run_of(const std::vector<Time> &ends) {
  TraceBuilder run(testing::make_workload({testing::make_dag("control", {{"t", 10, 1}})}, 1));
  for (std::uint32_t k = 0; k < ends.size(); ++k) {
    const Time r = 10 * static_cast<Time>(k);
    run.at(r).arrives("t", k);
    if (ends[k] == 0) {
      run.skipped("t", k, Reason::Overrun);
    } else {
      run.dispatched("t", k, 0, r + 10).at(r + ends[k]).finished("t", k, 0);
    }
  }
  return run.until(10 * static_cast<Time>(ends.size()) + 10);
}

TEST(Group, ExplainsTheRunWithMostMisses) {
  const std::vector<trace::Trace> runs = {run_of({1, 19, 1}), run_of({0, 1, 0}), run_of({1, 1, 1}), run_of({0, 0, 1})};
  const Group group = group_of("x", runs);
  EXPECT_EQ(group.worst_run, 1U) << "two misses, and the first such run";
  EXPECT_EQ(group.why.misses, 2U);
  const json document = json::parse(to_json(groups(group_of("x", runs))));
  const json &shown = document["groups"][0];
  EXPECT_EQ(shown["worst_run"], 1);
  const json &view = shown["schedule"]["views"][0];
  EXPECT_EQ(view["job"], 0) << "the worst miss, not the latest of the jobs that finished";
  EXPECT_EQ(view["missed"], true);
  EXPECT_TRUE(view["lateness_ns"].is_null());
  EXPECT_EQ(shown["why"]["jobs"][0]["number"], 0);
  EXPECT_EQ(document["cuts"].size(), 0U) << "the page says it where it shows the run";
}

TEST(Group, WithoutAMissExplainsTheRunThatCameClosest) {
  const Group group = group_of("x", {run_of({1, 1}), run_of({2, 8}), run_of({7, 1})});
  EXPECT_EQ(group.worst_run, 1U);
  ASSERT_FALSE(group.schedule.views.empty());
  EXPECT_EQ(group.schedule.views.front().job->number, 1U);
  EXPECT_NE(verdict_of(group).front().text.find("with 2ms to spare"), std::string::npos);
}

TEST(Document, SaysWhatTheRunsWere) {
  std::vector<Group> all = groups(group_of("redag", {simulated(hi_and_lo(PreemptionMode::Os), kSecond)}));
  all.push_back(group_of("ste", {simulated(hi_and_lo(PreemptionMode::Os), kSecond, "ste")}));
  const json document = json::parse(to_json(all));
  EXPECT_EQ(document["format"], "redag.report/3");
  EXPECT_EQ(document["title"], "two rates");
  ASSERT_EQ(document["groups"].size(), 2U);
  const json &redag = document["groups"][0];
  EXPECT_EQ(redag["tasks"][0]["bound_ns"], 2'000'000);
  EXPECT_EQ(redag["total"]["released"], 120);
  EXPECT_EQ(redag["schedule"]["is_whole"], true);
  EXPECT_GT(redag["schedule"]["windows"][0]["slices"]["task"].size(), 100U);
  EXPECT_EQ(document["headline"]["text"], "redag missed none of its deadlines and ste 16.7 %");
  EXPECT_EQ(document["comparison"]["dags"].size(), 2U);
  EXPECT_EQ(document["comparison"]["dags"][0]["groups"][0]["missed"], 0);
  EXPECT_GT(document["comparison"]["dags"][0]["groups"][1]["missed"], 0);
  EXPECT_GT(document["comparison"]["dags"][0]["groups"][1]["miss_ratio"]["max"], 0.0);
  EXPECT_EQ(to_json(all), to_json(all));
}

// Returns a run of a chain a -> b released every 10 ms. Job k of b ends `ends[k]` ms after the k-th release of a.
trace::Trace chain_run(const std::vector<Time> &ends) {
  Workload workload = testing::make_workload({testing::make_dag("chain", {{"a", 10, 1}, {"b", 0, 1, {0}}})}, 1);
  workload.dags[0].deadline = 4 * kMillisecond;
  TraceBuilder run(workload);
  for (std::uint32_t k = 0; k < ends.size(); ++k) {
    const Time r = 10 * static_cast<Time>(k);
    run.at(r).arrives("a", k).dispatched("a", k, 0, r + 10).at(r + 1).finished("a", k, 0);
    run.released("b", k).ready("b", k, r).dispatched("b", k, 0, r + 11).at(r + ends[k]).finished("b", k, 0);
  }
  return run.until(10 * static_cast<Time>(ends.size()));
}

TEST(Document, TheMaximumIsOfAllRepetitionsAndADagAnswersEndToEnd) {
  std::vector<Group> all = groups(group_of("x", {chain_run({2, 2, 3}), chain_run({2, 2, 9}), chain_run({2, 2, 2})}));
  all.push_back(group_of("y", {chain_run({2, 2, 2})}));
  const json document = json::parse(to_json(all));
  const json &row = document["comparison"]["dags"][0]["groups"][0];
  EXPECT_EQ(row["max_ns"], 9'000'000) << "not 3 ms, the median of the repetitions' maxima";
  EXPECT_EQ(row["p50_ns"]["median"], 2'000'000) << "with the answers of `a` among them it would be 1 ms";
  EXPECT_EQ(row["missed"], 0);
  EXPECT_EQ(row["end_to_end_late"], 1);
  const json &dag = document["groups"][0]["dags"][0];
  EXPECT_EQ(dag["end_to_end"]["response"]["max_ns"], 9'000'000);
  EXPECT_EQ(dag["end_to_end"]["response"]["count"], 9);
  EXPECT_FALSE(dag["jobs"].contains("response"));
  const Sentence verdict = verdict_of(all[0]).front();
  EXPECT_EQ(verdict.tone, Tone::Bad) << "every job was in time, and the DAG was not";
  EXPECT_NE(verdict.text.find("chain exceeded its deadline of 4ms 1 of 9 times"), std::string::npos) << verdict.text;
}

// One job of 23 326 is late, in the second of three runs.
TEST(Compare, OneMissIsNeverNone) {
  std::vector<Group> all;
  for (const char *label : {"redag", "mte"}) {
    std::vector<trace::Trace> traces;
    for (int run = 0; run < 3; ++run) {
      TraceBuilder builder(testing::make_workload({testing::make_dag("control", {{"t", 10, 1}})}, 1));
      const int jobs = run == 0 ? 7776 : 7775;
      for (int k = 0; k < jobs; ++k) {
        const Time r = 10 * k;
        const auto number = static_cast<std::uint32_t>(k);
        const bool late = label == std::string("redag") && run == 1 && k + 1 == jobs;
        builder.at(r).arrives("t", number).dispatched("t", number, 0, r + 10);
        builder.at(r + (late ? 11 : 1)).finished("t", number, 0);
      }
      traces.push_back(builder.until(10 * jobs + 10));
    }
    all.push_back(group_of(label, traces));
  }
  ASSERT_EQ(all[0].total.released, 23326U);
  std::vector<Contender> contenders;
  for (const Group &group : all) {
    contenders.push_back({group.label, group.total.missed(), group.total.released, misses_of(group, DagId(0))});
  }
  EXPECT_EQ(comparison_line("control", contenders),
            "control: redag misses 0.0043 % (1 of 23 326), mte none: no clear difference");
  EXPECT_EQ(verdict_of(all[0]).front().tone, Tone::Bad);
  EXPECT_EQ(verdict_of(all[1]).front().tone, Tone::Good);
  const json document = json::parse(to_json(all));
  EXPECT_EQ(document["comparison"]["dags"][0]["groups"][0]["missed"], 1);
}

TEST(Document, SaysWhatItCut) {
  DigestOptions few;
  few.most_slices = 50;
  const std::vector<Group> all =
      groups(group_of("redag", {simulated(hi_and_lo(PreemptionMode::Os), 10 * kSecond)}, few));
  DocumentOptions options;
  options.most_tasks = 1;  // raised to 10 per group: nothing is cut here
  const json document = json::parse(to_json(all, options));
  ASSERT_EQ(document["cuts"].size(), 1U);
  EXPECT_NE(document["cuts"][0].get<std::string>().find("the schedule shows"), std::string::npos);
}

TEST(Document, OfManyTasksKeepsThoseClosestToAMiss) {
  std::vector<testing::TestTask> tasks;
  for (int i = 0; i < 40; ++i) tasks.push_back({fmt::format("t{}", i), 1000, 1});
  Workload workload = testing::make_workload({testing::make_dag("wide", tasks)}, 1, PreemptionMode::None);
  DocumentOptions options;
  options.most_tasks = 10;
  const json document = json::parse(to_json(groups(group_of("redag", {simulated(workload, kSecond)})), options));
  const json &rows = document["groups"][0]["tasks"];
  ASSERT_EQ(rows.size(), 40U) << "positions are TaskIds";
  EXPECT_FALSE(rows[0].contains("jobs"));
  EXPECT_TRUE(rows[39].contains("jobs")) << "the last one to run";
  EXPECT_FALSE(rows[29].contains("jobs"));
  EXPECT_EQ(document["cuts"].size(), 1U);
}

TEST(Document, HoldsNamesThatAreNoUtf8) {
  Workload workload = hi_and_lo(PreemptionMode::Os);
  const std::vector<Group> all = groups(group_of("\xff</script>", {simulated(workload, kSecond)}));
  EXPECT_EQ(json::parse(to_json(all))["groups"][0]["label"], "\xef\xbf\xbd</script>");
}

}  // namespace
}  // namespace redag::report
