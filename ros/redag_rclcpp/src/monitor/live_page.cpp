// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "live_page.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "rclcpp/logging.hpp"
#include "redag/runtime/live_sample.hpp"

namespace redag_rclcpp {

LivePage::LivePage(const ReDAGExecutor &executor) : executor_(executor) {
  const std::string name = executor_.as_trace({}).info.workload.name;
  auto publisher =
      redag::live::Publisher::start(redag::runtime::live_options(name.empty() ? "ros" : name, "ros", executor_.mode(),
                                                                 executor_.engine().options().config),
                                    [this](redag::live::Sample &sample) { fill(sample); });
  if (publisher) {
    publisher_ = *std::move(publisher);
  } else {
    RCLCPP_WARN(rclcpp::get_logger("redag_rclcpp"), "%s", to_string(publisher.error()).c_str());
  }
}

void LivePage::fill(redag::live::Sample &sample) const {
  const redag::runtime::Engine &engine = executor_.engine();
  std::map<std::string, std::uint32_t> dag_of;
  for (const redag::Dag &dag : executor_.dags()) {
    dag_of.emplace(dag.name, static_cast<std::uint32_t>(sample.dags.size()));
    sample.dags.push_back({dag.name, dag.max_active, dag.deadline});
  }
  redag::runtime::add_threads(sample, engine);
  redag::runtime::add_devices(sample, engine);
  const std::vector<CallbackStats> stats = executor_.stats(false);
  std::map<redag::TaskId, std::string> its_dag;
  for (const CallbackStats &callback : stats) its_dag.emplace(callback.key, callback.dag);
  // A task whose messages another task of its DAG takes does not answer for the DAG.
  std::set<redag::TaskId> followed;
  for (const CallbackStats &callback : stats) {
    for (const redag::TaskId publisher : callback.publishers) {
      const auto found = its_dag.find(publisher);
      if (found != its_dag.end() && found->second == callback.dag && publisher != callback.key) {
        followed.insert(publisher);
      }
    }
  }
  const redag::LockGuard guard(lock_);
  for (const CallbackStats &callback : stats) {
    redag::live::TaskSample task;
    task.key = callback.key.value;
    const bool named = !callback.dag.empty();
    task.name = named ? callback.task.substr(callback.dag.size() + 1) : callback.task;
    task.dag = named ? dag_of.at(callback.dag) : static_cast<std::uint32_t>(sample.dags.size() - 1);
    task.period = callback.period;
    task.deadline = callback.deadline;
    const auto bound = named ? bounds_.find(callback.task) : bounds_.end();
    if (bound != bounds_.end()) task.bound = bound->second;
    const redag::runtime::TaskFigures figures = engine.figures(callback.key);
    if (figures.jobs.released < callback.jobs.released) continue;  // another callback has the key by now
    redag::runtime::fill(task, figures);
    task.misses = callback.misses;
    if (followed.count(callback.key) > 0) task.end_to_end.reset();
    sample.tasks.push_back(std::move(task));
  }
  sample.alert = alert();
}

// The deadlocks that last, in one line, or what breaks the order.
std::string LivePage::alert() const {
  std::vector<Deadlock> lasting = executor_.deadlocks();
  std::erase_if(lasting, [](const Deadlock &deadlock) { return deadlock.ended != redag::kNever; });
  if (lasting.empty()) return redag::runtime::alert_of(executor_.engine());
  const Deadlock &first = lasting.front();
  const std::string text =
      fmt::format("{}: {} waits for {}, which cannot get {}", first.certain ? "deadlock" : "possible deadlock",
                  first.waiting, first.blocked, first.resource);
  return lasting.size() > 1 ? fmt::format("{} deadlocks; {}", lasting.size(), text) : text;
}

}  // namespace redag_rclcpp
