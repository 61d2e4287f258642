// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Budgets and modes as a user would check them: schedules computed by hand, and the guarantees of jobs of high
// criticality under any further load.
#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/miss.hpp"
#include "redag_analysis/one_worker/amc.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/drivers.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::testing {
namespace {

Workload on_one_worker(std::vector<Dag> dags) { return make_workload(std::move(dags), 1, PreemptionMode::Os); }

std::size_t count(const std::vector<JobEvent> &events, JobEventKind kind) {
  return static_cast<std::size_t>(
      std::count_if(events.begin(), events.end(), [kind](const JobEvent &event) { return event.kind == kind; }));
}

TEST(Budgets, ADemotedJobGoesOnBelowEverythingElse) {
  Workload workload = on_one_worker({make_dag("a", {{"long", 20, 5}}), make_dag("b", {{"other", 40, 3}})});
  workload.dags[0].tasks[0].budget = 2 * kMillisecond;
  workload.dags[0].tasks[0].on_budget = OnBudget::Demote;
  EXPECT_EQ(timeline(workload, simulate_events(workload, 20 * kMillisecond)), "long#0 w0 0-2 w0 5-8\nother#0 w0 2-5\n");
}

TEST(Budgets, TheNextReleaseIsSkipped) {
  Workload workload = on_one_worker({make_dag("a", {{"t", 10, 3}})});
  workload.dags[0].tasks[0].budget = 2 * kMillisecond;
  workload.dags[0].tasks[0].on_budget = OnBudget::SkipNext;
  EXPECT_EQ(timeline(workload, simulate_events(workload, 40 * kMillisecond)),
            "t#0 w0 0-3\nt#2 w0 20-23\nt#1 skipped budget 10\nt#3 skipped budget 30\n");
}

TEST(Budgets, ALoggedOneChangesNothing) {
  Workload workload = on_one_worker({make_dag("a", {{"t", 10, 3}})});
  workload.dags[0].tasks[0].budget = 2 * kMillisecond;
  workload.dags[0].tasks[0].on_budget = OnBudget::Log;
  const std::vector<JobEvent> events = simulate_events(workload, 20 * kMillisecond);
  EXPECT_EQ(timeline(workload, events), "t#0 w0 0-3\nt#1 w0 10-13\n");
  EXPECT_EQ(count(events, JobEventKind::Exceeded), 2U);
}

TEST(Budgets, ExactlyTheBudgetIsWithinIt) {
  Workload workload = on_one_worker({make_dag("a", {{"t", 10, 3}})});
  workload.dags[0].tasks[0].budget = 3 * kMillisecond;
  workload.dags[0].tasks[0].on_budget = OnBudget::Log;
  EXPECT_EQ(count(simulate_events(workload, 20 * kMillisecond), JobEventKind::Exceeded), 0U);
}

Workload two_criticalities() {
  Workload workload = on_one_worker({make_dag("hi", {{"h", 20, 9}}), make_dag("lo", {{"l", 10, 3}})});
  workload.dags[0].criticality = Criticality::High;
  workload.dags[0].tasks[0].wcet_low = 2 * kMillisecond;
  return workload;
}

// h has executed 2 ms at 5. It ends at 12, an idle instant.
TEST(HighMode, StopsWhatIsLessCriticalUntilAnIdleInstant) {
  const Workload workload = two_criticalities();
  const std::vector<JobEvent> events = simulate_events(workload, 30 * kMillisecond);
  EXPECT_EQ(timeline(workload, events), "l#0 w0 0-3\nh#0 w0 3-12\nl#2 w0 20-23\nh#1 w0 23-\nl#1 skipped degraded 10\n");
  std::vector<Time> changes;
  for (const JobEvent &event : events) {
    if (is_mode_change(event.kind)) changes.push_back(event.time);
  }
  EXPECT_EQ(changes, (std::vector<Time>{5 * kMillisecond, 12 * kMillisecond, 25 * kMillisecond}));
}

// Every second release is let through, below h.
TEST(HighMode, LetsThroughWhatDegradeSays) {
  Workload workload = two_criticalities();
  workload.dags[0].tasks[0] = make_dag("hi", {{"h", 100, 60}}).tasks[0];
  workload.dags[0].tasks[0].wcet_low = 2 * kMillisecond;
  for (const auto &degrade : {Degrade{Degrade::Kind::Skip, 1, 2}, Degrade{Degrade::Kind::Stretch, 1, 2}}) {
    workload.dags[1].degrade = degrade;
    EXPECT_EQ(timeline(workload, simulate_events(workload, 50 * kMillisecond)),
              "l#0 w0 0-3\nh#0 w0 3-\nl#2 skipped degraded 20\nl#1 skipped overrun 30\nl#4 skipped degraded 40\n");
  }
}

TEST(HighMode, DoesNotBeginForJobsWithinTheirWcetLow) {
  Workload workload = two_criticalities();
  workload.dags[0].tasks[0].wcet_low = workload.dags[0].tasks[0].wcet;
  EXPECT_EQ(count(simulate_events(workload, kSecond), JobEventKind::HighMode), 0U);
}

// The time spans in which HI mode was on.
class HighModeSpans {
 public:
  HighModeSpans(const std::vector<JobEvent> &events, Time end) {
    for (const JobEvent &event : events) {
      if (event.kind == JobEventKind::HighMode) spans_.emplace_back(event.time, end);
      if (event.kind == JobEventKind::LowMode) spans_.back().second = event.time;
    }
  }
  [[nodiscard]] bool overlap(Time from, Time to) const {
    return std::any_of(spans_.begin(), spans_.end(), [&](const auto &s) { return s.first <= to && from <= s.second; });
  }

 private:
  std::vector<std::pair<Time, Time>> spans_;
};

BoundCase random_criticalities(Rng &rng) {
  BoundCaseLimits limits;
  limits.edges = rng.uniform01() < 0.4;
  limits.jitter = rng.uniform01() < 0.5;
  limits.levels = rng.uniform01() < 0.3;
  BoundCase drawn = random_bound_case(rng, limits);
  for (Dag &dag : drawn.workload.dags) {
    dag.criticality = static_cast<Criticality>(rng.uniform(0, 2));
    if (dag.criticality == Criticality::High) {
      for (Task &task : dag.tasks) task.wcet_low = rng.uniform(1, task.wcet);
      continue;
    }
    dag.degrade.kind = static_cast<Degrade::Kind>(rng.uniform(0, 2));
    // A budget limits a task to its wcet, however long it tries to execute. Tasks with edges have none: a job that is
    // cut off has no output, for which others would wait.
    for (Task &task : dag.tasks) task.budget = limits.edges ? 0 : task.wcet;
  }
  return drawn;
}

void offset_at_random(Workload &workload, const analysis::TaskSet &task_set, bool all_at_once, Rng &rng) {
  std::vector<Duration> offsets;
  for (const analysis::Unit &unit : task_set.units) offsets.push_back(all_at_once ? 0 : rng.uniform(0, unit.period));
  std::uint32_t id = 0;
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      const Duration offset = offsets[task_set.tasks[id++].unit];
      if (task.activation == Activation::Timer) task.offset = offset;
    }
  }
}

std::vector<JobEvent> simulate(const BoundCase &drawn, Duration horizon, std::uint64_t seed,
                               std::function<Duration(const Task &, TaskId, std::uint32_t)> demand) {
  sim::Options options;
  options.horizon = horizon;
  options.seed = seed;
  options.demand = std::move(demand);
  sched::Config config;
  config.policy = drawn.workload.policy;
  config.ties = drawn.workload.ties;
  config.preemption = sched::Preemption::Full;
  config.levels = drawn.platform.levels;
  sched::PriorityScheduler scheduler(drawn.workload, config);
  std::vector<JobEvent> events;
  sim::simulate(drawn.workload, scheduler, 1, options, [&](std::span<const JobEvent> batch) {
    events.insert(events.end(), batch.begin(), batch.end());
    return true;
  });
  return events;
}

// Tasks of high criticality execute for wcet_low or for anything up to wcet; the others try to exceed their budget.
std::vector<JobEvent> simulate_overruns(const BoundCase &drawn, Duration horizon, double overruns, std::uint64_t seed) {
  return simulate(drawn, horizon, seed, [&](const Task &task, TaskId task_id, std::uint32_t number) {
    Rng dice = Rng::stream(seed, task_id.value, number);
    if (task.budget > 0) return dice.uniform01() < overruns ? 3 * task.wcet : task.wcet;
    const Duration expected = task.wcet_low > 0 ? task.wcet_low : task.wcet;
    return dice.uniform01() < overruns ? dice.uniform(1, task.wcet) : expected;
  });
}

// No job of high criticality answers later than its bound, and no job that ends in LO mode later than its bound for
// that mode. If a deadline is not shown met in LO mode, jobs can be skipped, and lower criticality is not judged.
void check_amc(std::uint64_t seed, std::uint64_t &judged, std::uint64_t &changes) {
  Rng rng(seed);
  BoundCase drawn = random_criticalities(rng);
  const auto task_set = analysis::compile(drawn.workload, drawn.platform);
  ASSERT_TRUE(task_set) << to_string(task_set.error());
  if (!task_set->has_modes) return;
  const analysis::Outcome outcome = analysis::amc_rtb().apply(*task_set);
  const auto *bound = std::get_if<analysis::Bound>(&outcome);
  if (bound == nullptr) return;
  ++judged;
  const bool low_is_met = bound->figures.find("LO mode every deadline is met") != std::string::npos;
  constexpr Duration kHorizon = 1500;
  for (int run = 0; run < 4; ++run) {
    offset_at_random(drawn.workload, *task_set, run == 0, rng);
    const double overruns = run == 0 ? 0.1 : rng.uniform01();
    const std::vector<JobEvent> events = simulate_overruns(drawn, kHorizon, overruns, rng());
    const HighModeSpans spans(events, kHorizon);
    changes += count(events, JobEventKind::HighMode);
    for (const metrics::JobRecord &job : metrics::fold_jobs(drawn.workload, events)) {
      const std::size_t t = job.task.value;
      const Time end = job.outcome == metrics::JobOutcome::InFlight ? kHorizon : job.finish;
      const bool high = task_set->dags[task_set->tasks[t].dag.value].high;
      const auto limit = high ? bound->tasks[t].response : bound->modes[t].low;
      if (!limit || (!high && (!low_is_met || spans.overlap(job.release, end)))) continue;
      ASSERT_LE(end - job.release, *limit)
          << "seed " << seed << " run " << run << " task " << t << " job " << job.number << "\n"
          << describe(drawn);
      ASSERT_NE(job.outcome, metrics::JobOutcome::Skipped)
          << "seed " << seed << " run " << run << " task " << t << " job " << job.number << "\n"
          << describe(drawn);
    }
  }
}

TEST(HighMode, AmcBoundsHoldUnderRandomOverruns) {
  const std::uint64_t wanted = how_many(1500);
  std::uint64_t judged = 0;
  std::uint64_t changes = 0;
  for (std::uint64_t seed = 1; judged < wanted && !::testing::Test::HasFatalFailure(); ++seed) {
    check_amc(seed, judged, changes);
  }
  EXPECT_GT(changes, wanted) << "HI mode was hardly ever on";
}

// Every job of lower criticality asks for ten times the platform, whatever its period; its budget limits it to its wcet
// in LO mode. Tasks of high criticality that amc_rtb shows met in every mode miss nothing.
void check_overload(std::uint64_t seed, std::uint64_t &judged, std::uint64_t &cut_off, std::uint64_t &changes) {
  Rng rng(seed);
  BoundCase drawn = random_criticalities(rng);
  for (Dag &dag : drawn.workload.dags) {
    if (dag.criticality == Criticality::High) continue;
    for (Task &task : dag.tasks) task.budget = task.wcet;
  }
  const auto task_set = analysis::compile(drawn.workload, drawn.platform);
  ASSERT_TRUE(task_set) << to_string(task_set.error());
  const auto outcome = analysis::amc_rtb().apply(*task_set);
  const auto *bound = std::get_if<analysis::Bound>(&outcome);
  if (bound == nullptr || bound->figures.find("criticality are met in every mode") == std::string::npos) return;
  ++judged;
  constexpr Duration kHorizon = 1500;
  for (int run = 0; run < 2; ++run) {
    offset_at_random(drawn.workload, *task_set, run == 0, rng);
    const double overruns = rng.uniform01();
    const std::uint64_t demands = rng();
    const auto demand = [&](const Task &task, TaskId id, std::uint32_t number) {
      if (task.budget > 0) return 10 * task.period;
      Rng dice = Rng::stream(demands, id.value, number);
      return dice.uniform01() < overruns ? dice.uniform(1, task.wcet) : task.wcet_low;
    };
    const std::vector<JobEvent> events = simulate(drawn, kHorizon, demands, demand);
    changes += count(events, JobEventKind::HighMode);
    cut_off += count(events, JobEventKind::Aborted);
    for (const metrics::JobRecord &job : metrics::fold_jobs(drawn.workload, events)) {
      if (!task_set->dags[task_set->tasks[job.task.value].dag.value].high) continue;
      const bool missed =
          job.outcome != metrics::JobOutcome::Aborted && metrics::miss_of(job, kHorizon) != metrics::Miss::None;
      ASSERT_FALSE(missed) << "seed " << seed << " run " << run << " task " << job.task.value << " job " << job.number
                           << "\n"
                           << describe(drawn);
    }
  }
}

TEST(Overload, WithinAmcRtbHighCriticalityMissesNothingBesideTenTimesTheCapacity) {
  const std::uint64_t wanted = how_many(2000);
  std::uint64_t judged = 0;
  std::uint64_t cut_off = 0;
  std::uint64_t changes = 0;
  for (std::uint64_t seed = 1; judged < wanted && !::testing::Test::HasFatalFailure(); ++seed) {
    check_overload(seed, judged, cut_off, changes);
  }
  EXPECT_GT(cut_off, 10 * wanted) << "the load was no overload";
  EXPECT_GT(changes, wanted) << "HI mode was hardly ever on";
}

// Jobs of high criticality that are shown schedulable alone miss nothing beside ten times the platform's capacity, if
// their DAGs come first. Under chain_aware, which orders by criticality, they do.
TEST(Overload, HighCriticalityMissesNothingBesideTenTimesTheCapacity) {
  std::uint64_t judged = 0;
  std::uint64_t lost = 0;
  for (std::uint64_t seed = 1; judged < 300 && seed < 3000; ++seed) {
    Rng rng(seed);
    BoundCaseLimits limits;
    limits.policies = {PolicyKind::ChainAware};
    limits.edges = rng.uniform01() < 0.5;
    limits.max_dags = 3;
    BoundCase high = random_bound_case(rng, limits);
    for (Dag &dag : high.workload.dags) dag.criticality = Criticality::High;
    const auto task_set = analysis::compile(high.workload, high.platform);
    ASSERT_TRUE(task_set) << to_string(task_set.error());
    if (analysis::analyze(*task_set).verdict != analysis::Verdict::Schedulable) continue;
    ++judged;

    RunSpec spec;
    spec.workload = high.workload;
    limits.min_utilization = limits.max_utilization = 10;
    limits.max_dags = 20;
    for (Dag &dag : random_bound_case(rng, limits).workload.dags) {
      dag.name += "_low";
      dag.criticality = Criticality::Low;
      for (Task &task : dag.tasks) task.wcet = 10 * std::max(task.wcet, task.period);
      spec.workload.dags.push_back(dag);
    }
    spec.preemption = sched::Preemption::Full;
    spec.horizon = 2000;
    spec.seed = seed;
    for (const metrics::JobRecord &job : metrics::fold_jobs(spec.workload, SimulatorDriver::run(spec).events)) {
      if (job.task.value >= high.workload.task_count()) {
        lost += job.outcome == metrics::JobOutcome::Skipped ? 1U : 0U;
        continue;
      }
      const bool missed =
          job.outcome != metrics::JobOutcome::Aborted && metrics::miss_of(job, spec.horizon) != metrics::Miss::None;
      ASSERT_FALSE(missed) << "seed " << seed << "\n" << describe(high);
    }
  }
  EXPECT_EQ(judged, 300U);
  EXPECT_GT(lost, 1000U) << "the load was no overload";
}

}  // namespace
}  // namespace redag::testing
