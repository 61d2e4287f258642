// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/peers/wait_set.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "redag_analysis/analyze/executors.hpp"
#include "redag_analysis/peers/wait_set_rates.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

testing::BoundGenerator callbacks(std::uint32_t workers, double utilization, bool edges) {
  testing::BoundCaseLimits limits;
  limits.preemption = sched::Preemption::None;
  limits.policies = {PolicyKind::RateMonotonic};
  limits.max_workers = workers;
  limits.edges = edges;
  limits.max_dags = 4;
  limits.jitter = limits.caps = limits.overheads = true;
  limits.min_utilization = 0.02;
  limits.max_utilization = utilization;
  limits.min_period = 20;
  limits.max_period = 300;
  return testing::cases(limits);
}

// Tests the bound under the model of the executor with this number of threads.
void expect_holds(const Method &method, std::uint32_t workers, double utilization) {
  for (const bool edges : {true, false}) {
    const testing::BoundPropertyOptions options{.workloads = 700, .executor = workers == 1 ? "ste" : "mte"};
    testing::expect_bound_holds(method, callbacks(workers, utilization, edges), options);
  }
}

TEST(BoundProperty, WaitSet) {
  expect_holds(wait_set(), 1, 0.3);
  expect_holds(wait_set(), 4, 0.3);
}
TEST(BoundProperty, WaitSetRates) {
  expect_holds(wait_set_rates(), 1, 0.5);
  expect_holds(wait_set_rates(), 4, 0.4);
}
TEST(BoundProperty, WaitSetCasini) { expect_holds(casini(), 1, 0.6); }

Workload three_timers(std::uint32_t workers) {
  Workload workload = testing::independent({{3, 100}, {5, 100}, {7, 100}}, workers);
  workload.platform.preemption = PreemptionMode::None;
  return workload;
}

TEST(WaitSetBound, EveryOtherCallbackOnceAndThoseBeforeTwice) {
  for (const std::uint32_t workers : {1U, 2U}) {
    const TaskSet task_set = testing::compiled(three_timers(workers));
    const Outcome outcome = wait_set().apply(task_set);
    const auto &bound = std::get<Bound>(outcome);
    EXPECT_EQ(bound.tasks[0].response, 3 + (5 + 7) / workers);
    EXPECT_EQ(bound.tasks[1].response, 5 + (3 + 7 + 3) / workers);
    EXPECT_EQ(bound.tasks[2].response, 7 + (3 + 5 + 3 + 5) / workers);
  }
}

// With rates, the long callback arrives once while the short one waits, and not again before it.
TEST(WaitSetBound, ACallbackThatSeldomComesCountsOnce) {
  Workload workload = three_timers(1);
  const TaskSet task_set = testing::compiled(workload);
  // Registered 3, 5, 7. By windows: 3 + 5 + 7, 5 + 2 * 3 + 7, 7 + 2 * (3 + 5); within 100 each arrives only once.
  for (const Method &method : {casini(), wait_set_rates()}) {
    const Outcome outcome = method.apply(task_set);
    for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) EXPECT_EQ(bound.response, 15) << method.name;
  }
  // With a period of 15 the first arrives twice in a busy window, and windows let it delay the last one twice at most.
  workload.dags[0].tasks[0].period = workload.dags[0].tasks[0].deadline = 15;
  const TaskSet faster = testing::compiled(workload);
  const auto last = [&](const Method &method) {
    const Outcome outcome = method.apply(faster);
    return std::get<Bound>(outcome).tasks[2].response;
  };
  EXPECT_EQ(last(casini()), 7 + 5 + 3);
  EXPECT_EQ(last(wait_set()), 7 + 2 * (3 + 5));
  EXPECT_EQ(last(wait_set_rates()), 7 + 5 + 2 * 3);
}

// Cases with edges and without.
testing::BoundGenerator mixed(std::uint32_t workers) {
  return [workers](Rng &rng) { return callbacks(workers, 0.5, rng.uniform(0, 1) == 0)(rng); };
}

// Where `loose` bounds a DAG, `tight` does too, and not above it.
void expect_never_above(const Method &tight, const Method &loose, std::uint32_t workers) {
  std::uint64_t smaller = 0;
  for_cases(mixed(workers), 2000, [&](const testing::BoundCase &, const TaskSet &task_set, Rng &) {
    const Outcome better = tight.apply(task_set);
    const Outcome worse = loose.apply(task_set);
    if (!std::holds_alternative<Bound>(worse)) return;
    const std::vector<ResponseBound> &dags = std::get<Bound>(worse).dags;
    const auto is_bounded = [](const ResponseBound &bound) { return bound.response.has_value(); };
    if (!std::all_of(dags.begin(), dags.end(), is_bounded)) return;  // rates need bounds of all
    for (std::size_t d = 0; d < dags.size(); ++d) {
      const auto response = std::get<Bound>(better).dags[d].response;
      ASSERT_TRUE(response) << tight.name;
      ASSERT_LE(*response, *dags[d].response) << tight.name << " above " << loose.name;
      smaller += *response < *dags[d].response ? 1U : 0U;
    }
  });
  EXPECT_GT(smaller, 100U) << tight.name << " never below " << loose.name;
}

// With jitter 6 and a response of 14 the other task's first job can end as late as 20 after its nominal release. The
// next job, released 20 after that release, follows on it directly.
TEST(WaitSetBound, WorkComesCloserWithJitter) {
  const auto second = [](Duration jitter) {
    Workload workload = three_timers(1);
    workload.dags.pop_back();
    Task &often = workload.dags[0].tasks[0];
    often.wcet = often.bcet = 4;
    often.period = often.deadline = 20;
    often.jitter = jitter;
    Task &seldom = workload.dags[1].tasks[0];
    seldom.wcet = seldom.bcet = 10;
    const Outcome outcome = wait_set_rates().apply(testing::compiled(workload));
    return std::get<Bound>(outcome).tasks[1].response;
  };
  EXPECT_EQ(second(0), 10 + 4);
  EXPECT_EQ(second(6), 10 + 2 * 4);
}

TEST(WaitSetBound, RatesAreNeverAboveWindows) {
  expect_never_above(wait_set_rates(), wait_set(), 4);
  expect_never_above(wait_set_rates(), wait_set(), 1);
}

TEST(WaitSetBound, MoreExecutionNeverShrinksABoundAndTermsAddUp) {
  std::uint64_t compared = 0;
  for (const std::uint32_t workers : {1U, 4U}) {
    for_cases(mixed(workers), 2000, [&](const testing::BoundCase &bound_case, const TaskSet &task_set, Rng &rng) {
      Workload more = bound_case.workload;
      Dag &dag = more.dags[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(more.dags.size()) - 1))];
      ++dag.tasks[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(dag.tasks.size()) - 1))].wcet;
      const auto larger = compile(more, bound_case.platform);
      for (const Method &method : executor_methods()) {
        const Outcome before = method.apply(task_set);
        if (!std::holds_alternative<Bound>(before)) continue;
        for (const ResponseBound &bound : std::get<Bound>(before).dags) {
          Duration sum = 0;
          for (const Term &term : bound.terms) sum += term.amount;
          ASSERT_EQ(sum, bound.response.value_or(0)) << method.name;
          ASSERT_EQ(bound.absent.empty(), bound.response.has_value());
        }
        if (!larger) continue;
        const Outcome after = method.apply(*larger);
        for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
          const Duration grown = std::get<Bound>(after).dags[d].response.value_or(kNever);
          ASSERT_LE(std::get<Bound>(before).dags[d].response.value_or(kNever), grown) << method.name;
          ++compared;
        }
      }
    });
  }
  EXPECT_GT(compared, 1000U);
}

// The published form for callbacks without predecessors: a busy window, and every arrival of i's own in it.
std::optional<Duration> published_casini(const TaskSet &task_set, std::size_t i) {
  const auto arrivals = [&](std::size_t j, Duration length) {
    const CompiledTask &task = task_set.tasks[j];
    return (length + task.jitter + task.period - 1) / task.period;
  };
  const auto work = [&](Duration length, std::size_t skip) {
    Duration sum = 0;
    for (std::size_t j = 0; j < task_set.tasks.size(); ++j) {
      if (j != skip) sum += arrivals(j, length) * task_set.tasks[j].wcet;
    }
    return sum;
  };
  const CompiledTask &own = task_set.tasks[i];
  Duration window = 1;
  for (Duration next = 0; (next = work(window, task_set.tasks.size())) > window; window = next) {
    if (next > 1'000'000) return std::nullopt;
  }
  Duration worst = 0;
  for (Duration n = 1;; ++n) {
    const Duration arrival = std::max<Duration>(0, (n - 1) * own.period - own.jitter);
    if (arrival >= window) return worst;
    Duration start = (n - 1) * own.wcet;
    for (Duration next = 0; (next = (n - 1) * own.wcet + work(start + 1, i)) > start; start = next) {
      if (next > 1'000'000) return std::nullopt;
    }
    worst = std::max(worst, start - arrival + own.wcet);
  }
}

TEST(WaitSetBound, CasiniIsThePublishedForm) {
  std::uint64_t bounded = 0;
  std::uint64_t unbounded = 0;
  for (std::uint64_t seed = 0; seed < 5000; ++seed) {
    Rng rng(mix(seed));
    const testing::BoundCase bound_case = callbacks(1, 0.9, false)(rng);
    const TaskSet task_set = compile(bound_case.workload, bound_case.platform).value();
    const Outcome outcome = casini().apply(task_set);
    if (!task_set.not_analysable.empty() || !std::holds_alternative<Bound>(outcome)) continue;
    bool all = true;
    for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
      const CompiledTask &task = task_set.tasks[t];
      const auto published = published_casini(task_set, t);
      const auto ours = std::get<Bound>(outcome).tasks[t].response;
      all = all && published && *published + task.jitter <= task.period;
      if (ours) {
        ASSERT_EQ(*ours, published.value_or(kNever) + task.jitter) << describe(bound_case);
      }
    }
    for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) {
      ASSERT_EQ(bound.response.has_value(), all) << describe(bound_case);
    }
    ++(all ? bounded : unbounded);
  }
  EXPECT_GT(bounded, 500U);
  EXPECT_GT(unbounded, 500U);
}

TEST(WaitSetBound, OverloadIsNotBounded) {
  const auto with_period = [](Duration period) {
    Workload workload = three_timers(1);
    for (Dag &dag : workload.dags) dag.tasks[0].period = dag.tasks[0].deadline = period;
    return std::get<Bound>(casini().apply(testing::compiled(workload))).tasks[0].response;
  };
  EXPECT_EQ(with_period(15), 15);
  EXPECT_FALSE(with_period(14));
}

TEST(WaitSetBound, TimesNearTheLargestDoNotWrap) {
  for (const std::uint32_t workers : {1U, 4U}) {
    Workload workload = three_timers(workers);
    for (Dag &dag : workload.dags) {
      Task &task = dag.tasks[0];
      task.wcet = task.bcet = kMaxDuration / 8;
      task.period = task.deadline = kMaxDuration / 2;
    }
    const TaskSet task_set = testing::compiled(workload);
    for (const Method &method : executor_methods()) {
      const Outcome outcome = method.apply(task_set);
      if (!std::holds_alternative<Bound>(outcome)) continue;
      for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) {
        const Duration least = kMaxDuration / 8 + kMaxDuration / 4 / workers - 1;
        EXPECT_GE(bound.response.value_or(least), least) << method.name;
      }
    }
  }
}

}  // namespace
}  // namespace redag::analysis
