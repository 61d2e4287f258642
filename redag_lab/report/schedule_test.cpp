// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "redag_lab/report/why.hpp"
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
  std::stable_sort(slices.begin(), slices.end(),
                   [](const Slice &a, const Slice &b) { return std::tie(a.begin, a.end) < std::tie(b.begin, b.end); });
  return slices;
}

// The schedule around the worst job of each DAG.
Schedule schedule_of(const trace::Trace &trace, std::size_t most) {
  const metrics::Investigation investigation = metrics::Investigation::of(trace).value();
  return report::schedule_of(trace, why_of(investigation, 6).value().worst_of_dag, most).value();
}

TEST(Slices, APreemptedJobHasTwoAndTellsHowEachEnded) {
  TraceBuilder run(hi_and_lo());
  run.at(0).arrives("l", 0).dispatched("l", 0, 0, 50);
  run.at(5).arrives("h", 0).preempted("l", 0, 0).dispatched("h", 0, 0, 15).started("h", 0, 0);
  run.at(7).finished("h", 0, 0).resumed("l", 0, 0);
  const std::vector<Slice> slices = slices_of(run.until(9));
  const TaskId h = run.id("h");
  const TaskId l = run.id("l");
  EXPECT_EQ(slices, (std::vector<Slice>{{0, ms(5), l, 0, {}, 0, Slice::End::Preempted},
                                        {ms(5), ms(7), h, 0, {}, 0, Slice::End::Finished},
                                        {ms(7), ms(9), l, 0, {}, 0, Slice::End::Open}}));
}

TEST(Slices, AWaitEndsOne) {
  TraceBuilder run(hi_and_lo());
  run.at(0).arrives("l", 0).dispatched("l", 0, 0, 50).at(5).waits("l", 0, 0, -1);
  run.at(7).woken("l", 0, -1).resumed("l", 0, 0).at(8).finished("l", 0, 0);
  const TaskId l = run.id("l");
  EXPECT_EQ(slices_of(run.until(9)), (std::vector<Slice>{{0, ms(5), l, 0, {}, 0, Slice::End::Waits},
                                                         {ms(7), ms(8), l, 0, {}, 0, Slice::End::Finished}}));
}

// A device of two slots and one of one. The jobs of three tasks ask them; one service is in progress at the end.
trace::Trace with_devices() {
  Workload workload =
      testing::make_workload({testing::make_dag("d", {{"a", 100}, {"b", 100}, {"c", 100}})}, 1, PreemptionMode::Os);
  workload.platform.devices = {{.name = "gpu", .slots = 2}, {.name = "dla"}};
  testing::TraceBuilder run(workload);
  run.at(0).arrives("a", 0).arrives("b", 0).arrives("c", 0);
  run.dispatched("a", 0, 0, 100).at(1).waits("a", 0, 0, 0).served("a", 0, 0);
  run.dispatched("b", 0, 0, 100).at(2).waits("b", 0, 0, 0).served("b", 0, 0);
  run.dispatched("c", 0, 0, 100).at(3).waits("c", 0, 0, 0);
  run.at(5).woken("a", 0, 0).served("c", 0, 0).resumed("a", 0, 0).at(6).waits("a", 0, 0, 1).served("a", 0, 1);
  run.at(9).woken("b", 0, 0).resumed("b", 0, 0).at(10).waits("b", 0, 0, -1).at(12).woken("b", 0, -1);
  return run.until(20);
}

TEST(Slices, OfDevicesLastFromServedToWoken) {
  const TaskId a(0), b(1), c(2);
  const DeviceId gpu(0), dla(1);
  const auto at_devices = [](const trace::Trace &trace) {
    std::vector<Slice> slices = slices_of(trace);
    std::erase_if(slices, [](const Slice &slice) { return !slice.device.valid(); });
    return slices;
  };
  trace::Trace trace = with_devices();
  EXPECT_EQ(at_devices(trace), (std::vector<Slice>{{ms(1), ms(5), a, 0, gpu, 0, Slice::End::Served},
                                                   {ms(2), ms(9), b, 0, gpu, 0, Slice::End::Served},
                                                   {ms(5), ms(20), c, 0, gpu, 0, Slice::End::Open},
                                                   {ms(6), ms(20), a, 0, dla, 0, Slice::End::Open}}));
  EXPECT_EQ(schedule_of(trace, 100).windows.front().slices, slices_of(trace));
  trace.info.workload.platform.devices.pop_back();
  EXPECT_EQ(at_devices(trace).size(), 3U) << "that the workload does not know";
}

TEST(Schedule, OfAShortRunIsWholeWithAViewForEachDag) {
  const trace::Trace trace = simulated(hi_and_lo(), ms(200));
  const Schedule schedule = schedule_of(trace, 1000);
  ASSERT_EQ(schedule.windows.size(), 1U);
  EXPECT_TRUE(schedule.is_whole);
  EXPECT_EQ(schedule.windows[0].slices, slices_of(trace));
  EXPECT_EQ(schedule.windows[0].jobs.size(), jobs_of(trace).size());
  ASSERT_EQ(schedule.views.size(), 3U);
  for (const View &view : schedule.views) {
    EXPECT_LT(view.begin, view.end);
    EXPECT_GE(view.begin, 0);
    EXPECT_EQ(view.job.has_value(), &view != &schedule.views.back()) << "the last one is the beginning";
  }
}

TEST(Schedule, BeginsWithTheWorstMiss) {
  TraceBuilder run(hi_and_lo());
  run.at(0).arrives("h", 0).dispatched("h", 0, 0, 10).at(15).finished("h", 0, 0);  // late
  run.at(20).arrives("h", 1).at(30).skipped("h", 1, Reason::Overrun);
  run.at(50).arrives("l", 0).dispatched("l", 0, 0, 100).at(105).finished("l", 0, 0);  // late
  run.at(120).arrives("h", 2);                                                        // overdue at the end
  for (const auto &[end, number] : {std::pair(137, 2U), std::pair(125, 0U)}) {
    const Schedule schedule = schedule_of(run.until(end), 1000);
    ASSERT_EQ(schedule.views.size(), 3U) << "one for each DAG, and the beginning";
    const View &first = schedule.views.front();
    ASSERT_TRUE(first.job);
    EXPECT_EQ(first.job->task, run.id("h"));
    EXPECT_EQ(first.job->number, number) << "relative to its deadline";
    EXPECT_GE(first.end, std::min(first.job->deadline, ms(end)));
    EXPECT_LE(first.end, ms(end));
    EXPECT_EQ(schedule.views[1].job->task, run.id("l"));
  }
}

TEST(Schedule, OfALongRunStaysSmallAndShowsTheWorstJobs) {
  const trace::Trace trace = simulated(hi_and_lo(), ms(20'000));
  const std::vector<JobRecord> jobs = jobs_of(trace);
  constexpr std::size_t kMost = 300;
  const Schedule schedule = schedule_of(trace, kMost);
  ASSERT_EQ(schedule.windows.size(), 3U) << "the beginning, and one for each DAG";
  std::size_t shown = 0;
  for (const Window &window : schedule.windows) shown += window.slices.size();
  EXPECT_LE(shown, kMost);
  EXPECT_GT(slices_of(trace).size(), 10 * kMost);
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
  const Schedule schedule = schedule_of(trace, 3 * kShare);
  ASSERT_EQ(schedule.windows.size(), 3U);
  EXPECT_EQ(schedule.windows[0].begin, 0);
  EXPECT_EQ(schedule.windows[0].end, slices[kShare].begin);
  for (const Window &window : schedule.windows) {
    EXPECT_GE(window.slices.size(), kShare / 4) << "also of a job at the beginning";
    EXPECT_LE(window.slices.size(), kShare);
    std::vector<Slice> slices_within;
    for (const Slice &slice : slices) {
      if (slice.begin < window.end && slice.end >= window.begin) slices_within.push_back(slice);
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
  const Schedule schedule = schedule_of(trace, 100);
  ASSERT_EQ(schedule.views.size(), 1U);
  EXPECT_TRUE(schedule.windows[schedule.views[0].window].slices.empty());
}

}  // namespace
}  // namespace redag::report
