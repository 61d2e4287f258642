// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/setting.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include "redag/sched/policy.hpp"
#include "redag_lab/search/audsley.hpp"

namespace redag::lab {
namespace {

// Returns the value by which the policy orders tasks, larger for more urgent; nothing if it uses several values.
std::optional<std::int64_t> urgency(const Task &task, PolicyKind policy) {
  switch (policy) {
    case PolicyKind::RateMonotonic: return -task.period;
    case PolicyKind::DeadlineMonotonic: return -task.deadline;
    case PolicyKind::Fixed: return task.priority.value_or(0);
    case PolicyKind::ChainAware:
    case PolicyKind::Edf:
    case PolicyKind::Fifo: break;
  }
  return std::nullopt;
}

// Returns the DAGs with a task whose urgency equals that of a task of another DAG.
std::vector<std::uint32_t> tied_dags(const Workload &workload) {
  std::map<std::int64_t, std::set<std::uint32_t>> dags;
  for (std::uint32_t d = 0; d < workload.dags.size(); ++d) {
    for (const Task &task : workload.dags[d].tasks) {
      const std::optional<std::int64_t> value = urgency(task, workload.policy);
      if (!value) return {};
      dags[*value].insert(d);
    }
  }
  std::set<std::uint32_t> tied;
  for (const auto &[value, sharing] : dags) {
    if (sharing.size() > 1) tied.insert(sharing.begin(), sharing.end());
  }
  return {tied.begin(), tied.end()};
}

// Assigns one priority to a DAG's equally urgent tasks, which remain equal.
void set_priorities(Workload &workload, const std::vector<std::uint32_t> &order) {
  std::vector<std::uint32_t> place(workload.dags.size());
  std::iota(place.begin(), place.end(), 0);
  std::vector<std::uint32_t> positions = order;
  std::sort(positions.begin(), positions.end());
  for (std::size_t i = 0; i < order.size(); ++i) place[order[i]] = positions[i];

  using Key = std::tuple<std::int64_t, std::uint32_t>;  // most urgent first
  std::set<Key> keys;
  const auto key_of = [&](std::uint32_t d, const Task &task) {
    return Key{-*urgency(task, workload.policy), place[d]};
  };
  for (std::uint32_t d = 0; d < workload.dags.size(); ++d) {
    for (const Task &task : workload.dags[d].tasks) keys.insert(key_of(d, task));
  }
  std::map<Key, int> priorities;
  int priority = static_cast<int>(keys.size());
  for (const Key &key : keys) priorities[key] = priority--;
  for (std::uint32_t d = 0; d < workload.dags.size(); ++d) {
    for (Task &task : workload.dags[d].tasks) {
      task.priority = priorities.at(key_of(d, task));  // key_of() reads this task's old priority
    }
  }
}

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

std::vector<NamedOrder> orders_to_try(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                      Objective objective, const std::function<bool()> &stop) {
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
  if (platform.workers > 1) orders.push_back({"dkc", with_order(workload, *task_set, dkc_order(*task_set))});
  const TestChoice choice = order_free_test(workload, platform);
  if (!choice.test) return orders;
  const Badness badness = [objective](Duration response, Duration due) {
    const auto late = static_cast<double>(response - due);
    return objective == Objective::Slack ? late / static_cast<double>(due) : late;
  };
  const auto found = audsley(workload, platform, *choice.test, all_orders(*task_set), badness, stop);
  if (found) orders.push_back({"audsley", with_order(workload, *task_set, found->order)});
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
  if (freedom.ties && orders_.size() == 1) tied_ = tied_dags(workload);
  for (std::uint32_t i = 1; i < tied_.size(); ++i) space_.values.push_back(range(0, i));

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
      point.resize(space_.values.size(), 0);
      space_.starts.push_back(std::move(point));
    }
  }
}

std::vector<std::uint32_t> SettingSpace::tie_order(const Point &point) const {
  std::vector<std::uint32_t> order;
  const std::size_t first = kCaps + orders_.front().workload.dags.size();
  for (std::size_t i = 0; i < tied_.size(); ++i) {
    const std::uint32_t before = i == 0 ? 0 : point[first + i - 1];
    order.insert(order.end() - static_cast<std::ptrdiff_t>(before), tied_[i]);
  }
  return order;
}

Workload SettingSpace::apply(const Point &point) const {
  Workload workload = orders_[point[kOrder]].workload;
  for (std::size_t d = 0; d < workload.dags.size(); ++d) workload.dags[d].max_active = point[kCaps + d];
  workload.platform.workers = point.front();
  const std::vector<std::uint32_t> order = tie_order(point);
  if (order != tied_) {
    set_priorities(workload, order);
    workload.policy = PolicyKind::Fixed;
  }
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
