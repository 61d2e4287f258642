// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The bounds of the union against what really runs: a scheduler for each process, which knows only its own jobs, and a
// kernel below them, which runs the m most urgent started jobs of all processes. Virtual time, tick by tick.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/robot/plan.hpp"
#include "redag_lab/robot/union.hpp"
#include "redag_testing/bound_property.hpp"
#include "redag_testing/random_workloads.hpp"

namespace redag::robot {
namespace {

// Execution times and periods are multiples of it. The bounds count a job that has just started as 1 ns shorter, so
// that an error of one tick shows and these nanoseconds do not.
constexpr Duration kTick = 1000;

// One process: its scheduler, and the jobs that it has started.
class SimulatedProcess {
 public:
  struct Job {
    TaskId task;
    Time release = 0;
    Duration left = 0;
    int priority = 0;
    std::uint64_t since = 0;  // when it came to this priority, for SCHED_FIFO's order of equals
    bool runs = false;
  };

  SimulatedProcess(const Workload &workload, const runtime::PriorityBand &band, std::uint32_t workers, Ties ties)
      : tasks_(flatten(workload)), band_(band), scheduler_(workload, config(workload, band, workers, ties)) {}

  void release(TaskId task, Time nominal, Time now) { scheduler_.release(task, nominal, now); }

  // Ends the jobs that are done. Calls `finished` for each.
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
  }

  void dispatch(Time now, Rng &rng, std::uint64_t &sequence) {
    for (const sched::Dispatch &dispatch : scheduler_.dispatch(now).dispatches) {
      Job &job = jobs_[dispatch.job.value];
      if (dispatch.kind == sched::DispatchKind::Start) {
        const Duration wcet = tasks_[dispatch.task.value].task->wcet;
        const bool is_long = testing::chance(rng, 0.7);
        job = Job{
            .task = dispatch.task, .release = dispatch.release, .left = is_long ? wcet : kTick, .since = ++sequence};
      }
      const int priority = band_.of_level(dispatch.level);
      if (priority != job.priority) job.since = ++sequence;
      job.priority = priority;
    }
  }

  [[nodiscard]] std::map<std::uint32_t, Job> &jobs() { return jobs_; }
  [[nodiscard]] const std::vector<TaskRef> &tasks() const { return tasks_; }

 private:
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
};

// Runs the most urgent jobs for one tick. One that runs is not preempted by its equals.
void run_kernel(std::deque<SimulatedProcess> &processes, std::size_t cpus) {
  std::vector<SimulatedProcess::Job *> ready;
  for (SimulatedProcess &process : processes) {
    for (auto &[slot, job] : process.jobs()) ready.push_back(&job);
  }
  std::sort(ready.begin(), ready.end(), [](const auto *a, const auto *b) {
    if (a->priority != b->priority) return a->priority > b->priority;
    return a->runs != b->runs ? a->runs : a->since < b->since;
  });
  for (std::size_t i = 0; i < ready.size(); ++i) {
    ready[i]->runs = i < cpus;
    if (ready[i]->runs) ready[i]->left -= kTick;
  }
}

Workload random_process(Rng &rng) {
  testing::BoundCaseLimits limits;
  limits.min_workers = limits.max_workers = 2;
  limits.policies = {PolicyKind::RateMonotonic};
  limits.edges = testing::chance(rng, 0.6);
  limits.max_dags = 3;
  limits.max_tasks = 3;
  limits.groups = testing::chance(rng, 0.4);
  limits.caps = testing::chance(rng, 0.4);
  limits.min_utilization = 0.1;
  limits.max_utilization = 0.5;
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
  std::string violation;
};

// Simulates the processes, and compares each response with the bound of the task in the union.
Observed observe(const Robot &robot, const Plan &plan, const analysis::Report &report, std::size_t cpus,
                 std::uint64_t seed) {
  Rng rng(seed);
  std::deque<SimulatedProcess> processes;  // which cannot be moved
  struct Timer {
    std::size_t process;
    TaskId task;
    Time next;
    Duration period;
  };
  std::vector<Timer> timers;
  std::vector<std::size_t> first_task;  // of the process in the union
  std::size_t tasks = 0;
  Duration longest = 0;
  for (std::size_t p = 0; p < robot.processes.size(); ++p) {
    const Workload &workload = *robot.processes[p].workload;
    const auto band = runtime::with_levels(plan.band, levels_text(plan.of_executor[p])).value();
    const auto workers = static_cast<std::uint32_t>(cpus) + testing::between(rng, 0, 2);
    const Ties ties = testing::chance(rng, 0.5) ? Ties::Share : Ties::Fixed;
    processes.emplace_back(workload, band, workers, ties);
    std::vector<Duration> offsets;  // those of a DAG stay aligned
    for (const Dag &dag : workload.dags) {
      Duration period = kTick;
      for (const Task &task : dag.tasks) period = std::max(period, task.period);
      offsets.push_back(testing::between(rng, 0, static_cast<std::uint32_t>(period / kTick)) * kTick);
      longest = std::max(longest, period);
    }
    for (const TaskRef &ref : processes.back().tasks()) {
      if (ref.task->activation != Activation::Timer) continue;
      timers.push_back(Timer{p, ref.id, ref.task->offset + offsets[ref.dag.value], ref.task->period});
    }
    first_task.push_back(tasks);
    tasks += workload.task_count();
  }
  Observed observed;
  std::uint64_t sequence = 0;
  for (Time now = 0; now < 12 * longest; now += kTick) {
    for (std::size_t p = 0; p < processes.size(); ++p) {
      processes[p].complete(now, [&](const SimulatedProcess::Job &job) {
        const std::size_t id = first_task[p] + job.task.value;
        const std::optional<Duration> bound = report.tasks[id].response;
        if (!bound) return;
        ++observed.jobs;
        if (now - job.release > *bound + static_cast<Duration>(tasks) && observed.violation.empty()) {
          observed.violation = fmt::format("process {}, task {}: {} > {} by {}", p, job.task.value, now - job.release,
                                           *bound, report.tasks[id].method->name);
        }
      });
    }
    for (Timer &timer : timers) {
      if (timer.next > now) continue;
      processes[timer.process].release(timer.task, timer.next, now);
      timer.next += timer.period;
    }
    for (SimulatedProcess &process : processes) process.dispatch(now, rng, sequence);
    run_kernel(processes, cpus);
  }
  return observed;
}

Robot random_robot(Rng &rng, std::vector<int> cpus) {
  Robot robot;
  robot.name = "r";
  robot.cpu_sets = {CpuSet{"", std::move(cpus)}};
  for (std::uint32_t p = testing::between(rng, 2, 3); p > 0; --p) {
    Process process;
    process.name = fmt::format("p{}", p);
    process.workload = random_process(rng);
    robot.processes.push_back(std::move(process));
  }
  return robot;
}

// Bounds and order of a robot, for priorities up to `limit`.
struct Analysed {
  Plan plan;
  analysis::Report report;
};

Analysed analysed(const Robot &robot, int limit) {
  Plan plan = plan_of(robot, runtime::band_up_to(limit)).value();
  const LoadedWorkload united = union_of(robot, plan.band.levels()).value();
  return Analysed{std::move(plan), analysis::analyze(testing::compiled(united.workload))};
}

TEST(RobotUnionBounds, HoldForSchedulersAboveOneKernel) {
  std::uint64_t jobs = 0;
  std::uint64_t bounded = 0;
  const std::uint64_t count = testing::how_many(300);
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    Rng rng(seed);
    const Robot robot = random_robot(rng, testing::chance(rng, 0.3) ? std::vector{0} : std::vector{0, 1});
    const auto [plan, report] = analysed(robot, testing::chance(rng, 0.8) ? 90 : 5);
    bounded += std::any_of(report.tasks.begin(), report.tasks.end(), [](const auto &each) { return each.response; });
    for (std::uint64_t run = 0; run < 3; ++run) {
      const Observed observed = observe(robot, plan, report, robot.cpu_sets[0].cpus.size(), seed * 1000 + run);
      jobs += observed.jobs;
      ASSERT_EQ(observed.violation, "") << "seed " << seed << ", run " << run;
    }
  }
  EXPECT_GT(bounded, count / 2);
  EXPECT_GT(jobs, count * 50);
}

// The same comparison, where the kernel has one processor less than the union: it notices.
TEST(RobotUnionBounds, BreakWithFewerProcessors) {
  std::uint64_t violations = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Rng rng(seed);
    const Robot robot = random_robot(rng, {0, 1});
    const auto [plan, report] = analysed(robot, 90);
    if (!observe(robot, plan, report, 1, seed).violation.empty()) ++violations;
  }
  EXPECT_GT(violations, 10U);
}

}  // namespace
}  // namespace redag::robot
