// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/chains.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "redag_testing/builders.hpp"

namespace redag::hosts {
namespace {

using testing::make_dag;
using testing::make_workload;

/// A job of a task, which is released, starts at once, and ends. Times in milliseconds.
struct HandJob {
  std::uint32_t task = 0;
  std::uint32_t number = 0;
  Time release = 0;
  Time seen = 0;
  Time finish = 0;
  Time origin = 0;
};

/// Hosts with records that are written by hand.
class Hosts {
 public:
  void add(const std::string &name, std::vector<Dag> dags, const std::vector<HandJob> &jobs,
           OffsetReading offset = {}) {
    trace::RunInfo info;
    info.workload = make_workload(std::move(dags));
    info.executor = "redag";
    info.preemption = "none";
    info.end = 100 * kMillisecond;
    std::string text = trace::events_header(info);
    for (const HandJob &job : jobs) {
      const auto event = [&](JobEventKind kind, Time time, Time value) {
        trace::append_event_line({time * kMillisecond, value * kMillisecond, TaskId(job.task), job.number, 0, kind},
                                 text);
      };
      event(JobEventKind::Released, job.seen, job.release);
      event(JobEventKind::Ready, job.seen, job.origin);
      event(JobEventKind::Dispatched, job.seen, job.release + 50);
      event(JobEventKind::Finished, job.finish, job.finish);
    }
    bytes_.push_back(text + trace::events_footer(4 * jobs.size(), info.end, 0));
    runs_.push_back({name, name, *trace::EventsReader::of(bytes_.back(), name), {.by = "test", .readings = {offset}}});
  }

  MergedRun merged() {
    Result<MergedRun> merged = merge(runs_);
    EXPECT_TRUE(merged) << (merged ? "" : to_string(merged.error()));
    return *std::move(merged);
  }

  std::string refusal(const std::vector<Link> &links) {
    const MergedRun run = merged();
    const Result<std::vector<Chain>> chains = find_chains(run, links);
    return chains ? "accepted" : to_string(chains.error());
  }

  ChainFigures figures(const std::vector<Link> &links) {
    const MergedRun run = merged();
    Result<std::vector<Chain>> chains = find_chains(run, links);
    EXPECT_TRUE(chains && chains->size() == 1);
    ChainWatch watch(run, *std::move(chains));
    EXPECT_TRUE(visit_merged(
        run, runs_, [] { return false; }, [&](auto events) { watch.add(events); }));
    watch.finish();
    return watch.figures().front();
  }

 private:
  std::deque<std::string> bytes_;
  std::vector<HostRun> runs_;
};

Dag one(const std::string &name) { return make_dag(name, {{.name = "t", .period = 10}}); }

Link link(std::string from, std::string to, Duration transport = 0) {
  return {.from = std::move(from), .to = std::move(to), .transport = transport};
}

TEST(Chains, ReadsLinks) {
  const Result<Link> link = parse_link("a.b.c,d.e.f,500us");
  ASSERT_TRUE(link);
  EXPECT_EQ(link->from, "a.b.c");
  EXPECT_EQ(link->to, "d.e.f");
  EXPECT_EQ(link->transport, 500'000);
  for (const char *bad : {"", "a", "a,b", ",b,1ms", "a,,1ms", "a,b,", "a,b,5", "a,b,-1ms"})
    EXPECT_FALSE(parse_link(bad)) << bad;
}

TEST(Chains, JudgesByBothBounds) {
  EXPECT_EQ(judge({5, 10}, 10), Verdict::Met);
  EXPECT_EQ(judge({5, 10}, 9), Verdict::Unknown);
  EXPECT_EQ(judge({5, 10}, 5), Verdict::Unknown);
  EXPECT_EQ(judge({5, 10}, 4), Verdict::Missed);
}

TEST(Chains, LeadOverSeveralHostsToEverySink) {
  Hosts hosts;
  hosts.add("a", {make_dag("d", {{.name = "x", .period = 10}, {.name = "y", .after = {0}}})}, {});
  hosts.add(
      "b",
      {make_dag("d", {{.name = "in", .period = 10}, {.name = "out", .after = {0}}, {.name = "log", .after = {0}}})},
      {});
  hosts.add("c", {one("d")}, {});
  const MergedRun merged = hosts.merged();
  const std::vector<Link> links = {link("b.d.out", "c.d.t"), link("a.d.y", "b.d.in")};
  const Result<std::vector<Chain>> chains = find_chains(merged, links);
  ASSERT_TRUE(chains) << to_string(chains.error());
  ASSERT_EQ(chains->size(), 2U);
  EXPECT_EQ((*chains)[0].name, "a.d.y -> b.d.in -> b.d.out -> c.d.t");
  EXPECT_EQ((*chains)[0].deadline, 10 * kMillisecond);  // that of the task, which is the target of the link
  EXPECT_EQ((*chains)[1].name, "a.d.y -> b.d.in -> b.d.log");
  EXPECT_EQ((*chains)[1].deadline, 0);
}

TEST(Chains, RefusesLinksThatMakeNone) {
  Hosts hosts;
  hosts.add("a", {one("d"), one("e")}, {});
  hosts.add("b",
            {one("d"), make_dag("two", {{.name = "in", .period = 10},
                                        {.name = "also", .period = 10},
                                        {.name = "out", .after = {0, 1}}})},
            {});
  EXPECT_EQ(hosts.refusal({link("a.d.t", "b.d.u")}),
            "error: link from 'a.d.t': there is no task 'b.d.u' (did you mean 'b.d.t'?)");
  EXPECT_EQ(hosts.refusal({link("a.d.t", "a.e.t")}).rfind("error: link from 'a.d.t': it stays on one host", 0), 0U);
  EXPECT_EQ(hosts.refusal({link("a.d.t", "b.two.out")})
                .rfind("error: link from 'a.d.t': task 'b.two.out' has predecessors", 0),
            0U);
  EXPECT_EQ(hosts.refusal({link("a.d.t", "b.d.t"), link("a.e.t", "b.d.t")})
                .rfind("error: link from 'a.e.t': task 'b.d.t' has the data of another link already", 0),
            0U);
  EXPECT_EQ(hosts.refusal({link("a.d.t", "b.two.in")})
                .rfind("error: link from 'a.d.t': task 'b.two.out' has data of 'b.two.also', too", 0),
            0U);
  EXPECT_EQ(hosts.refusal({link("a.d.t", "b.d.t"), link("b.d.t", "a.d.t")})
                .rfind("error: link from 'a.d.t': it and further links form a circle", 0),
            0U);
  Link placed = link("a.d.t", "b.d.u");
  placed.file = "robot.yaml";
  placed.line = 7;
  placed.column = 3;
  EXPECT_EQ(hosts.refusal({placed}).rfind("robot.yaml:7:3: error:", 0), 0U);
}

// Jobs of `a` end at 13, 23, 33, and data of each release a job of `b` 1 ms later, which ends after 2 ms.
const std::vector<HandJob> kFrom = {{0, 0, 10, 10, 13, 10}, {0, 1, 20, 20, 23, 20}, {0, 2, 30, 30, 33, 30}};
const std::vector<HandJob> kTo = {{0, 0, 14, 14, 16, 14}, {0, 1, 24, 24, 26, 24}, {0, 2, 34, 34, 36, 34}};

TEST(Chains, AnswersHaveTheLatencyFromTheFirstRelease) {
  Hosts hosts;
  hosts.add("a", {one("d")}, kFrom);
  hosts.add("b", {one("d")}, kTo, {kMillisecond, 20, {}});
  const ChainFigures figures = hosts.figures({link("a.d.t", "b.d.t", 2 * kMillisecond)});
  EXPECT_EQ(figures.answers, 3U);
  EXPECT_EQ(figures.ambiguous, 0U);
  EXPECT_EQ(figures.unmatched, 0U);
  // The clock of `b` is 1 ms ahead: 5 ms instead of 6.
  EXPECT_EQ(figures.longest, (Interval{5 * kMillisecond - 20, 5 * kMillisecond + 20}));
  EXPECT_EQ(figures.count(Verdict::Met), 3U);
}

TEST(Chains, AnAnswerWithoutACauseIsCounted) {
  Hosts hosts;
  hosts.add("a", {one("d")}, {kFrom[0], kFrom[2]});
  hosts.add("b", {one("d")}, kTo);
  const ChainFigures figures = hosts.figures({link("a.d.t", "b.d.t", 2 * kMillisecond)});
  EXPECT_EQ(figures.answers, 2U);
  EXPECT_EQ(figures.unmatched, 1U);
}

TEST(Chains, ACauseBeforeTheRecordIsNotCounted) {
  Hosts hosts;
  hosts.add("a", {one("d")}, kFrom);
  hosts.add("b", {one("d")}, {{0, 0, 1, 1, 3, 1}, {0, 1, 14, 14, 16, 14}});
  const ChainFigures figures = hosts.figures({link("a.d.t", "b.d.t", 2 * kMillisecond)});
  EXPECT_EQ(figures.answers, 1U);
  EXPECT_EQ(figures.unmatched, 0U);
}

// Within 8 ms, the data of the second job of `b` can be those of the first two of `a`: the bounds cover both.
TEST(Chains, UncertainClocksLeaveSeveralCauses) {
  Hosts hosts;
  hosts.add("a", {one("d")}, kFrom);
  hosts.add("b", {one("d")}, {kTo[1]}, {0, 8 * kMillisecond, {}});
  const ChainFigures figures = hosts.figures({link("a.d.t", "b.d.t", 5 * kMillisecond)});
  EXPECT_EQ(figures.answers, 1U);
  EXPECT_EQ(figures.ambiguous, 1U);
  // From the release at 20 and 8 ms less, which is before that release, to the one at 10 and 8 ms more.
  EXPECT_EQ(figures.longest, (Interval{0, 24 * kMillisecond}));
  EXPECT_EQ(figures.count(Verdict::Unknown), 1U);
}

}  // namespace
}  // namespace redag::hosts
