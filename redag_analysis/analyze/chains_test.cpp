// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/chains.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include <fmt/format.h>

#include "redag/derived/waits.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "redag_analysis/many_workers/suspension_aware.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::analysis {
namespace {

// When the jobs of a simulation started and ended, by task; the position is the job's number.
struct Job {
  Time start = kNever;
  Time finish = kNever;
};
using Schedule = std::vector<std::vector<Job>>;

Schedule simulated(const Workload &workload, const AnalysisPlatform &platform, Duration horizon,
                   const sim::Options &chosen) {
  const sched::Config config = config_of(platform, workload);
  sched::PriorityScheduler scheduler(workload, config);
  sim::Options options = chosen;
  options.horizon = horizon;
  Schedule schedule(workload.task_count());
  sim::simulate(workload, scheduler, platform.workers, options, [&](std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      std::vector<Job> &jobs = schedule[event.task.value];
      if (jobs.size() <= event.job) jobs.resize(event.job + 1);
      if (event.kind == JobEventKind::Dispatched) jobs[event.job].start = event.time;
      if (event.kind == JobEventKind::Finished) jobs[event.job].finish = event.time;
    }
    return true;
  });
  return schedule;
}

// The longest time from right after a read of the first task, once all tasks have begun, to the end of the last task's
// first job that has seen the next input.
Duration observed_reaction(const Schedule &schedule, const std::vector<TaskId> &chain) {
  Time begin = 0;
  for (const TaskId task : chain) {
    if (!schedule[task.value].empty()) begin = std::max(begin, schedule[task.value].front().start);
  }
  Duration longest = 0;
  const std::vector<Job> &sources = schedule[chain.front().value];
  for (std::size_t k = 0; k + 1 < sources.size(); ++k) {
    if (sources[k].start < begin) continue;
    Time finish = sources[k + 1].finish;
    for (std::size_t i = 1; i < chain.size() && finish != kNever; ++i) {
      const std::vector<Job> &jobs = schedule[chain[i].value];
      const auto reader = std::find_if(jobs.begin(), jobs.end(), [&](const Job &job) { return job.start >= finish; });
      finish = reader == jobs.end() || reader->start == kNever ? kNever : reader->finish;
    }
    if (finish == kNever) break;
    longest = std::max(longest, finish - sources[k].start);
  }
  return longest;
}

// The longest time from a read of the first task to the end of the last task's job that replaces the resulting output.
Duration observed_age(const Schedule &schedule, const std::vector<TaskId> &chain) {
  Duration longest = 0;
  const std::vector<Job> &outputs = schedule[chain.back().value];
  for (std::size_t k = 0; k + 1 < outputs.size() && outputs[k + 1].finish != kNever; ++k) {
    Time start = outputs[k].start;
    for (std::size_t i = chain.size() - 1; i > 0 && start != kNever; --i) {
      const std::vector<Job> &jobs = schedule[chain[i - 1].value];
      Time read = kNever;
      for (const Job &job : jobs) {
        if (job.finish <= start) read = job.start;
      }
      start = read;
    }
    if (start != kNever) longest = std::max(longest, outputs[k + 1].finish - start);
  }
  return longest;
}

struct Tally {
  std::uint64_t chains = 0;
  std::uint64_t violations = 0;
  double ratios = 0;
  std::string first;
};

void check_chain(const testing::BoundCase &bound_case, const Method &method, Rng &rng, Tally &tally) {
  const TaskSet task_set = compile(bound_case.workload, bound_case.platform).value();
  if (!task_set.not_analysable.empty() && !task_set.has_waits) return;
  const Outcome outcome = method.apply(task_set);
  if (!std::holds_alternative<Bound>(outcome)) return;
  std::vector<TaskId> chain;
  const auto length = static_cast<std::size_t>(rng.uniform(1, 5));
  for (std::size_t i = 0; i < length; ++i) {
    // Follows an edge, or goes anywhere.
    const auto &next = chain.empty() ? task_set.tasks[0].predecessors : task_set.tasks[chain.back().value].successors;
    const bool follow = !next.empty() && rng.uniform(0, 2) > 0;
    const auto last = static_cast<std::int64_t>(follow ? next.size() : task_set.tasks.size()) - 1;
    const auto position = static_cast<std::size_t>(rng.uniform(0, last));
    chain.emplace_back(follow ? next[position] : position);
  }
  const auto bounded = chain_bound(task_set, chain, std::get<Bound>(outcome));
  const auto *bound = std::get_if<ChainBound>(&bounded);
  if (bound == nullptr) return;

  ++tally.chains;
  Workload workload = bound_case.workload;
  Duration longest = 0;
  for (Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) longest = std::max(longest, task.period);
  }
  Duration reaction = 0;
  Duration age = 0;
  for (int run = 0; run < 4; ++run) {
    std::uint32_t id = 0;
    std::vector<Duration> offsets;
    for (const Unit &unit : task_set.units) offsets.push_back(run == 0 ? 0 : rng.uniform(0, unit.period));
    for (std::uint32_t d = 0; d < workload.dags.size(); ++d) {
      // Edges between rates count on the offsets of one clock, so such DAGs are shifted as a whole.
      const std::vector<std::uint32_t> &units = task_set.dags[d].units;
      const bool joins_rates =
          std::any_of(units.begin(), units.end(), [&](std::uint32_t u) { return !task_set.units[u].awaits.empty(); });
      for (std::size_t t = 0; t < workload.dags[d].tasks.size(); ++t) {
        Task &task = workload.dags[d].tasks[t];
        const std::uint32_t unit = task_set.tasks[id++].unit;
        if (task.activation != Activation::Timer) continue;
        const bool keeps_offset = joins_rates && task.phase == Phase::Common;
        task.offset =
            keeps_offset ? bound_case.workload.dags[d].tasks[t].offset + offsets[units.front()] : offsets[unit];
      }
    }
    const std::uint64_t seed = rng();
    sim::Options options;
    options.demand = [seed, run](const Task &task, TaskId task_id, std::uint32_t number) {
      return run % 2 == 0 ? task.wcet
                          : Rng::stream(seed, task_id.value, number).uniform(shortest_demand(task), task.wcet);
    };
    options.overheads = {bound_case.platform.release_overhead, bound_case.platform.dispatch_overhead, 0};
    const Schedule schedule = simulated(workload, bound_case.platform, 15 * longest, options);
    reaction = std::max(reaction, observed_reaction(schedule, chain));
    age = std::max(age, observed_age(schedule, chain));
  }
  tally.ratios += static_cast<double>(reaction) / static_cast<double>(bound->reaction());
  if (reaction <= bound->reaction() && age <= bound->age()) return;
  if (tally.violations++ == 0) {
    tally.first =
        fmt::format("reaction {} bound {}, age {} bound {}, tasks", reaction, bound->reaction(), age, bound->age());
    for (const TaskId task : chain) tally.first += fmt::format(" {}", task.value);
    tally.first += "\n" + describe(bound_case);
  }
}

void expect_chains_hold(const Method &method, const testing::BoundGenerator &generator, std::uint64_t count) {
  count = testing::how_many(count);
  Tally tally;
  for (std::uint64_t seed = 0; tally.chains < count && seed < 20 * count; ++seed) {
    Rng rng(mix(seed));
    const testing::BoundCase bound_case = generator(rng);
    check_chain(bound_case, method, rng, tally);
  }
  fmt::print("[ figures  ] chains over {}: {} chains, {} violations; mean observed/bound {:.3f}\n", method.name,
             tally.chains, tally.violations, tally.ratios / static_cast<double>(tally.chains));
  EXPECT_EQ(tally.violations, 0U) << tally.first;
  EXPECT_GT(tally.chains, count / 2);
}

void expect_chains_hold(const Method &method, const testing::BoundCaseLimits &limits, std::uint64_t count) {
  expect_chains_hold(method, testing::cases(limits), count);
}

testing::BoundCaseLimits periodic(std::uint32_t workers, sched::Preemption preemption, bool edges) {
  testing::BoundCaseLimits limits;
  limits.max_workers = workers;
  limits.preemption = preemption;
  limits.edges = edges;
  limits.max_dags = 4;
  limits.min_utilization = 0.1;
  limits.max_utilization = 0.5;
  limits.jitter = limits.overheads = limits.caps = true;
  return limits;
}

TEST(ChainProperty, OverDagsPreemptive) {
  expect_chains_hold(dag_bounded(), periodic(4, sched::Preemption::Full, true), 1000);
}

TEST(ChainProperty, OverDagsNonpreemptive) {
  expect_chains_hold(dag_nonpreemptive(), periodic(4, sched::Preemption::None, true), 1000);
}

TEST(ChainProperty, OneWorkerWithThePriorityDiscount) {
  testing::BoundCaseLimits limits = periodic(1, sched::Preemption::Full, false);
  limits.overheads = false;
  limits.max_utilization = 0.9;
  expect_chains_hold(rta_preemptive(), limits, 1000);
  limits.preemption = sched::Preemption::None;
  expect_chains_hold(rta_nonpreemptive(), limits, 1000);
}

TEST(ChainProperty, OfTasksThatWait) {
  for (const std::uint32_t workers : {1U, 3U}) {
    testing::BoundCaseLimits limits = periodic(workers, sched::Preemption::Full, true);
    limits.overheads = limits.jitter = false;
    limits.max_period = 200;
    const auto generator = [&](Rng &rng) {
      testing::BoundCase drawn = random_bound_case(rng, limits);
      testing::add_waits(rng, drawn.workload);
      return drawn;
    };
    expect_chains_hold(suspension_aware(), generator, 1000);
  }
}

TEST(ChainProperty, OverEdgesBetweenRatesAndClocks) {
  for (const std::uint32_t workers : {1U, 3U}) {
    testing::BoundCaseLimits limits = periodic(workers, sched::Preemption::Full, true);
    limits.rates = limits.phases = true;
    limits.caps = false;
    expect_chains_hold(dag_bounded(), limits, 1000);
    limits.preemption = sched::Preemption::None;
    expect_chains_hold(dag_nonpreemptive(), limits, 1000);
  }
}

TEST(Chain, AnEdgeBetweenRatesIsAHop) {
  Workload workload = testing::independent({{1, 10}, {1, 20}}, 1, PolicyKind::RateMonotonic);
  Task joined = workload.dags[1].tasks[0];
  joined.name = "joined";
  joined.period = joined.deadline = 40;
  joined.predecessors = {0};
  workload.dags[1].tasks.push_back(joined);
  const TaskSet task_set = testing::compiled(workload);
  ASSERT_TRUE(task_set.has_rate_edges());
  const Report report = analyze(task_set);
  const auto of = [&](const std::vector<TaskId> &chain) {
    return std::get<ChainBound>(chain_bound(task_set, chain, tightest_of(report))).sum;
  };
  EXPECT_EQ(of({TaskId(0U)}), 10 + 1);
  EXPECT_EQ(of({TaskId(1U)}), 20 + 2);
  EXPECT_EQ(of({TaskId(1U), TaskId(2U)}), (20 + 2) + (40 + 2 + 3));  // its wait for data, then its response
}

// Of two timers of 10 that nothing synchronises, one's data wait for the other's: for 10 + 2 at most. Answers take 2.
TEST(Chain, AJoinWaitsForDataOfTheOtherClock) {
  Workload workload = testing::make_workload(
      {testing::make_dag("d",
                         {{.name = "x", .period = 10}, {.name = "y", .period = 10}, {.name = "j", .after = {0, 1}}})},
      2, PreemptionMode::Os);
  const auto reaction = [&workload] {
    const TaskSet task_set = testing::compiled(workload);
    const auto chain = chain_bound(task_set, std::vector{TaskId(0U), TaskId(2U)}, tightest_of(analyze(task_set)));
    const auto *bound = std::get_if<ChainBound>(&chain);
    return bound == nullptr ? 0 : bound->reaction();
  };
  EXPECT_EQ(reaction(), (10 + 2) * kMillisecond);
  workload.dags[0].tasks[0].phase = Phase::Unknown;
  EXPECT_EQ(reaction(), (10 + 2) * kMillisecond + (10 + 2) * kMillisecond - 1 + 2 * kMillisecond);
  workload.dags[0].tasks[1].phase = Phase::Event;
  EXPECT_EQ(reaction(), 0) << "the other data may never come";
}

// The producer ends 12 after its release. Meanwhile the consumer, less urgent and released with it, has read old data.
TEST(Chain, AProducerThatWaitsDoesNotGoFirst) {
  Workload workload = testing::independent({{4, 20}, {1, 20}}, 1, PolicyKind::Fixed);
  const auto reaction = [&workload] {
    const TaskSet task_set = testing::compiled(workload);
    const Report report = analyze(task_set);
    return std::get<ChainBound>(chain_bound(task_set, std::vector{TaskId(0U), TaskId(1U)}, tightest_of(report)))
        .reaction();
  };
  EXPECT_EQ(reaction(), 20 + 20 + 5);
  workload.dags[0].tasks[0].waits = {Wait{2, 8, 0, {}}};
  EXPECT_EQ(reaction(), 20 + 12 + 20 + 5);
}

Workload producer_and_consumer(std::uint32_t workers) {
  Workload workload = testing::independent({{9, 10}, {1, 10}}, workers, PolicyKind::Fixed);
  if (workers > 1) workload.dags[1].tasks[0].offset = 8;
  return workload;
}

// The discount for a more urgent producer gives 21. On two workers the consumer, 8 later, starts beside it: 29.
TEST(Chain, ThePriorityDiscountNeedsOneWorker) {
  const Workload workload = producer_and_consumer(2);
  const std::vector<TaskId> chain{TaskId(0U), TaskId(1U)};
  const AnalysisPlatform platform = platform_of(workload);
  const TaskSet task_set = testing::compiled(workload);
  const auto bound = std::get<ChainBound>(chain_bound(task_set, chain, std::get<Bound>(dag_bounded().apply(task_set))));
  EXPECT_EQ(bound.reaction(), 10 + 9 + 10 + 1);
  EXPECT_FALSE(bound.one_worker);
  EXPECT_EQ(observed_reaction(simulated(workload, platform, 200, {}), chain), 29);

  const Workload alone = producer_and_consumer(1);
  const TaskSet one = testing::compiled(alone);
  const auto discounted = std::get<ChainBound>(chain_bound(one, chain, std::get<Bound>(rta_preemptive().apply(one))));
  EXPECT_EQ(discounted.one_worker, 10 + 10 + 10);  // T_1, max(R_1, T_2), R_2
  EXPECT_EQ(discounted.sum, 39);
}

TEST(Chain, EdgesMakeOneSegment) {
  Workload workload = producer_and_consumer(2);
  Task consumer = workload.dags[1].tasks[0];
  consumer.activation = Activation::Data;
  consumer.predecessors = {0};
  consumer.offset = 0;
  consumer.name = "consumer";
  workload.dags[0].tasks.push_back(consumer);
  workload.dags.pop_back();
  const TaskSet task_set = testing::compiled(workload);
  const std::vector<TaskId> chain{TaskId(0U), TaskId(1U)};
  const auto bound = std::get<ChainBound>(chain_bound(task_set, chain, std::get<Bound>(dag_bounded().apply(task_set))));
  ASSERT_EQ(bound.segments.size(), 1U);
  EXPECT_EQ(bound.sum, 10 + 10);
}

TEST(Chain, WithoutABoundThereIsNone) {
  const Workload workload = producer_and_consumer(1);
  const TaskSet task_set = testing::compiled(workload);
  const std::vector<TaskId> chain{TaskId(0U)};
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(chain_bound(task_set, chain, Bound{})));
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(chain_bound(task_set, {}, Bound{})));
}

// Tries every instant as the arrival of an input.
Duration let_by_force(const std::vector<LetTask> &chain, Time from, Time until) {
  Duration longest = 0;
  for (Time input = from; input < until; ++input) {
    Time shown = 0;
    for (std::size_t i = 0; i < chain.size(); ++i) {
      Time release = chain[i].offset;
      // The first task reads what came strictly before; the others also read what was written at the same instant.
      while (i == 0 ? release <= input : release < shown) release += chain[i].period;
      shown = release + chain[i].deadline;
    }
    longest = std::max(longest, shown - input);
  }
  return longest;
}

TEST(Chain, NothingBoundsTheTimeUntilTheNextEvent) {
  Workload workload =
      testing::make_workload({testing::make_dag("a", {{"s", 10}}), testing::make_dag("b", {{"y", 10}})});
  workload.dags[1].tasks[0].phase = Phase::Event;
  const TaskSet task_set = testing::compiled(workload);
  const std::vector<TaskId> chain = {TaskId(0), TaskId(1)};
  const auto outcome = chain_bound(task_set, chain, tightest_of(analyze(task_set)));
  ASSERT_TRUE(std::holds_alternative<NotApplicable>(outcome));
  EXPECT_EQ(std::get<NotApplicable>(outcome).reason,
            "task 'b.y' is released by events, and nothing bounds the time until the next");
}

TEST(Chain, LetIsExact) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Rng rng(mix(seed));
    std::vector<LetTask> chain(static_cast<std::size_t>(rng.uniform(1, 4)));
    for (LetTask &task : chain) {
      task.period = rng.uniform(1, 8);
      task.offset = rng.uniform(0, task.period);
      task.deadline = rng.uniform(1, task.period);
    }
    // Periods up to 8 have a hyperperiod of at most 840.
    EXPECT_EQ(let_reaction(chain), let_by_force(chain, 10, 10 + 2 * 840)) << seed;
  }
  EXPECT_FALSE(let_reaction({}));
  const std::vector<LetTask> incommensurate{{1'000'003, 0, 1}, {1'000'033, 0, 1}};
  EXPECT_FALSE(let_reaction(incommensurate, 1000));
}

}  // namespace
}  // namespace redag::analysis
