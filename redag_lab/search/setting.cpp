// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/setting.hpp"

#include <algorithm>
#include <numeric>
#include <set>

#include "redag/sched/policy.hpp"

namespace redag::lab {
namespace {

// Returns the values of max_active worth trying: the present one, none, and 1 to min(tasks - 1, workers). A DAG with
// one task has only its present value.
std::vector<std::uint32_t> usual_caps(const Dag &dag, std::uint32_t workers) {
  std::set<std::uint32_t> values = {dag.max_active};
  const auto most = static_cast<std::uint32_t>(std::min<std::size_t>(dag.tasks.size(), workers + 1ULL));
  for (std::uint32_t cap = 0; dag.tasks.size() > 1 && cap < most; ++cap) values.insert(cap);
  return {values.begin(), values.end()};
}

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

std::vector<std::uint32_t> range(std::uint32_t low, std::uint32_t high) {
  std::vector<std::uint32_t> values(high - low + 1);
  std::iota(values.begin(), values.end(), low);
  return values;
}

std::vector<std::uint32_t> with(std::vector<std::uint32_t> values, std::uint32_t value) {
  values.push_back(value);
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

}  // namespace

std::vector<NamedOrder> orders_to_try(const Workload &workload, const analysis::AnalysisPlatform &platform) {
  std::vector<NamedOrder> orders = {{"present", workload}};
  const Result<analysis::TaskSet> task_set = analysis::compile(workload, platform);
  if (!task_set) return orders;
  if (!is_static(workload.policy) && score_of_bounds(*task_set).proven) return orders;
  if (workload.policy != PolicyKind::RateMonotonic) {
    orders.push_back({"rate_monotonic", with_policy(workload, PolicyKind::RateMonotonic)});
  }
  if (workload.policy != PolicyKind::DeadlineMonotonic) {
    orders.push_back({"deadline_monotonic", with_policy(workload, PolicyKind::DeadlineMonotonic)});
  }
  return orders;
}

SettingSpace::SettingSpace(const Workload &workload, const Freedom &freedom, std::vector<NamedOrder> orders)
    : orders_(std::move(orders)) {
  const std::uint32_t workers = workload.platform.workers;
  const std::uint32_t most_workers = std::max(workers, freedom.most_workers);
  space_.values.push_back(freedom.workers ? range(1, most_workers) : range(workers, workers));
  space_.values.push_back(range(0, static_cast<std::uint32_t>(orders_.size() - 1)));

  for (const Dag &dag : workload.dags) {
    if (!freedom.caps) {
      space_.values.push_back({dag.max_active});
    } else if (freedom.cap_range) {
      space_.values.push_back(with(range(freedom.cap_range->first, freedom.cap_range->second), dag.max_active));
    } else {
      space_.values.push_back(usual_caps(dag, freedom.workers ? most_workers : workers));
    }
  }

  // Each order with the present max_active, with none and with 1, as far as these are among the values.
  for (std::uint32_t order = 0; order < orders_.size(); ++order) {
    for (const std::optional<std::uint32_t> cap :
         {std::optional<std::uint32_t>(), std::optional(0U), std::optional(1U)}) {
      Point point = {workers, order};
      for (std::size_t d = 0; d < workload.dags.size(); ++d) {
        const std::vector<std::uint32_t> &values = space_.values[kCaps + d];
        const bool has = cap && std::find(values.begin(), values.end(), *cap) != values.end();
        point.push_back(has ? *cap : (cap ? values.front() : workload.dags[d].max_active));
      }
      space_.starts.push_back(std::move(point));
    }
  }
}

Workload SettingSpace::apply(const Point &point) const {
  Workload workload = orders_[point[kOrder]].workload;
  for (std::size_t d = 0; d < workload.dags.size(); ++d) workload.dags[d].max_active = point[kCaps + d];
  workload.platform.workers = point.front();
  return workload;
}

std::size_t SettingSpace::changes(const Point &point) const {
  const Point &present = space_.starts.front();
  std::size_t count = 0;
  for (std::size_t d = 0; d < point.size(); ++d) {
    if (point[d] != present[d]) ++count;
  }
  return count;
}

}  // namespace redag::lab
