// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A robot of two hosts is simulated on one true clock. The record of each host has the times of its own clock, which is
// off and drifts. What is stated of the clocks is true, but uncertain. Merging must then say nothing wrong.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "redag/base/int128.hpp"
#include "redag/base/rng.hpp"
#include "redag/sched/policy.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_lab/hosts/chains.hpp"
#include "redag_lab/hosts/merged_run.hpp"
#include "redag_testing/builders.hpp"

namespace redag::hosts {
namespace {

using testing::make_dag;
using testing::make_workload;

constexpr Duration kPeriod = 33 * kMillisecond;
constexpr Duration kHorizon = kSecond;  // of at most 31 answers: ChainFigures::worst has all of them
constexpr Duration kTransport = kMillisecond;

using Delay = std::function<Duration(const Task &, std::uint32_t number)>;

trace::Trace simulated(const Workload &workload, std::uint64_t seed, const Delay &delay) {
  trace::Trace trace;
  trace.info.workload = workload;
  trace.info.executor = "redag";
  trace.info.config = sched::config_of(workload);
  trace.info.preemption = trace::preemption_name(trace.info.config.preemption);
  trace.info.driver = trace::Driver::Threads;  // it stands for a record of real hosts
  trace.info.end = kHorizon;
  const auto scheduler = executors::make_scheduler("redag", workload, trace.info.config);
  sim::Options options;
  options.horizon = kHorizon;
  options.seed = seed;
  options.jitter = [&](const Task &task, TaskId, std::uint32_t number) { return delay(task, number); };
  sim::simulate(workload, *scheduler, workload.platform.workers, options, [&](std::span<const JobEvent> events) {
    trace.events.insert(trace.events.end(), events.begin(), events.end());
    return true;
  });
  return trace;
}

std::vector<metrics::JobRecord> jobs_of(const trace::Trace &trace, const std::string &name) {
  std::vector<metrics::JobRecord> jobs;
  for (const metrics::JobRecord &job : metrics::fold_jobs(trace.info.workload, trace.events)) {
    if (trace::task_name(trace.info.workload, job.task) == name) jobs.push_back(job);
  }
  return jobs;
}

/// The robot in true time. Each job of `detect` that ends releases one of `obstacles` on the other host, and each job
/// of `brake` one of `show` on the first.
struct Robot {
  Robot(Rng &rng, Duration deadline) {
    Workload vision = make_workload(
        {make_dag("camera",
                  {{.name = "grab", .period = 33, .wcet = 2}, {.name = "detect", .wcet = 12, .after = {0}, .bcet = 6}}),
         make_dag("display", {{.name = "show", .period = 33, .wcet = 3, .deadline = 25, .bcet = 1}})},
        2);
    Workload drive = make_workload({make_dag("control", {{.name = "pid", .period = 5, .wcet = 1}}),
                                    make_dag("avoid", {{.name = "obstacles", .period = 33, .wcet = 1},
                                                       {.name = "brake", .wcet = 2, .after = {0}, .bcet = 1}})});
    for (Workload *workload : {&vision, &drive}) {
      for (Dag &dag : workload->dags) {
        for (Task &task : dag.tasks) task.execution.kind = ExecutionTime::Kind::Uniform;
      }
    }
    drive.dags[1].deadline = deadline;
    const std::uint64_t seed = rng();
    const std::uint64_t transports = rng();
    // When the data of the job with this number come: its end and the transport, after the release behind it.
    const auto arrival = [&](const std::vector<metrics::JobRecord> &from, std::uint32_t number) {
      Rng own(transports + number);
      if (number >= from.size() || from[number].outcome != metrics::JobOutcome::Finished) return kPeriod - 1;
      return from[number].finish - number * kPeriod + own.uniform(0, kTransport);
    };
    const auto none = [](const Task &, std::uint32_t) { return Duration{0}; };
    const auto detected = jobs_of(simulated(vision, seed, none), "camera.detect");
    on_drive = simulated(drive, seed, [&](const Task &task, std::uint32_t number) {
      return task.name == "obstacles" ? arrival(detected, number) : 0;
    });
    const auto braked = jobs_of(on_drive, "avoid.brake");
    on_vision = simulated(vision, seed, [&](const Task &task, std::uint32_t number) {
      return task.name == "show" ? arrival(braked, number) : 0;
    });
  }

  trace::Trace on_vision;
  trace::Trace on_drive;
};

/// A clock, as a function of the true time: off by a constant and a rate in parts per billion.
struct SkewedClock {
  Duration offset = 0;
  Duration rate = 0;

  [[nodiscard]] Time at(Time true_time) const {
    return true_time + offset + static_cast<Duration>(Int128{true_time} * rate / 1'000'000'000);
  }
};

// The bytes of a host's record. Its times are those of `clock` since `zero` of that clock.
std::string recorded(trace::Trace trace, const SkewedClock &clock, Time zero) {
  const auto own = [&](Time time) { return clock.at(time) - zero; };
  trace.info.start = own(trace.info.start);
  trace.info.end = own(trace.info.end);
  std::string text = trace::events_header(trace.info);
  for (JobEvent event : trace.events) {
    event.time = own(event.time);
    const bool has_time = event.kind == JobEventKind::Released || event.kind == JobEventKind::Ready ||
                          event.kind == JobEventKind::Dispatched || event.kind == JobEventKind::Started ||
                          event.kind == JobEventKind::Finished;
    if (has_time) event.value = own(event.value);
    trace::append_event_line(event, text);
  }
  return text + trace::events_footer(trace.events.size(), trace.info.end, 0);
}

HostRun host_of(const std::string &name, const std::string &bytes, ClockStatement statement) {
  Result<trace::EventsReader> reader = trace::EventsReader::of(bytes, name);
  return {name, name, *std::move(reader), std::move(statement)};
}

const std::vector<Link> kLinks = {
    {.from = "vision.camera.detect", .to = "drive.avoid.obstacles", .transport = kTransport},
    {.from = "drive.avoid.brake", .to = "vision.display.show", .transport = kTransport},
};

// A true but uncertain statement about a clock, in each of the ways in which a user can make one.
ClockStatement statement_about(const SkewedClock &clock, Duration uncertainty, Rng &rng) {
  const auto reading = [&](Instant at, Time true_time) {
    const Duration offset = clock.at(true_time) - true_time;
    // Whole nanoseconds: a clock with a rate shows up to 1 ns less than it would without rounding.
    return OffsetReading{offset + rng.uniform(-uncertainty, uncertainty), uncertainty + 2, at};
  };
  const Instant start{Instant::Kind::Start};
  const Instant end{Instant::Kind::End};
  ClockStatement statement;
  if (clock.rate == 0 && rng.uniform(0, 1) == 0) {
    statement.readings = {reading({}, 0)};
    return statement;
  }
  switch (rng.uniform(0, 3)) {
    case 0: statement.readings = {reading(start, 0), reading(end, kHorizon)}; break;
    case 1: {
      const Time at = rng.uniform(0, kHorizon);
      const Duration after = clock.at(at) - clock.at(0);
      statement.readings = {reading({Instant::Kind::After, after}, at)};
      statement.rate = std::abs(clock.rate) + rng.uniform(1, 10'000);
      break;
    }
    case 2:
      statement.readings = {reading(start, 0), reading(end, kHorizon)};
      statement.rate = std::abs(clock.rate) + rng.uniform(1, 10'000);
      break;
    default: {
      const Duration a = clock.at(0);
      const Duration b = clock.at(kHorizon) - kHorizon;
      statement.kept_within = Interval{std::min(a, b) - uncertainty - 2, std::max(a, b) + uncertainty + 2};
      break;
    }
  }
  return statement;
}

/// The records of both hosts with skewed clocks, and the chains that follow from them.
class Merged {
 public:
  Merged(const Robot &robot, std::span<const Link> links, Rng &rng) {
    constexpr std::array<Duration, 5> kUncertainties = {0, 2 * kMicrosecond, 80 * kMicrosecond, kMillisecond,
                                                        20 * kMillisecond};
    const bool has_system_clock = rng.uniform(0, 1) == 0;
    for (const auto &[name, truth] : {std::pair("vision", &robot.on_vision), {"drive", &robot.on_drive}}) {
      SkewedClock clock{rng.uniform(-kSecond, kSecond), 0};
      if (rng.uniform(0, 2) > 0) clock.rate = rng.uniform(-50'000, 50'000);
      const Duration uncertainty = kUncertainties[static_cast<std::size_t>(rng.uniform(0, 4))];
      ClockStatement statement = statement_about(clock, uncertainty, rng);
      trace::Trace trace = *truth;
      Time zero = 0;
      Duration error = 0;
      if (has_system_clock) {
        zero = rng.uniform(-kSecond, kSecond) * 1000;
        error = rng.uniform(0, 2000);
        const Time at = rng.uniform(-kSecond, 2 * kSecond);
        trace.info.clock = trace::ClockReading{at, at + zero + kSecond * 2000 + rng.uniform(-error, error), error};
      }
      bytes_.push_back(recorded(std::move(trace), clock, zero));
      // The drift over the run is at most 50 us, stated with up to 10 us more.
      uncertain_ += 2 * uncertainty + error + 70 * kMicrosecond;
      runs_.push_back(host_of(name, bytes_.back(), std::move(statement)));
    }
    Result<MergedRun> merged = merge(runs_);
    if (!merged) return;
    run_ = *std::move(merged);
    Result<std::vector<Chain>> chains = find_chains(run_, links);
    if (!chains || chains->size() != 1) return;
    watch_ = std::make_unique<ChainWatch>(run_, *std::move(chains));
    is_sound_ = visit_merged(
                    run_, runs_, [] { return false; }, [&](auto events) { watch_->add(events); })
                    .has_value();
    watch_->finish();
  }

  [[nodiscard]] bool is_sound() const { return is_sound_; }
  [[nodiscard]] const Chain &chain() const { return watch_->chains().front(); }
  [[nodiscard]] const ChainFigures &figures() const { return watch_->figures().front(); }
  /// The most by which a time of one host can be wrong for the other one.
  [[nodiscard]] Duration uncertain() const { return uncertain_; }

 private:
  std::deque<std::string> bytes_;  // the readers refer to them
  std::vector<HostRun> runs_;
  MergedRun run_;
  std::unique_ptr<ChainWatch> watch_;
  Duration uncertain_ = 0;
  bool is_sound_ = false;
};

// From one host to the other, the bounds contain the true latency, and no verdict is wrong.
RC_GTEST_PROP(SimulatedHosts, NoMissIsClaimedWrongly, ()) {
  Rng rng(*rc::gen::arbitrary<std::uint64_t>());
  const Duration deadline = rng.uniform(11 * kMillisecond, 19 * kMillisecond);
  const Robot robot(rng, deadline);
  const Merged merged(robot, std::span(kLinks).first(1), rng);
  RC_ASSERT(merged.is_sound());
  RC_ASSERT(merged.chain().deadline == deadline);
  const ChainFigures &figures = merged.figures();
  RC_ASSERT(figures.unmatched == 0U);
  RC_ASSERT(figures.answers >= 20U);
  RC_ASSERT(figures.answers == figures.worst.size());
  RC_ASSERT(figures.count(Verdict::Met) + figures.count(Verdict::Missed) + figures.count(Verdict::Unknown) ==
            figures.answers);
  const auto braked = jobs_of(robot.on_drive, "avoid.brake");
  for (const Answer &answer : figures.worst) {
    const Duration latency = braked[answer.job].finish - braked[answer.job].origin;
    RC_ASSERT(answer.latency.low <= latency);
    RC_ASSERT(latency <= answer.latency.high);
    if (!answer.is_ambiguous) RC_ASSERT(answer.latency.width() <= 2 * merged.uncertain());
    const Verdict verdict = judge(answer.latency, deadline);
    if (verdict == Verdict::Missed) RC_ASSERT(latency > deadline);
    if (verdict == Verdict::Met) RC_ASSERT(latency <= deadline);
  }
}

// A chain that returns to its host is measured by one clock.
RC_GTEST_PROP(SimulatedHosts, AChainThatReturnsIsMeasuredByOneClock, ()) {
  Rng rng(*rc::gen::arbitrary<std::uint64_t>());
  const Robot robot(rng, 0);
  const Merged merged(robot, kLinks, rng);
  RC_ASSERT(merged.is_sound());  // with one chain: `brake` is no end, because its data go on
  const ChainFigures &figures = merged.figures();
  RC_ASSERT(figures.unmatched == 0U);
  RC_ASSERT(figures.answers == figures.worst.size());
  const auto shown = jobs_of(robot.on_vision, "display.show");
  for (const Answer &answer : figures.worst) {
    const Duration latency = shown[answer.job].finish - shown[answer.job].origin;
    // The clock of the host rounds both ends to nanoseconds.
    RC_ASSERT(answer.latency.low <= latency + 1);
    RC_ASSERT(latency <= answer.latency.high + 1);
  }
}

// With exact offsets, the merged run is the robot's run: every event at its true time, and nothing to complain about.
TEST(SimulatedHosts, ExactOffsetsGiveBackTheTrueRun) {
  Rng rng(7);
  Robot robot(rng, 0);
  for (trace::Trace *trace : {&robot.on_vision, &robot.on_drive}) {
    for (Dag &dag : trace->info.workload.dags) {
      for (Task &task : dag.tasks) {
        if (task.name == "obstacles" || task.name == "show") task.jitter = kPeriod;
      }
    }
  }
  const SkewedClock vision{250 * kMillisecond, 0};
  const SkewedClock drive{-3 * kSecond, 0};
  const std::string bytes[] = {recorded(robot.on_vision, vision, 0), recorded(robot.on_drive, drive, 0)};
  std::vector<HostRun> runs;
  runs.push_back(host_of("vision", bytes[0], {.readings = {{.value = vision.offset}}}));
  runs.push_back(host_of("drive", bytes[1], {.readings = {{.value = drive.offset}}}));
  const Result<MergedRun> merged = merge(runs);
  ASSERT_TRUE(merged) << to_string(merged.error());
  trace::Trace trace{merged->info, {}};
  ASSERT_TRUE(visit_merged(
      *merged, runs, [] { return false; },
      [&](auto events) { trace.events.insert(trace.events.end(), events.begin(), events.end()); }));
  const std::size_t most = robot.on_vision.events.size() + robot.on_drive.events.size();
  EXPECT_GT(trace.events.size(), most - 10);  // what ends after the run is left out
  const auto shown = [](const metrics::JobRecord &job) {
    return std::tuple(job.number, job.release, job.ready, job.start, job.finish, job.deadline, job.origin);
  };
  for (const auto &[truth, name] : {std::pair(&robot.on_vision, "camera.detect"), {&robot.on_drive, "avoid.brake"}}) {
    const auto before = jobs_of(*truth, name);
    const auto after = jobs_of(trace, (truth == &robot.on_vision ? "vision/" : "drive/") + std::string(name));
    ASSERT_GE(before.size(), 25U);
    for (std::size_t i = 0; i + 2 < before.size(); ++i) {
      metrics::JobRecord moved = before[i];  // the first host keeps its times, which are 250 ms ahead
      for (Time *time : {&moved.release, &moved.ready, &moved.start, &moved.finish, &moved.deadline, &moved.origin}) {
        *time += vision.offset;
      }
      EXPECT_EQ(shown(after[i]), shown(moved));
    }
  }
  const metrics::CheckReport check = metrics::check_trace(trace);
  EXPECT_TRUE(check.ok()) << check.to_string();
  EXPECT_GT(check.checks(metrics::Rule::Grid), 200U);
}

}  // namespace
}  // namespace redag::hosts
