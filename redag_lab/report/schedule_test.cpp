// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "redag_lab/report/timeline.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/timeline.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::report {
namespace {

using metrics::JobRecord;
using testing::TraceBuilder;

constexpr Time ms(Time count) { return count * kMillisecond; }

Workload hi_and_lo() {
  return testing::make_workload({testing::make_dag("hi", {{"h", 10, 2}}), testing::make_dag("lo", {{"l", 50, 20}})}, 1,
                                PreemptionMode::Os);
}

trace::Trace simulated(const Workload &workload, Duration length) {
  return testing::simulated(testing::run_info(workload), length);
}

std::vector<JobRecord> jobs_of(const trace::Trace &trace) {
  return metrics::fold_jobs(trace.info.workload, trace.events);
}

std::vector<Slice> slices_of(const trace::Trace &trace) {
  std::vector<Slice> slices;
  SliceFolder folder(trace.info);
  folder.add(trace.events);
  folder.finish();
  folder.drain([&](const Slice &slice) { slices.push_back(slice); });
  std::stable_sort(slices.begin(), slices.end(), [](const Slice &a, const Slice &b) { return a.begin < b.begin; });
  return slices;
}

Timeline timeline_of(const trace::Trace &trace, std::size_t most_bins) {
  TimelineBuilder builder(trace.info, most_bins);
  for (const Slice &slice : slices_of(trace)) builder.add(slice);
  for (const JobRecord &job : jobs_of(trace)) builder.add(job);
  return builder.take();
}

TEST(Slices, APreemptedJobHasTwoAndTellsHowEachEnded) {
  TraceBuilder run(hi_and_lo());
  run.at(0).arrives("l", 0).dispatched("l", 0, 0, 50);
  run.at(5).arrives("h", 0).preempted("l", 0, 0).dispatched("h", 0, 0, 15).started("h", 0, 0);
  run.at(7).finished("h", 0, 0).resumed("l", 0, 0);
  const std::vector<Slice> slices = slices_of(run.until(9));
  const TaskId h = run.id("h");
  const TaskId l = run.id("l");
  EXPECT_EQ(slices, (std::vector<Slice>{{0, ms(5), l, 0, 0, Slice::End::Preempted},
                                        {ms(5), ms(7), h, 0, 0, Slice::End::Finished},
                                        {ms(7), ms(9), l, 0, 0, Slice::End::Open}}));
}

TEST(Slices, AWaitEndsOne) {
  TraceBuilder run(hi_and_lo());
  run.at(0).arrives("l", 0).dispatched("l", 0, 0, 50).at(5).waits("l", 0, 0, -1);
  run.at(7).woken("l", 0, -1).resumed("l", 0, 0).at(8).finished("l", 0, 0);
  const TaskId l = run.id("l");
  EXPECT_EQ(slices_of(run.until(9)), (std::vector<Slice>{{0, ms(5), l, 0, 0, Slice::End::Waits},
                                                         {ms(7), ms(8), l, 0, 0, Slice::End::Finished}}));
}

TEST(Schedule, OfAShortRunIsWholeWithAViewForEachDag) {
  const trace::Trace trace = simulated(hi_and_lo(), ms(200));
  const Schedule schedule = schedule_of(trace, 1000, 6).value();
  ASSERT_EQ(schedule.windows.size(), 1U);
  EXPECT_EQ(schedule.slices_shown, schedule.slices_in_all);
  EXPECT_EQ(schedule.windows[0].jobs.size(), jobs_of(trace).size());
  ASSERT_EQ(schedule.views.size(), 3U);
  for (const View &view : schedule.views) {
    EXPECT_LT(view.begin, view.end);
    EXPECT_GE(view.begin, 0);
    EXPECT_EQ(view.job.has_value(), &view != &schedule.views.back()) << "the last one is the beginning";
  }
}

TEST(Schedule, BeginsWithTheJobThatIsAskedFor) {
  TraceBuilder run(hi_and_lo());
  run.at(0).arrives("h", 0).dispatched("h", 0, 0, 10).at(15).finished("h", 0, 0);  // late
  run.at(20).arrives("h", 1).at(30).skipped("h", 1, Reason::Overrun);
  run.at(50).arrives("l", 0).dispatched("l", 0, 0, 100).at(120).finished("l", 0, 0);  // late
  run.at(180).arrives("h", 2);                                                        // overdue at the end
  const trace::Trace trace = run.until(200);
  for (const std::uint32_t number : {1U, 2U}) {
    const Schedule schedule = schedule_of(trace, 1000, 6, metrics::JobId{run.id("h"), number}).value();
    ASSERT_EQ(schedule.views.size(), 3U) << "one for each DAG, and the beginning";
    const View &first = schedule.views.front();
    ASSERT_TRUE(first.job);
    EXPECT_EQ(first.job->task, run.id("h"));
    EXPECT_EQ(first.job->number, number);
    EXPECT_LT(first.begin, first.job->release) << "with what came before";
    EXPECT_GE(first.end, first.job->deadline);
    EXPECT_LE(first.end, ms(200));
    EXPECT_EQ(schedule.views[1].job->task, run.id("l"));
  }
}

TEST(Schedule, OfALongRunStaysSmallAndShowsTheWorstJobs) {
  const trace::Trace trace = simulated(hi_and_lo(), ms(20'000));
  const std::vector<JobRecord> jobs = jobs_of(trace);
  constexpr std::size_t kMost = 300;
  const Schedule schedule = schedule_of(trace, kMost, 6).value();
  ASSERT_EQ(schedule.windows.size(), 3U) << "the beginning, and one for each DAG";
  EXPECT_LE(schedule.slices_shown, kMost + 10) << "those that only touch a window are in it too";
  EXPECT_GT(schedule.slices_in_all, 10 * kMost);
  for (std::size_t i = 0; i + 1 < schedule.views.size(); ++i) {
    const View &view = schedule.views[i];
    const Window &window = schedule.windows[view.window];
    const auto job = std::find_if(window.jobs.begin(), window.jobs.end(), [&](const JobRecord &each) {
      return each.task == view.job->task && each.number == view.job->number;
    });
    ASSERT_NE(job, window.jobs.end()) << "the job that the view is about";
    EXPECT_EQ(*job, *view.job);
    for (const JobRecord &other : jobs) {
      if (other.task == job->task && other.finish != kNever) {
        EXPECT_LE(other.lateness(), job->lateness());
      }
    }
    const auto drawn = [&](const Slice &slice) { return slice.task == job->task && slice.job == job->number; };
    EXPECT_TRUE(std::any_of(window.slices.begin(), window.slices.end(), drawn));
  }
}

// What the windows hold, counted again from lists of all slices and jobs.
TEST(Schedule, WindowsHaveTheirShareOfSlicesAndAllJobsWithin) {
  const trace::Trace trace = simulated(hi_and_lo(), ms(20'000));
  const std::vector<Slice> slices = slices_of(trace);
  const std::vector<JobRecord> jobs = jobs_of(trace);
  constexpr std::size_t kShare = 100;
  const Schedule schedule = schedule_of(trace, 3 * kShare, 6).value();
  ASSERT_EQ(schedule.windows.size(), 3U);
  EXPECT_EQ(schedule.windows[0].begin, 0);
  EXPECT_EQ(schedule.windows[0].end, slices[kShare - 1].begin);
  for (std::size_t i = 0; i + 1 < schedule.views.size(); ++i) {
    const View &view = schedule.views[i];
    const Window &window = schedule.windows[view.window];
    const auto job = std::find_if(jobs.begin(), jobs.end(), [&](const JobRecord &each) {
      return each.task == view.job->task && each.number == view.job->number;
    });
    ASSERT_NE(job, jobs.end());
    const auto later =
        std::find_if(slices.begin(), slices.end(), [&](const Slice &slice) { return slice.begin >= job->finish; });
    const auto index = static_cast<std::size_t>(later - slices.begin());
    const std::size_t first = index > kShare * 3 / 4 ? index - kShare * 3 / 4 : 0;
    EXPECT_EQ(window.begin, first == 0 ? 0 : slices[first].begin);
    EXPECT_EQ(window.end, first + kShare >= slices.size() ? trace.info.end : slices[first + kShare - 1].begin);
  }
  for (const Window &window : schedule.windows) {
    std::vector<Slice> slices_within;
    for (const Slice &slice : slices) {
      if (slice.begin <= window.end && slice.end >= window.begin) slices_within.push_back(slice);
    }
    EXPECT_EQ(window.slices, slices_within);
    std::vector<JobRecord> jobs_within;
    for (const JobRecord &job : jobs) {
      if (job.release < window.end && std::min(job.finish, trace.info.end) >= window.begin) jobs_within.push_back(job);
    }
    EXPECT_EQ(window.jobs, jobs_within);
  }
}

TEST(Schedule, OfAnEmptyTraceIsEmpty) {
  const trace::Trace trace = TraceBuilder(hi_and_lo()).until(10);
  const Schedule schedule = schedule_of(trace, 100, 6).value();
  ASSERT_EQ(schedule.views.size(), 1U);
  EXPECT_TRUE(schedule.windows[schedule.views[0].window].slices.empty());
}

TEST(Timeline, BusyTimeAndJobsAddUp) {
  const trace::Trace trace = simulated(hi_and_lo(), ms(777));
  const std::vector<Slice> slices = slices_of(trace);
  const std::vector<JobRecord> jobs = jobs_of(trace);
  const Timeline timeline = timeline_of(trace, 100);
  EXPECT_LE(timeline.bins, 100U);
  Duration drawn = 0;
  for (const auto &dag : timeline.busy) {
    for (const Duration busy : dag) {
      EXPECT_LE(busy, timeline.bin);
      drawn += busy;
    }
  }
  Duration executed = 0;
  for (const Slice &slice : slices) executed += std::min(slice.end, trace.info.end) - slice.begin;
  EXPECT_EQ(drawn, executed);
  std::uint64_t released = 0;
  for (const auto &dag : timeline.released) {
    for (const std::uint64_t count : dag) released += count;
  }
  EXPECT_EQ(released, jobs.size());
}

TEST(Timeline, MissesStandWhereTheirJobsWereReleased) {
  TraceBuilder run(hi_and_lo());
  run.at(0).arrives("h", 0).dispatched("h", 0, 0, 10);
  run.at(15).finished("h", 0, 0);                                                           // late
  run.at(20).arrives("h", 1).skipped("h", 1, Reason::Overrun);                              // lost
  run.at(40).arrives("h", 2).dispatched("h", 2, 0, 50).aborted("h", 2, 0, Reason::NoData);  // no data was due
  run.at(60).arrives("h", 3).dispatched("h", 3, 0, 70);                                     // overdue at the end
  run.at(95).arrives("l", 0);                                                               // still in time
  const trace::Trace trace = run.until(100);
  const Timeline timeline = timeline_of(trace, 10);
  ASSERT_EQ(timeline.bins, 10U);
  EXPECT_EQ(timeline.missed[0], (std::vector<std::uint64_t>{1, 0, 1, 0, 0, 0, 1, 0, 0, 0}));
  EXPECT_EQ(timeline.missed[1], std::vector<std::uint64_t>(10, 0));
}

}  // namespace
}  // namespace redag::report
