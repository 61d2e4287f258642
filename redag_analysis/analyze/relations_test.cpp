// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Relations between bounds that theory predicts, on random workloads.
#include <gtest/gtest.h>

#include <numeric>
#include <set>
#include <string_view>

#include <fmt/format.h>

#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCase;
using testing::BoundCaseLimits;
using testing::cases;
using testing::for_cases;

constexpr std::uint32_t kCases = 1000;

const Bound *bound_of(const Outcome &outcome) { return std::get_if<Bound>(&outcome); }

BoundCaseLimits blocked() {
  BoundCaseLimits limits;
  limits.groups = limits.levels = limits.overheads = true;
  return limits;
}

std::vector<BoundCaseLimits> all_kinds() {
  std::vector<BoundCaseLimits> kinds;
  for (const auto mode : {sched::Preemption::Full, sched::Preemption::None, sched::Preemption::Cooperative}) {
    for (const bool edges : {false, true}) {
      BoundCaseLimits limits = blocked();
      limits.preemption = mode;
      limits.edges = edges;
      limits.groups = mode != sched::Preemption::Cooperative;
      limits.jitter = limits.queues = true;
      limits.max_dags = 4;
      kinds.push_back(limits);
    }
  }
  return kinds;
}

void expect_not_smaller(const std::vector<ResponseBound> &before, const std::vector<ResponseBound> &after) {
  ASSERT_EQ(before.size(), after.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_GE(after[i].response.value_or(kNever), before[i].response.value_or(kNever)) << i;
  }
}

TEST(Relations, MoreExecutionNeverShrinksABound) {
  std::size_t compared = 0;
  for (const BoundCaseLimits &limits : all_kinds()) {
    for_cases(cases(limits), kCases / 5, [&](const BoundCase &bound_case, const TaskSet &task_set, Rng &rng) {
      BoundCase longer = bound_case;
      Dag &dag = longer.workload.dags[static_cast<std::size_t>(
          rng.uniform(0, static_cast<std::int64_t>(longer.workload.dags.size()) - 1))];
      Task &task = dag.tasks[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(dag.tasks.size()) - 1))];
      task.wcet += 1;
      if (task.region > 0 && limits.preemption == sched::Preemption::Cooperative) return;  // a last region can shrink
      const auto after = compile(longer.workload, longer.platform);
      if (!after) return;
      for (const Method &method : {rta_preemptive(), rta_nonpreemptive(), rta_deferred()}) {
        const Outcome first = method.apply(task_set);
        const Outcome second = method.apply(*after);
        if (bound_of(first) == nullptr || bound_of(second) == nullptr) continue;
        SCOPED_TRACE(std::string(method.name));
        expect_not_smaller(bound_of(first)->tasks, bound_of(second)->tasks);
        expect_not_smaller(bound_of(first)->dags, bound_of(second)->dags);
        ++compared;
      }
    });
  }
  EXPECT_GT(compared, 500U);
}

TEST(Relations, TermsAddUpToTheResponse) {
  std::size_t checked = 0;
  for (const BoundCaseLimits &limits : all_kinds()) {
    for_cases(cases(limits), kCases / 5, [&](const BoundCase &, const TaskSet &task_set, Rng &) {
      AnalyzeOptions options;
      options.itemise = true;
      const Report report = analyze(task_set, options);
      for (const MethodReport &method : report.methods) {
        if (method.bound() == nullptr) continue;
        for (const ResponseBound &bound : method.bound()->tasks) {
          if (!bound.response) {
            EXPECT_FALSE(bound.absent.empty()) << method.method->name;
            continue;
          }
          const Duration sum = std::accumulate(bound.terms.begin(), bound.terms.end(), Duration{0},
                                               [](Duration total, const Term &term) { return total + term.amount; });
          EXPECT_EQ(sum, *bound.response) << method.method->name;
          ++checked;
        }
      }
    });
  }
  EXPECT_GT(checked, 1000U);
}

// The critical instant of Liu and Layland: all tasks are released at once, and each executes for its wcet. In a fixed
// order the bound is attained. Equals that take turns each have another critical instant.
TEST(Relations, ResponseTimeIsReachedAtTheCriticalInstant) {
  std::size_t compared = 0;
  for_cases(cases(BoundCaseLimits{}), kCases, [&](const BoundCase &any, const TaskSet &, Rng &) {
    BoundCase bound_case = any;
    bound_case.workload.ties = Ties::Fixed;
    const TaskSet task_set = compile(bound_case.workload, bound_case.platform).value();
    const Outcome outcome = rta_preemptive().apply(task_set);
    ASSERT_NE(bound_of(outcome), nullptr);
    const sched::Config config = config_of(bound_case.platform, bound_case.workload);
    sched::PriorityScheduler scheduler(bound_case.workload, config);
    sim::Options options;
    options.horizon = 200;
    std::vector<Duration> first(task_set.tasks.size(), 0);
    (void)sim::simulate(bound_case.workload, scheduler, 1, options, [&](std::span<const JobEvent> events) {
      for (const JobEvent &event : events) {
        if (event.kind == JobEventKind::Finished && event.job == 0) first[event.task.value] = event.value;
      }
      return true;
    });
    for (const std::uint32_t t : task_set.by_rank) {
      const auto &response = bound_of(outcome)->tasks[t].response;
      if (!response) break;  // its jobs are skipped, and the tasks below see fewer of them than the bound counts
      EXPECT_EQ(first[t], *response) << task_set.tasks[t].name;
      ++compared;
    }
  });
  EXPECT_GT(compared, 1000U);
}

TEST(Report, TrustsNoUnsoundEquationAndNamesWhoSpoke) {
  std::size_t by_response = 0;
  BoundCaseLimits limits;
  limits.policies = {PolicyKind::RateMonotonic};
  for_cases(cases(limits), kCases, [&](const BoundCase &, const TaskSet &task_set, Rng &) {
    const Report report = analyze(task_set);
    ASSERT_EQ(report.methods.size(), methods().size());
    for (const MethodReport &method : report.methods) {
      if (method.bound() == nullptr) {
        EXPECT_FALSE(std::get<NotApplicable>(method.outcome).reason.empty());
      } else {
        EXPECT_EQ(method.trusted, method.bound()->unsound.empty());
      }
    }
    // On one worker, preemptive, independent: no bound is below the exact analysis.
    const Outcome outcome = rta_preemptive().apply(task_set);
    for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
      const std::optional<Duration> exact = bound_of(outcome)->tasks[t].response;
      if (exact || !report.tasks[t].bound.of_ended) {
        EXPECT_EQ(report.tasks[t].response, exact);
      }
      by_response += report.tasks[t].method != nullptr ? 1U : 0U;
    }
    EXPECT_EQ(report.verdict == Verdict::Schedulable, !report.by.empty());
    EXPECT_EQ(report.verdict, verdict(task_set, *bound_of(outcome)));
  });
  EXPECT_GT(by_response, 1000U);
}

// A report, and a copy of it, stay valid after the caller's methods are gone.
TEST(Report, KeepsTheMethodsItWasGiven) {
  std::size_t named = 0;
  for_cases(cases(BoundCaseLimits{}), kCases, [&](const BoundCase &, const TaskSet &task_set, Rng &) {
    std::optional<Report> report = analyze(task_set, {rta_nonpreemptive(), rta_preemptive()});
    const Report copy = *report;
    report.reset();
    ASSERT_EQ(copy.methods.size(), 2U);
    EXPECT_EQ(copy.methods[1].method->name, "rta_preemptive");
    for (const Tightest &best : copy.tasks) {
      if (best.method == nullptr) continue;
      EXPECT_TRUE(best.method == copy.methods[0].method || best.method == copy.methods[1].method);
      ++named;
    }
  });
  EXPECT_GT(named, 1000U);
}

TEST(Registry, NamesAreUniqueAndEveryMethodIsDescribed) {
  std::set<std::string_view> names;
  for (const Method &method : methods()) {
    EXPECT_TRUE(names.insert(method.name).second) << method.name;
    EXPECT_FALSE(method.cite.empty() || method.assumptions.empty() || method.complexity.empty()) << method.name;
    EXPECT_EQ(method.is_paper(), method.name.starts_with("paper_")) << method.name;
  }
}

}  // namespace
}  // namespace redag::analysis
