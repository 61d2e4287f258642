// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/workload/changes.hpp"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "redag/loader/cpu_list.hpp"

namespace redag::lab {
namespace {

using Kind = Change::Kind;

std::string time_text(Duration value) { return value == 0 ? "none" : format_duration(value); }

std::string execution_text(const ExecutionTime &time) {
  switch (time.kind) {
    case ExecutionTime::Kind::Constant: return "constant";
    case ExecutionTime::Kind::Uniform: return "uniform";
    case ExecutionTime::Kind::Normal:
      return fmt::format("normal({}, {})", format_duration(time.mean), format_duration(time.stddev));
    case ExecutionTime::Kind::Empirical: return fmt::format("{} samples", time.samples.size());
  }
  return "?";
}

std::string degrade_text(const Degrade &degrade) {
  switch (degrade.kind) {
    case Degrade::Kind::Stop: return "stop";
    case Degrade::Kind::Skip: return fmt::format("skip {}", degrade.skip);
    case Degrade::Kind::Stretch: return fmt::format("stretch {}", degrade.stretch);
  }
  return "?";
}

std::string clusters_text(const Platform &platform) {
  std::vector<std::string> texts;
  for (const Cluster &cluster : platform.clusters) {
    texts.push_back(fmt::format("{} ({}{}{})", cluster.name, cluster.workers, cluster.cpus.empty() ? "" : " on ",
                                format_cpu_list(cluster.cpus)));
  }
  return texts.empty() ? "none" : fmt::format("{}", fmt::join(texts, ", "));
}

std::string cpus_text(const Platform &platform) {
  return platform.cpus.empty() ? "any" : format_cpu_list(platform.cpus);
}

std::string overrun_text(const Task &task) {
  return task.overrun == Overrun::Skip ? "skip" : fmt::format("queue of {}", task.queue_depth);
}

std::string predecessors_text(const Dag &dag, const Task &task) {
  std::vector<std::string> names;
  for (const std::uint32_t p : task.predecessors) names.push_back(dag.tasks[p].name);
  std::sort(names.begin(), names.end());
  return fmt::format("[{}]", fmt::join(names, ", "));
}

class Comparer {
 public:
  void compare(const Workload &a, const Workload &b) {
    add(Kind::Setting, "workers", fmt::format("{}", a.platform.workers), fmt::format("{}", b.platform.workers));
    add(Kind::Setting, "cpus", cpus_text(a.platform), cpus_text(b.platform));
    add(Kind::Setting, "clusters", clusters_text(a.platform), clusters_text(b.platform));
    add(Kind::Setting, "preemption", to_string(a.platform.preemption), to_string(b.platform.preemption));
    add(Kind::Setting, "policy", to_string(a.policy), to_string(b.policy));
    add(Kind::Setting, "ties", to_string(a.ties), to_string(b.ties));
    match(a.dags, b.dags, "DAG ", [this](const Dag &x, const Dag &y) { compare(x, y); });
  }

  std::vector<Change> take() { return std::move(changes_); }

 private:
  void add(Kind kind, const std::string &what, const std::string &before, const std::string &after) {
    if (before != after) changes_.push_back(Change{kind, what, before, after});
  }

  template <class Item, class Both>
  void match(const std::vector<Item> &a, const std::vector<Item> &b, const std::string &what, Both both) {
    const auto named = [](const std::vector<Item> &items, const std::string &name) {
      return std::find_if(items.begin(), items.end(), [&](const Item &item) { return item.name == name; });
    };
    for (const Item &item : a) {
      const auto other = named(b, item.name);
      if (other == b.end()) {
        add(Kind::Demand, what + item.name, "there", "missing");
      } else {
        both(item, *other);
      }
    }
    for (const Item &item : b) {
      if (named(a, item.name) == a.end()) add(Kind::Demand, what + item.name, "missing", "there");
    }
  }

  void compare(const Dag &a, const Dag &b) {
    const std::string of = " of " + a.name;
    add(Kind::Setting, "cluster" + of, a.cluster.empty() ? "none" : a.cluster, b.cluster.empty() ? "none" : b.cluster);
    add(Kind::Setting, "max_active" + of, bound_text(a.max_active), bound_text(b.max_active));
    add(Kind::Setting, "max_pending" + of, bound_text(a.max_pending), bound_text(b.max_pending));
    add(Kind::Demand, "deadline" + of, time_text(a.deadline), time_text(b.deadline));
    add(Kind::Setting, "criticality" + of, to_string(a.criticality), to_string(b.criticality));
    add(Kind::Setting, "degrade" + of, degrade_text(a.degrade), degrade_text(b.degrade));
    add(Kind::Setting, "edges" + of, to_string(a.edges), to_string(b.edges));
    match(a.tasks, b.tasks, "task " + a.name + ".", [&](const Task &x, const Task &y) {
      compare(x, predecessors_text(a, x), y, predecessors_text(b, y), a.name);
    });
  }

  void compare(const Task &a, const std::string &after_a, const Task &b, const std::string &after_b,
               const std::string &dag) {
    const std::string of = " of " + dag + "." + a.name;
    const auto time = [&](Kind kind, const char *what, Duration x, Duration y) {
      add(kind, what + of, time_text(x), time_text(y));
    };
    add(Kind::Demand, "activation" + of, to_string(a.activation), to_string(b.activation));
    add(Kind::Demand, "predecessors" + of, after_a, after_b);
    time(Kind::Demand, "period", a.period, b.period);
    time(Kind::Demand, "deadline", a.deadline, b.deadline);
    time(Kind::Demand, "wcet", a.wcet, b.wcet);
    time(Kind::Demand, "bcet", a.bcet, b.bcet);
    add(Kind::Demand, "execution" + of, execution_text(a.execution), execution_text(b.execution));
    if (a.execution.samples.size() == b.execution.samples.size() && a.execution.samples != b.execution.samples) {
      add(Kind::Demand, "execution" + of, execution_text(a.execution), "others");
    }
    time(Kind::Demand, "offset", a.offset, b.offset);
    time(Kind::Demand, "jitter", a.jitter, b.jitter);
    time(Kind::Setting, "region", a.region, b.region);
    time(Kind::Setting, "budget", a.budget, b.budget);
    add(Kind::Setting, "on_budget" + of, to_string(a.on_budget), to_string(b.on_budget));
    time(Kind::Setting, "wcet_low", a.wcet_low, b.wcet_low);
    add(Kind::Setting, "criticality" + of, to_string(a.criticality), to_string(b.criticality));
    add(Kind::Setting, "overrun" + of, overrun_text(a), overrun_text(b));
    add(Kind::Setting, "concurrency" + of, fmt::format("{}", a.concurrency), fmt::format("{}", b.concurrency));
    add(Kind::Setting, "group" + of, a.group.empty() ? "none" : a.group, b.group.empty() ? "none" : b.group);
    const auto priority = [](std::optional<int> value) { return value ? fmt::format("{}", *value) : "none"; };
    add(Kind::Setting, "priority" + of, priority(a.priority), priority(b.priority));
  }

  std::vector<Change> changes_;
};

}  // namespace

std::string bound_text(std::uint32_t bound) { return bound == 0 ? "none" : fmt::format("{}", bound); }

std::vector<Change> changes_between(const Workload &before, const Workload &after) {
  Comparer comparer;
  comparer.compare(before, after);
  return comparer.take();
}

}  // namespace redag::lab
