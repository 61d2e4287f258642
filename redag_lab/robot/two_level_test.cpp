// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The bounds of the union against what really runs: a scheduler for each process, which knows only its own jobs and has
// its priorities from the order that all share (runtime::CommonOrder), and a kernel below them, which runs the m most
// urgent started jobs of all processes. A process learns of a release when the kernel runs its thread for releases,
// which takes no time. Virtual time, tick by tick.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/common_order.hpp"
#include "redag/threads/setup.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/robot/union.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::robot {
namespace {

// Execution times and periods are multiples of it. The bounds count a job that has just started as 1 ns shorter, so
// that an error of one tick shows and these nanoseconds do not.
constexpr Duration kTick = 1000;

// One process: its scheduler, and the jobs that it has started.
class SimulatedProcess {
 public:
  struct Job {
    TaskId task = {};
    Time release = 0;
    Time origin = 0;  // the release behind its data, in whatever process
    Duration left = 0;
    Duration until_high = 0;  // what it executes before HI mode begins; 0: it begins none
    int priority = 0;
    std::uint64_t since = 0;  // when it came to this priority, for SCHED_FIFO's order of equals
    bool runs = false;
  };

  SimulatedProcess(const Workload &workload, const runtime::PriorityBand &band, std::uint32_t workers, Ties ties)
      : tasks_(flatten(workload)), band_(band), scheduler_(workload, config(workload, band, workers, ties)) {}

  void release(TaskId task, Time nominal, Time now) { scheduler_.release(task, nominal, now); }

  // For the thread for releases.
  void expect(TaskId task, Time nominal, int priority, std::uint64_t &sequence) {
    if (due_.empty()) releasing_ = Job{.priority = priority, .since = ++sequence};
    due_.emplace_back(task, nominal);
  }
  [[nodiscard]] Job *releasing() { return due_.empty() ? nullptr : &releasing_; }
  void release_due(Time now) {
    for (const auto &[task, nominal] : due_) release(task, nominal, now);
    due_.clear();
  }

  // Ends the jobs that are done, and then begins HI mode for those that execute for longer than C(LO). Calls `finished`
  // for each that ends.
  template <class Finished>
  void complete(Time now, Finished finished) {
    for (auto job = jobs_.begin(); job != jobs_.end();) {
      if (job->second.left > 0) {
        ++job;
        continue;
      }
      finished(job->second);
      scheduler_.complete(JobSlot(job->first), now, sched::Outcome::Finished);
      job = jobs_.erase(job);
    }
    for (auto &[slot, job] : jobs_) {
      if (job.until_high != kReached) continue;
      job.until_high = 0;
      scheduler_.exceed(JobSlot(slot), sched::Limit::WcetLow, now);
      ++high_modes_;
    }
  }

  static void run(Job &job) {
    job.left -= kTick;
    if (job.until_high > 0) job.until_high = job.until_high > kTick ? job.until_high - kTick : kReached;
  }

  void dispatch(Time now, Rng &rng, std::uint64_t &sequence) {
    for (const sched::Dispatch &dispatch : scheduler_.dispatch(now).dispatches) {
      Job &job = jobs_[dispatch.job.value];
      if (dispatch.kind == sched::DispatchKind::Start) {
        const Duration wcet = tasks_[dispatch.task.value].task->wcet;
        const bool is_long = testing::chance(rng, 0.7);
        job = Job{.task = dispatch.task,
                  .release = dispatch.release,
                  .origin = dispatch.origin,
                  .left = is_long ? wcet : kTick,
                  .until_high = tasks_[dispatch.task.value].task->wcet_low,
                  .since = ++sequence};
      }
      const int priority = band_.of_level(dispatch.level);
      if (priority != job.priority) job.since = ++sequence;
      job.priority = priority;
    }
  }

  [[nodiscard]] std::map<std::uint32_t, Job> &jobs() { return jobs_; }
  [[nodiscard]] const std::vector<TaskRef> &tasks() const { return tasks_; }
  [[nodiscard]] std::uint64_t high_modes() const { return high_modes_; }

 private:
  static constexpr Duration kReached = -1;

  static sched::Config config(const Workload &workload, const runtime::PriorityBand &band, std::uint32_t workers,
                              Ties ties) {
    sched::Config config = sched::config_of(workload);
    config.workers = workers;
    config.preemption = sched::Preemption::Full;
    config.levels = band.levels();
    config.ties = ties;
    return config;
  }

  std::vector<TaskRef> tasks_;
  runtime::PriorityBand band_;
  sched::PriorityScheduler scheduler_;
  std::map<std::uint32_t, Job> jobs_;
  std::uint64_t high_modes_ = 0;
  std::vector<std::pair<TaskId, Time>> due_;  // releases that the process has not learned of
  Job releasing_;                             // its thread for releases, while there are some
};

// All jobs and threads for releases, in the kernel's order. A job that runs is not preempted by its equals.
std::vector<SimulatedProcess::Job *> in_order(std::deque<SimulatedProcess> &processes) {
  std::vector<SimulatedProcess::Job *> ready;
  for (SimulatedProcess &process : processes) {
    for (auto &[slot, job] : process.jobs()) ready.push_back(&job);
    if (process.releasing() != nullptr) ready.push_back(process.releasing());
  }
  std::sort(ready.begin(), ready.end(), [](const auto *a, const auto *b) {
    if (a->priority != b->priority) return a->priority > b->priority;
    return a->runs != b->runs ? a->runs : a->since < b->since;
  });
  return ready;
}

// Runs the threads for releases that have a processor, one after the other: each can start jobs.
void run_releases(std::deque<SimulatedProcess> &processes, std::size_t cpus, Time now, Rng &rng,
                  std::uint64_t &sequence) {
  const auto has_processor = [&](SimulatedProcess &process) {
    const auto ready = in_order(processes);
    const auto end = ready.begin() + static_cast<std::ptrdiff_t>(std::min(cpus, ready.size()));
    return process.releasing() != nullptr && std::find(ready.begin(), end, process.releasing()) != end;
  };
  for (auto process = processes.begin(); process != processes.end();) {
    if (!has_processor(*process)) {
      ++process;
      continue;
    }
    process->release_due(now);
    process->dispatch(now, rng, sequence);
    process = processes.begin();
  }
}

// Runs the most urgent jobs for one tick.
void run_kernel(std::deque<SimulatedProcess> &processes, std::size_t cpus) {
  const std::vector<SimulatedProcess::Job *> ready = in_order(processes);
  for (std::size_t i = 0; i < ready.size(); ++i) {
    ready[i]->runs = i < cpus;
    if (ready[i]->runs) SimulatedProcess::run(*ready[i]);
  }
}

Workload random_process(Rng &rng, double most_load, double groups) {
  testing::BoundCaseLimits limits;
  limits.min_workers = limits.max_workers = 2;
  limits.policies = {PolicyKind::RateMonotonic};
  limits.edges = testing::chance(rng, 0.6);
  limits.rates = limits.edges && testing::chance(rng, 0.3);
  limits.max_dags = 3;
  limits.max_tasks = 3;
  limits.groups = testing::chance(rng, groups);
  limits.caps = testing::chance(rng, 0.4);
  limits.min_utilization = most_load / 5;
  limits.max_utilization = most_load;
  limits.max_period = 40;
  Workload workload = testing::random_bound_case(rng, limits).workload;
  workload.platform.preemption = PreemptionMode::Os;
  for (Dag &dag : workload.dags) {
    dag.deadline *= kTick;
    for (Task &task : dag.tasks) {
      for (Duration *time : {&task.wcet, &task.bcet, &task.period, &task.deadline, &task.offset}) *time *= kTick;
    }
  }
  return workload;
}

struct Observed {
  std::uint64_t jobs = 0;
  std::uint64_t high_modes = 0;
  std::string violation;
};

// Simulates the processes, and compares each response with the bound of the task in the union. `lowered`: how far the
// threads for releases are below their priority.
Observed observe(const Robot &robot, const std::vector<runtime::PriorityBand> &bands, const analysis::Report &report,
                 std::size_t cpus, std::uint64_t seed, int lowered = 0) {
  Rng rng(seed);
  std::deque<SimulatedProcess> processes;  // which cannot be moved
  struct Timer {
    std::size_t process;
    TaskId task;
    Time next;
    Duration period;
  };
  std::vector<Timer> timers;
  std::vector<int> of_releases;         // by process
  std::vector<std::size_t> first_task;  // of the process in the union
  std::size_t tasks = 0;
  Duration longest = 0;
  for (std::size_t p = 0; p < robot.processes.size(); ++p) {
    const Workload &workload = robot.processes[p].workload;
    const runtime::PriorityBand &band = bands[p];
    const auto workers = static_cast<std::uint32_t>(cpus) + testing::between(rng, 0, 2);
    const Ties ties = testing::chance(rng, 0.5) ? Ties::Share : Ties::Fixed;
    processes.emplace_back(workload, band, workers, ties);
    of_releases.push_back(std::max(1, band.of_releases() - lowered));
    const auto below = [&](Duration period) {
      return testing::between(rng, 0, static_cast<std::uint32_t>(period / kTick) - 1) * kTick;
    };
    std::vector<Duration> offsets;  // those of a DAG stay aligned, but for tasks with a clock of their own
    for (const Dag &dag : workload.dags) {
      Duration period = kTick;
      for (const Task &task : dag.tasks) period = std::max(period, task.period);
      offsets.push_back(below(period));
      longest = std::max(longest, period);
    }
    for (const TaskRef &ref : processes.back().tasks()) {
      if (ref.task->activation != Activation::Timer) continue;
      const bool is_free = ref.task->phase != Phase::Common;
      const Time first = is_free ? below(ref.task->period) : ref.task->offset + offsets[ref.dag.value];
      timers.push_back(Timer{p, ref.id, first, ref.task->period});
    }
    first_task.push_back(tasks);
    tasks += workload.task_count();
  }
  Observed observed;
  std::uint64_t sequence = 0;
  for (Time now = 0; now < 12 * longest; now += kTick) {
    for (std::size_t p = 0; p < processes.size(); ++p) {
      processes[p].complete(now, [&](const SimulatedProcess::Job &job) {
        const analysis::Tightest &tightest = report.tasks[first_task[p] + job.task.value];
        const std::optional<Duration> bound = tightest.response;
        if (!bound) return;
        ++observed.jobs;
        const Duration response = now - job.release;
        if (response > *bound + static_cast<Duration>(tasks) && observed.violation.empty()) {
          observed.violation = fmt::format("process {}, task {}: {} > {} by {}", p, job.task.value, response, *bound,
                                           tightest.method->name);
        }
      });
    }
    for (Timer &timer : timers) {
      if (timer.next > now) continue;
      processes[timer.process].expect(timer.task, timer.next, of_releases[timer.process], sequence);
      timer.next += timer.period;
    }
    for (SimulatedProcess &process : processes) process.dispatch(now, rng, sequence);
    run_releases(processes, cpus, now, rng, sequence);
    run_kernel(processes, cpus);
  }
  for (const SimulatedProcess &process : processes) observed.high_modes += process.high_modes();
  return observed;
}

// `groups`: the share of the processes that have groups.
Robot random_robot(Rng &rng, std::vector<int> cpus, double most_load = 0.5, double groups = 0.4) {
  Robot robot;
  robot.name = "r";
  robot.cpu_sets = {CpuSet{"", std::move(cpus)}};
  for (std::uint32_t p = testing::between(rng, 2, 3); p > 0; --p) {
    Process process;
    process.name = fmt::format("p{}", p);
    process.workload = random_process(rng, most_load, groups);
    robot.processes.push_back(std::move(process));
  }
  return robot;
}

// The priorities that the executors of the processes have when they agree, by level.
std::vector<runtime::PriorityBand> bands_of(const Robot &robot, const runtime::PriorityBand &alone) {
  std::vector<live::OrderStatement> statements;
  for (const Process &process : robot.processes) {
    live::OrderStatement &statement = statements.emplace_back();
    statement.top_job = alone.top_job;
    for (const TaskRef &ref : flatten(process.workload)) statement.rates.push_back(ref.task->period);
    runtime::make_statable(statement.rates);
  }
  const runtime::CommonOrder order(statements);
  std::vector<runtime::PriorityBand> bands;
  for (const live::OrderStatement &statement : statements) {
    runtime::PriorityBand &band = bands.emplace_back(alone);
    for (const Duration rate : statement.rates) band.given.push_back(order.priority_of(rate));
  }
  return bands;
}

// The bounds of a robot, and the priorities of its executors.
struct Analysed {
  std::vector<runtime::PriorityBand> bands;
  analysis::Report report;
};

Analysed analysed(const Robot &robot) {
  const LoadedWorkload united = union_of(robot).value();
  return Analysed{bands_of(robot, runtime::band_up_to(runtime::kHighestPriority)),
                  analysis::analyze(testing::compiled(united.workload))};
}

TEST(RobotUnionBounds, HoldForSchedulersAboveOneKernel) {
  std::uint64_t jobs = 0;
  std::uint64_t bounded = 0;
  const std::uint64_t count = testing::how_many(300);
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    Rng rng(seed);
    const Robot robot = random_robot(rng, testing::chance(rng, 0.3) ? std::vector{0} : std::vector{0, 1});
    const auto [bands, report] = analysed(robot);
    bounded += std::any_of(report.tasks.begin(), report.tasks.end(), [](const auto &each) { return each.response; });
    for (std::uint64_t run = 0; run < 3; ++run) {
      const Observed observed = observe(robot, bands, report, robot.cpu_sets[0].cpus.size(), seed * 1000 + run);
      jobs += observed.jobs;
      ASSERT_EQ(observed.violation, "") << "seed " << seed << ", run " << run;
    }
  }
  EXPECT_GT(bounded, count / 2);
  EXPECT_GT(jobs, count * 50);
}

// Jobs that are started and do not run yet have their groups, and run as soon as a more urgent job waits for one.
TEST(RobotUnionBounds, HoldWithGroupsOnOneProcessor) {
  std::uint64_t bounded = 0;
  const std::uint64_t count = testing::how_many(1000);
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    Rng rng(seed);
    const Robot robot = random_robot(rng, {0}, 0.5, 1);
    const auto [bands, report] = analysed(robot);
    bounded += std::any_of(report.tasks.begin(), report.tasks.end(), [](const auto &each) { return each.response; });
    for (std::uint64_t run = 0; run < 3; ++run) {
      ASSERT_EQ(observe(robot, bands, report, 1, seed * 1000 + run).violation, "")
          << "seed " << seed << ", run " << run;
    }
  }
  EXPECT_GT(bounded, count / 2);
}

// While the other process's job of 7 ticks waits, two jobs of the log run for two jobs of the control.
TEST(RobotUnionBounds, CountEachHolderThatRunsForAMoreUrgentJob) {
  using testing::tick_dag;
  const auto process = [](const char *name, std::vector<Dag> dags) {
    Process one;
    one.name = name;
    one.workload = testing::make_workload(std::move(dags), 1, PreemptionMode::Os);
    return one;
  };
  Robot robot;
  robot.cpu_sets = {CpuSet{"", {0}}};
  robot.processes.push_back(
      process("base", {tick_dag("log", {{.name = "a", .period = 22 * kTick, .wcet = 2 * kTick, .group = "bus"},
                                        {.name = "b", .period = 22 * kTick, .wcet = 2 * kTick, .group = "bus"}}),
                       tick_dag("control", {{.name = "c", .period = 8 * kTick, .wcet = kTick, .group = "bus"}})}));
  robot.processes.push_back(
      process("camera", {tick_dag("images", {{.name = "d", .period = 17 * kTick, .wcet = 7 * kTick}})}));
  const analysis::Tightest bound = analysed(robot).report.tasks.back();
  ASSERT_TRUE(bound.response);
  EXPECT_GE(*bound.response, 12 * kTick);
}

// A robot in which jobs of some processes begin HI mode.
Robot with_modes(Rng &rng) {
  Robot robot = random_robot(rng, {0}, 0.8, 0);
  for (Process &process : robot.processes) {
    if (testing::chance(rng, 0.4)) continue;
    for (Dag &dag : process.workload.dags) {
      if (testing::chance(rng, 0.5)) {
        dag.degrade.kind = testing::chance(rng, 0.5) ? Degrade::Kind::Stop : Degrade::Kind::Skip;
        continue;
      }
      dag.criticality = Criticality::High;
      for (Task &task : dag.tasks) {
        const auto wcet = static_cast<std::uint32_t>(task.wcet / kTick);
        if (wcet > 1) task.wcet_low = testing::between(rng, 1, wcet - 1) * kTick;
      }
    }
  }
  return robot;
}

// HI mode of one process stops no work of the others, and ends when that process is idle.
TEST(RobotUnionBounds, HoldWhereProcessesHaveHiModesOfTheirOwn) {
  std::uint64_t bounded = 0;
  std::uint64_t high_modes = 0;
  const std::uint64_t count = testing::how_many(400);
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    Rng rng(seed);
    const Robot robot = with_modes(rng);
    const auto [bands, report] = analysed(robot);
    bounded += std::any_of(report.tasks.begin(), report.tasks.end(), [](const auto &each) { return each.response; });
    for (std::uint64_t run = 0; run < 3; ++run) {
      const Observed observed = observe(robot, bands, report, 1, seed * 1000 + run);
      high_modes += observed.high_modes;
      ASSERT_EQ(observed.violation, "") << "seed " << seed << ", run " << run;
    }
  }
  EXPECT_GT(bounded, count / 4);
  EXPECT_GT(high_modes, 3 * count);
}

// The process with the urgent work never learns of HI mode.
TEST(RobotUnionBounds, CountAllWorkOfProcessesThatDoNotLearnOfHiMode) {
  using testing::tick_dag;
  Robot robot;
  robot.cpu_sets = {CpuSet{"", {0}}};
  Dag high = tick_dag("hi", {{.name = "s", .period = 20 * kTick, .wcet = 5 * kTick}});
  high.criticality = Criticality::High;
  high.tasks[0].wcet_low = kTick;
  const Dag other = tick_dag("lo", {{.name = "s", .period = 5 * kTick, .wcet = 3 * kTick}});
  for (const Dag &dag : {high, other}) {
    Process &process = robot.processes.emplace_back();
    process.name = dag.name;
    process.workload = testing::make_workload({dag}, 1, PreemptionMode::Os);
  }
  const analysis::Report report = analysed(robot).report;
  // 5 of its own and three jobs of 3; the other process is bounded in every mode, too.
  EXPECT_EQ(report.tasks[0].response, 14 * kTick);
  EXPECT_EQ(report.tasks[1].response, 3 * kTick);
}

// The same comparison, where less urgent jobs of other processes delay releases: it notices.
TEST(RobotUnionBounds, BreakWhereReleasesAreLessUrgentThanJobs) {
  std::uint64_t violations = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Rng rng(seed);
    const Robot robot = random_robot(rng, {0, 1});
    const auto [bands, report] = analysed(robot);
    if (!observe(robot, bands, report, 2, seed, 90).violation.empty()) ++violations;
  }
  EXPECT_GT(violations, 10U);
}

// The same comparison, where the kernel has one processor less than the union: it notices.
TEST(RobotUnionBounds, BreakWithFewerProcessors) {
  std::uint64_t violations = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Rng rng(seed);
    const Robot robot = random_robot(rng, {0, 1});
    const auto [bands, report] = analysed(robot);
    if (!observe(robot, bands, report, 1, seed).violation.empty()) ++violations;
  }
  EXPECT_GT(violations, 10U);
}

}  // namespace
}  // namespace redag::robot
