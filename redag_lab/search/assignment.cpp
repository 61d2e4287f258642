// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/assignment.hpp"

#include <algorithm>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_lab/search/coordinate_search.hpp"

namespace redag::lab {
namespace {

// Sets the policy. Drops priorities where the workload relied on them and the new policy would ignore them.
Workload with_policy(Workload workload, PolicyKind policy) {
  if (workload.policy == PolicyKind::Fixed) {
    for (Dag &dag : workload.dags) {
      for (Task &task : dag.tasks) task.priority.reset();
    }
  }
  workload.policy = policy;
  return workload;
}

class Search {
 public:
  Search(const Workload &workload, const analysis::AnalysisPlatform &platform, const AssignmentOptions &options)
      : workload_(workload), platform_(platform), options_(options) {
    const Caps present = caps_of(workload);
    for (const Dag &dag : workload.dags) {
      space_.values.push_back(options.caps ? cap_choices(dag, platform.workers) : Caps{dag.max_active});
    }
    space_.starts = cap_starts(present, space_.values);
  }

  Assignment run() {
    Assignment &result = result_;
    result.present = judged("present", workload_, caps_of(workload_));
    result.best = result.present;
    const bool may_order = options_.priorities && (is_static(workload_.policy) || !result.present.score.schedulable);
    add_order("present", workload_);
    if (may_order) {
      if (workload_.policy != PolicyKind::RateMonotonic) {
        add_order("rate_monotonic", with_policy(workload_, PolicyKind::RateMonotonic));
      }
      if (workload_.policy != PolicyKind::DeadlineMonotonic) {
        add_order("deadline_monotonic", with_policy(workload_, PolicyKind::DeadlineMonotonic));
      }
      const Result<analysis::TaskSet> task_set = analysis::compile(workload_, platform_);
      if (platform_.workers > 1) add_order("dkc", with_order(workload_, *task_set, dkc_order(*task_set)));
      add_audsley(*task_set);
    } else {
      result.audsley_reason = "--keep priorities leaves priorities as they are";
    }
    return std::move(result_);
  }

 private:
  bool stopped() {
    result_.stopped = result_.stopped || (options_.stop && options_.stop());
    return result_.stopped;
  }

  OrderCandidate judged(const std::string &name, const Workload &ordered, const Caps &caps) {
    OrderCandidate candidate;
    candidate.order = name;
    candidate.workload = with_caps(ordered, caps);
    candidate.caps = caps;
    const Result<analysis::TaskSet> task_set = analysis::compile(candidate.workload, platform_);
    ++result_.analyses;
    if (!task_set) return candidate;  // assign() has compiled the workload; only order and caps differ
    candidate.units = present_order(*task_set);
    candidate.score = score_of(*task_set);
    return candidate;
  }

  [[nodiscard]] bool is_better_than(const BoundScore &a, const BoundScore &b) const {
    return is_better(a, b, options_.objective);
  }

  void add_audsley(const analysis::TaskSet &task_set) {
    const TestChoice choice = order_free_test(workload_, platform_);
    if (!choice.test) {
      result_.audsley_reason = choice.reason;
      return;
    }
    result_.audsley_test = choice.test->name;
    result_.audsley_optimal = choice.test->optimal;
    const Objective objective = options_.objective;
    const Badness badness = [objective](Duration response, Duration due) {
      const auto late = static_cast<double>(response - due);
      return objective == Objective::Lateness ? late : late / static_cast<double>(due);
    };
    const auto found =
        audsley(workload_, platform_, *choice.test, all_orders(task_set), badness, [this] { return stopped(); });
    if (!found) return;
    result_.audsley_found = !found->failure;
    add_order("audsley", with_order(workload_, task_set, found->order));
  }

  // Finds the best caps under one order. A smaller sum of bounds alone is no reason to change the user's caps.
  void add_order(const std::string &name, const Workload &ordered) {
    if (stopped()) return;
    OrderCandidate start;
    OrderCandidate best;
    const auto evaluate = [&](std::span<const Point> points) {
      std::vector<BoundScore> scores;
      for (const Point &caps : points) {
        if (!start.caps.empty() && stopped()) break;
        OrderCandidate candidate = judged(name, ordered, caps);
        scores.push_back(candidate.score);
        if (start.caps.empty()) start = best = candidate;
        if (is_better_than(candidate.score, best.score)) best = std::move(candidate);
      }
      return scores;
    };
    CoordinateSearch<BoundScore> search(
        evaluate, [this](const BoundScore &a, const BoundScore &b) { return is_better_than(a, b); });
    const auto found = search.run(space_, {options_.exhaustive, options_.restarts, options_.seed});
    result_.exhaustive = result_.exhaustive && found.exhaustive;
    if (!improves(best.score, start.score, options_.objective)) best = start;
    const bool is_best = improves(best.score, result_.best.score, options_.objective);
    if (is_best || result_.orders.empty()) {
      result_.trials = found.trials;
    }
    if (is_best) result_.best = best;
    result_.orders.push_back(std::move(best));
  }

  const Workload &workload_;
  const analysis::AnalysisPlatform &platform_;
  const AssignmentOptions &options_;
  SearchSpace space_;  // of max_active, one dimension per DAG
  Assignment result_;
};

}  // namespace

Caps caps_of(const Workload &workload) {
  Caps caps;
  for (const Dag &dag : workload.dags) caps.push_back(dag.max_active);
  return caps;
}

Workload with_caps(Workload workload, const Caps &caps) {
  for (std::size_t d = 0; d < caps.size(); ++d) workload.dags[d].max_active = caps[d];
  return workload;
}

Caps cap_choices(const Dag &dag, std::uint32_t workers) {
  Caps values = {dag.max_active};
  const auto most = static_cast<std::uint32_t>(std::min<std::size_t>(dag.tasks.size(), workers + 1ULL));
  for (std::uint32_t cap = 0; dag.tasks.size() > 1 && cap < most; ++cap) {
    if (cap != dag.max_active) values.push_back(cap);
  }
  std::sort(values.begin(), values.end());
  return values;
}

std::vector<Caps> cap_starts(const Caps &present, const std::vector<Caps> &choices) {
  std::vector<Caps> starts = {present};
  for (const std::uint32_t cap : {0U, 1U}) {
    Caps caps;
    for (const Caps &values : choices) {
      const bool has = std::find(values.begin(), values.end(), cap) != values.end();
      caps.push_back(has ? cap : values.front());
    }
    starts.push_back(std::move(caps));
  }
  return starts;
}

Result<Assignment> assign(const Workload &workload, const analysis::AnalysisPlatform &platform,
                          const AssignmentOptions &options) {
  if (const Result<analysis::TaskSet> task_set = analysis::compile(workload, platform); !task_set) {
    return tl::unexpected<Diagnostics>(task_set.error());
  }
  return Search(workload, platform, options).run();
}

}  // namespace redag::lab
