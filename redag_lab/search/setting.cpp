// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/setting.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include "redag_lab/search/assignment.hpp"

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

SettingSpace::SettingSpace(const Workload &workload, const Freedom &freedom) : workload_(workload) {
  const std::uint32_t workers = workload.platform.workers;
  const std::uint32_t most_workers = std::max(workers, freedom.most_workers);
  space_.values.push_back(freedom.workers ? range(1, most_workers) : range(workers, workers));

  const Caps present = caps_of(workload);
  std::vector<Caps> choices;
  for (const Dag &dag : workload.dags) {
    if (!freedom.caps) {
      choices.push_back({dag.max_active});
    } else if (freedom.cap_range) {
      choices.push_back(with(range(freedom.cap_range->first, freedom.cap_range->second), dag.max_active));
    } else {
      choices.push_back(cap_choices(dag, freedom.workers ? most_workers : workers));
    }
  }
  space_.values.insert(space_.values.end(), choices.begin(), choices.end());

  if (freedom.ties) tied_ = tied_dags(workload);
  for (std::uint32_t i = 1; i < tied_.size(); ++i) space_.values.push_back(range(0, i));

  for (const Caps &caps : cap_starts(present, choices)) {
    Point point = {workers};
    point.insert(point.end(), caps.begin(), caps.end());
    point.resize(space_.values.size(), 0);
    space_.starts.push_back(std::move(point));
  }
}

Point SettingSpace::caps(const Point &point) const {
  const auto first = point.begin() + 1;
  return {first, first + static_cast<std::ptrdiff_t>(workload_.dags.size())};
}

std::vector<std::uint32_t> SettingSpace::tie_order(const Point &point) const {
  std::vector<std::uint32_t> order;
  const std::size_t first = 1 + workload_.dags.size();
  for (std::size_t i = 0; i < tied_.size(); ++i) {
    const std::uint32_t before = i == 0 ? 0 : point[first + i - 1];
    order.insert(order.end() - static_cast<std::ptrdiff_t>(before), tied_[i]);
  }
  return order;
}

Workload SettingSpace::apply(const Point &point) const {
  Workload workload = with_caps(workload_, caps(point));
  workload.platform.workers = workers(point);
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
