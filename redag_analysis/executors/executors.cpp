// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/executors.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/derived/clusters.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/executors/clustered.hpp"
#include "redag_analysis/executors/events.hpp"
#include "redag_analysis/executors/wait_set.hpp"

namespace redag::executors {
namespace {

constexpr std::array<ExecutorKind, 6> kExecutors{{
    {"redag", "ReDAG-RT: one priority order over all DAGs, bounds for each DAG, preemption", true, false, false},
    {"mte", "model of rclcpp's MultiThreadedExecutor (Humble)", false, false, false},
    {"ste", "model of rclcpp's SingleThreadedExecutor (Humble); one worker", false, true, false},
    {"static", "model of rclcpp's StaticSingleThreadedExecutor (Humble); one worker", false, true, false},
    {"events", "model of rclcpp's experimental EventsExecutor (Jazzy); one worker", false, true, true},
    {"cbg", "model of EventsCBGExecutor (cm_executors)", false, false, false},
}};

}  // namespace

std::span<const ExecutorKind> all() { return kExecutors; }

const ExecutorKind *find_executor(std::string_view name) {
  const auto *found = std::find_if(kExecutors.begin(), kExecutors.end(),
                                   [name](const ExecutorKind &kind) { return kind.name == name; });
  return found == kExecutors.end() ? nullptr : found;
}

sched::Config effective_config(const ExecutorKind &kind, sched::Config config) {
  if (!kind.ours) {
    config.preemption = sched::Preemption::None;
    config.levels = 0;
    config.max_started = 0;
  }
  if (kind.single_worker) config.workers = 1;
  return config;
}

std::unique_ptr<sched::Scheduler> make_scheduler(std::string_view name, const Workload &workload,
                                                 const sched::Config &config, std::vector<std::uint32_t> ranks) {
  const ExecutorKind *kind = find_executor(name);
  REDAG_CHECK(kind != nullptr, "there is no executor of this name");
  if (!workload.platform.clusters.empty()) {
    return std::make_unique<ClusteredScheduler>(workload, [&](const ClusterPart &part) {
      return make_scheduler(name, part.workload, config_of(config, part));
    });
  }
  const sched::Config effective = effective_config(*kind, config);
  if (name == "redag") return std::make_unique<sched::PriorityScheduler>(workload, effective);
  if (name == "events") return std::make_unique<EventsScheduler>(workload, effective, EventsDispatcher::Kind::Events);
  if (name == "cbg") {
    return std::make_unique<EventsScheduler>(workload, effective, EventsDispatcher::Kind::CallbackGroups);
  }
  using Order = WaitSetDispatcher::Order;
  return std::make_unique<WaitSetScheduler>(
      workload, effective, name == "static" ? Order::SubscriptionsFirst : Order::TimersFirst, std::move(ranks));
}

}  // namespace redag::executors
