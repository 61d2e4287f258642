// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the figures that the engine gives to a live page, and that executors create and remove the page.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <ostream>
#include <stdexcept>
#include <thread>

#include "redag/engine/coroutine.hpp"
#include "redag/live/pages.hpp"
#include "redag/live/reader.hpp"
#include "redag/runtime/async_event.hpp"
#include "redag/runtime/device_handle.hpp"
#include "redag/runtime/executor.hpp"
#include "redag/runtime/live_sample.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_lab/run/run_workload.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/recorded_run.hpp"

namespace redag::lab {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;
using namespace std::chrono_literals;

std::unique_ptr<runtime::Engine> make_engine(const Workload &workload, bool measure,
                                             std::vector<runtime::Body> bodies) {
  runtime::EngineOptions options;
  options.config.workers = 1;
  options.measure = measure;
  auto engine =
      std::make_unique<runtime::Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
  engine->bind(workload, std::move(bodies));
  return engine;
}

TEST(Figures, SayWhereJobsAre) {
  const Workload workload =
      make_workload({make_dag("d", {{"urgent", 1000}, {"later", 2000}, {"after", 1000, 1, {1}}})});
  runtime::Event started;
  runtime::Event go;
  const runtime::Body nothing = [](const runtime::Job &) { return sched::Outcome::Finished; };
  const auto engine = make_engine(workload, true,
                                  {[&](const runtime::Job &) {
                                     started.set();
                                     go.wait();
                                     return sched::Outcome::Finished;
                                   },
                                   nothing, nothing});
  ASSERT_TRUE(engine->start());
  engine->set_origin(runtime::monotonic_now() - 10 * kSecond);
  const Time now = engine->now();
  engine->release(TaskId(0), now - 5 * kSecond);  // five seconds late, and therefore past its deadline
  started.wait();
  engine->release(TaskId(1), now);
  engine->release(TaskId(2), now);

  live::TaskSample running;
  fill(running, engine->figures(TaskId(0)));
  EXPECT_EQ(running.active, 1U);
  EXPECT_EQ(running.ready, 0U);
  EXPECT_EQ(running.waiting, 0U);
  live::TaskSample ready;
  fill(ready, engine->figures(TaskId(1)));
  EXPECT_EQ(ready.active, 0U);
  EXPECT_EQ(ready.ready, 1U);
  EXPECT_EQ(ready.waiting, 0U);
  live::TaskSample waiting;
  fill(waiting, engine->figures(TaskId(2)));
  EXPECT_EQ(waiting.ready, 0U);
  EXPECT_EQ(waiting.waiting, 1U);

  live::Sample running_now;
  add_threads(running_now, *engine, std::vector{TaskId(10), TaskId(11), TaskId(12)});
  EXPECT_EQ(running_now.threads[0].task, 10U);

  go.set();
  while (engine->figures(TaskId(2)).jobs.finished == 0) std::this_thread::yield();
  live::TaskSample late;
  fill(late, engine->figures(TaskId(0)));
  EXPECT_EQ(late.finished, 1U);
  EXPECT_EQ(late.misses, 1U);
  EXPECT_EQ(late.active, 0U);
  EXPECT_GE(late.response->longest(), 5 * kSecond);
  live::TaskSample in_time;
  fill(in_time, engine->figures(TaskId(1)));
  EXPECT_EQ(in_time.misses, 0U);
  EXPECT_EQ(in_time.response->counts().total(), 1U);
  // Sinks answer for the DAG. Where nothing precedes one, its responses are end to end.
  EXPECT_EQ(late.end_to_end, late.response);
  EXPECT_EQ(in_time.end_to_end, nullptr);
  live::TaskSample after;
  fill(after, engine->figures(TaskId(2)));
  EXPECT_NE(after.end_to_end, after.response);
  EXPECT_EQ(after.end_to_end->counts().total(), 1U);
  EXPECT_GE(after.end_to_end->longest(), after.response->longest());
  live::Sample sample;
  add_threads(sample, *engine, std::vector{TaskId(10), TaskId(11), TaskId(12)});
  ASSERT_EQ(sample.threads.size(), 1U);
  EXPECT_GT(sample.threads[0].used, 0);
  EXPECT_EQ(sample.threads[0].task, std::nullopt);
  engine->miss(TaskId(1), engine->now(), Reason::Overrun);
  fill(in_time, engine->figures(TaskId(1)));
  EXPECT_EQ(in_time.misses, 1U);
}

TEST(Figures, AnswersAfterTheDagsDeadlineAreCounted) {
  Workload workload = make_workload({make_dag("d", {{"first", 1000}, {"last", 1000, 1, {0}}})});
  workload.dags[0].deadline = 3 * kSecond;
  const runtime::Body nothing = [](const runtime::Job &) { return sched::Outcome::Finished; };
  const auto engine = make_engine(workload, true, {nothing, nothing});
  ASSERT_TRUE(engine->start());
  engine->set_origin(runtime::monotonic_now() - 10 * kSecond);
  for (const Duration age : {5 * kSecond, Duration{0}}) {
    const std::uint64_t before = engine->figures(TaskId(1)).jobs.finished;
    const Time nominal = engine->now() - age;
    engine->release(TaskId(0), nominal);
    engine->release(TaskId(1), nominal);
    while (engine->figures(TaskId(1)).jobs.finished == before) std::this_thread::yield();
  }
  EXPECT_EQ(engine->figures(TaskId(1)).late_end_to_end, 1U);
  EXPECT_EQ(engine->figures(TaskId(0)).late_end_to_end, 0U) << "not a sink";
}

TEST(Figures, AJobThatThrowsIsAMissWithoutAResponse) {
  const Workload workload = make_workload({make_dag("d", {{"bad", 1000}})});
  const auto engine =
      make_engine(workload, true, {[](const runtime::Job &) -> sched::Outcome { throw std::runtime_error("no"); }});
  ASSERT_TRUE(engine->start());
  engine->set_origin(runtime::monotonic_now());
  engine->release(TaskId(0), 0);
  while (engine->figures(TaskId(0)).jobs.aborted == 0) std::this_thread::yield();
  live::TaskSample task;
  fill(task, engine->figures(TaskId(0)));
  EXPECT_EQ(task.misses, 1U);
  EXPECT_EQ(task.response->counts().total(), 0U);
}

TEST(Figures, AreNotMeasuredUnasked) {
  const Workload workload = make_workload({make_dag("d", {{"t", 1000}})});
  const auto engine = make_engine(workload, false, {[](const runtime::Job &) { return sched::Outcome::Finished; }});
  EXPECT_EQ(engine->figures(TaskId(0)).response, nullptr);
}

std::optional<live::Page> own_page(const std::string &name) {
  for (live::Listed &listed : live::list_pages(live::kFolder)) {
    if (listed.pid == ::getpid() && listed.page && listed.page->frame.name == name) return std::move(*listed.page);
  }
  return std::nullopt;
}

TEST(LiveExecutor, IsSeenWhileItRuns) {
  runtime::ExecutorOptions options;
  options.name = "live-test";
  options.workers = 1;
  options.preemption = PreemptionMode::None;
  options.live = true;
  runtime::Executor executor(options);
  EXPECT_TRUE(executor.warnings().empty()) << executor.warnings().front();
  runtime::DagBuilder control("control", {.max_active = 2});
  const runtime::TaskHandle imu = control.timer("imu", 5ms, [] {}, {.wcet = 300us});
  control.data("ekf", {imu}, [] {});
  executor.add(std::move(control));
  runtime::DagBuilder gone("gone");
  gone.timer("t", 5ms, [] {});
  executor.remove(executor.add(std::move(gone)));
  executor.start();
  std::optional<live::Page> page;
  while (!page || page->frame.tasks.size() < 2 || page->frame.tasks[1].figures.finished == 0) {
    page = own_page("live-test");
    std::this_thread::sleep_for(10ms);
  }
  const live::Frame &frame = page->frame;
  EXPECT_EQ(frame.driver, "threads");
  EXPECT_EQ(frame.preemption, "none");
  EXPECT_EQ(frame.workers, 1U);
  ASSERT_EQ(frame.dags.size(), 1U);
  EXPECT_EQ(frame.dags[0].name, "control");
  EXPECT_EQ(frame.dags[0].max_active, 2U);
  EXPECT_EQ(frame.tasks[0].name, "imu");
  EXPECT_EQ(frame.tasks[0].deadline, 5 * kMillisecond);
  EXPECT_GT(frame.tasks[0].figures.response_max, 0);
  EXPECT_GT(frame.dags[0].figures.response_max, 0) << "end to end";
  EXPECT_EQ(frame.threads_in_all, 1U);
  executor.stop();
  EXPECT_FALSE(own_page("live-test"));
}

TEST(LiveExecutor, ShowsJobsThatWaitAndTheirDevices) {
  runtime::ExecutorOptions options;
  options.name = "waits-test";
  options.workers = 1;
  options.preemption = PreemptionMode::None;
  options.live = true;
  options.devices = {{.name = "gpu"}, {.name = "dla", .slots = 2}};
  runtime::Event go;
  AsyncEvent never;
  runtime::Executor executor(options);
  const runtime::DeviceHandle gpu = executor.device("gpu");
  runtime::DagBuilder camera("camera");
  // One job of each of the first two: one is served until the test says so, and the other one queues.
  camera.timer("first", 1h, [&]() -> Coroutine { co_await gpu.run([&] { go.wait(); }); });
  camera.timer("second", 2h, [&]() -> Coroutine { co_await gpu.run([] {}); });
  camera.timer("asleep", 3h, [&]() -> Coroutine { co_await never; });
  executor.add(std::move(camera));
  executor.start();
  const auto page_when = [](auto is_so) {
    for (;;) {
      std::optional<live::Page> page = own_page("waits-test");
      if (page && page->frame.tasks.size() == 3 && is_so(page->frame)) return *std::move(page);
      std::this_thread::sleep_for(10ms);
    }
  };
  const auto away = [](const live::Frame &frame) { return frame.dags[0].figures.away; };
  const live::Page waiting = page_when([&](const live::Frame &frame) { return away(frame) == 3; });
  go.set();
  EXPECT_EQ(waiting.frame.tasks[1].figures.active, 1U);
  EXPECT_EQ(waiting.frame.tasks[1].figures.away, 1U);
  EXPECT_EQ(waiting.frame.devices_in_all, 2U);
  ASSERT_EQ(waiting.frame.devices.size(), 2U);
  EXPECT_EQ(waiting.frame.devices[0].name, "gpu");
  EXPECT_EQ(waiting.frame.devices[0].used, 1U);
  EXPECT_EQ(waiting.frame.devices[0].queued, 1U);
  EXPECT_EQ(waiting.frame.devices[0].served, 0U);
  EXPECT_GT(waiting.frame.devices[0].busy, 0) << "the service in progress";
  EXPECT_EQ(waiting.frame.devices[0].tasks, std::vector<std::uint32_t>{0});
  EXPECT_EQ(waiting.frame.devices[1].slots, 2U);
  EXPECT_EQ(waiting.frame.devices[1].used, 0U);
  EXPECT_EQ(waiting.frame.threads[0].task, std::nullopt) << "the worker is free";
  const live::Page served = page_when([&](const live::Frame &frame) { return away(frame) == 1; });
  EXPECT_EQ(served.frame.devices[0].used, 0U);
  EXPECT_EQ(served.frame.devices[0].queued, 0U);
  EXPECT_EQ(served.frame.devices[0].served, 2U);
  EXPECT_GT(served.frame.devices[0].busy, 0);
  EXPECT_EQ(served.frame.tasks[2].figures.away, 1U);
  executor.stop();
}

struct Counts {
  std::uint64_t released = 0;
  std::uint64_t finished = 0;
  std::uint64_t skipped = 0;
  std::uint64_t aborted = 0;
  std::uint64_t missed = 0;

  friend bool operator==(const Counts &, const Counts &) = default;
  friend std::ostream &operator<<(std::ostream &out, const Counts &c) {
    return out << c.released << " released, " << c.finished << " finished, " << c.skipped << " skipped, " << c.aborted
               << " aborted, " << c.missed << " missed";
  }
};

// One job each is in time, late, and aborted, and one is skipped. The page, the figures of the executor, and the
// summary of the record count the same.
TEST(LiveExecutor, CountsAsTheRecordDoes) {
  const redag::testing::RecordedRun record;
  runtime::ExecutorOptions options;
  options.name = "counts-test";
  options.workers = 1;
  options.preemption = PreemptionMode::None;
  options.live = true;
  options.record = record.folder();
  options.on_exception = [](const runtime::ExceptionInfo &) { return runtime::OnException::Continue; };
  runtime::Executor executor(options);
  runtime::DagBuilder builder("d");
  const runtime::EventHandle tasks[] = {
      builder.event("in_time", 1h, [] {}),
      builder.event("late", 1h, [] { std::this_thread::sleep_for(2ms); }, {.deadline = 1ms}),
      builder.event("bad", 1h, [] { throw std::runtime_error("no"); }),
  };
  const DagId dag = executor.add(std::move(builder));
  executor.start();
  for (const runtime::EventHandle &task : tasks) executor.release(task);
  executor.release(tasks[0]);  // too early: skipped
  const std::vector<Counts> expected = {{2, 1, 1, 0, 1}, {1, 1, 0, 0, 1}, {1, 0, 0, 1, 1}};
  std::vector<Counts> live;
  for (std::uint64_t ended = 0; ended < 4;) {
    std::this_thread::sleep_for(10ms);
    const std::optional<live::Page> page = own_page("counts-test");
    if (!page) continue;
    live.clear();
    ended = 0;
    for (const live::TaskFrame &task : page->frame.tasks) {
      const live::page::Figures &f = task.figures;
      live.push_back({f.released, f.finished, f.skipped, f.aborted, f.misses});
      ended += f.finished + f.skipped + f.aborted;
    }
  }
  EXPECT_EQ(live, expected);
  std::vector<Counts> figures;
  for (const runtime::TaskStats &task : executor.stats(dag)) {
    const sched::Accounting &jobs = task.jobs;
    figures.push_back({jobs.released, jobs.finished, jobs.skipped, jobs.aborted, task.misses()});
  }
  EXPECT_EQ(figures, expected);
  executor.stop();
  std::vector<Counts> recorded;
  for (const metrics::TaskSummary &task : metrics::summarize(record.trace()).tasks) {
    const metrics::JobStats &jobs = task.jobs;
    recorded.push_back({jobs.released, jobs.finished, jobs.skipped, jobs.aborted, jobs.missed()});
  }
  EXPECT_EQ(recorded, expected);
}

TEST(LiveExecutor, IsNotSeenUnasked) {
  runtime::ExecutorOptions options;
  options.name = "hidden-test";
  options.workers = 1;
  options.preemption = PreemptionMode::None;
  runtime::Executor executor(options);
  executor.start();
  EXPECT_FALSE(std::filesystem::exists(live::page_path(live::kFolder, ::getpid(), 0)));
}

TEST(LiveRun, ShowsTheBoundsItIsGiven) {
  Workload workload = make_workload({make_dag("d", {{"a", 20}, {"b", 10'000}})}, 1, PreemptionMode::Cooperative);
  workload.name = "live-run";
  RunOptions options;
  options.duration = 20 * kSecond;
  options.live = true;
  options.bounds = [](const sched::Config &config) {
    EXPECT_EQ(config.preemption, sched::Preemption::Cooperative);
    return std::vector<Duration>{7 * kMillisecond, 0};
  };
  std::atomic<bool> stop{false};
  options.stop = &stop;
  std::optional<live::Page> page;
  options.progress = [&](Time, std::span<const JobEvent>) {
    auto seen = own_page("live-run");
    if (!seen || seen->frame.tasks.empty() || seen->frame.tasks[0].figures.finished == 0) return;
    page = std::move(seen);
    stop = true;
  };
  const Result<RunResult> result = run_workload(workload, options);
  ASSERT_TRUE(result) << to_string(result.error());
  ASSERT_TRUE(page);
  EXPECT_EQ(page->frame.tasks[0].bound, 7 * kMillisecond);
  EXPECT_EQ(page->frame.tasks[1].bound, 0);
  EXPECT_EQ(page->frame.preemption, "cooperative");
  EXPECT_FALSE(own_page("live-run"));
}

}  // namespace
}  // namespace redag::lab
