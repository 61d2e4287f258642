// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "workload_run.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <functional>
#include <memory>
#include <numeric>
#include <system_error>
#include <thread>
#include <utility>

#include "node_events.hpp"
#include "peers.hpp"
#include "raised_thread.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/loader/validate.hpp"
#include "redag/threads/setup.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/this_machine.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_rclcpp/executor.hpp"
#include "workload_nodes.hpp"

namespace redag_rclcpp::lab {

using redag::Duration;
using redag::JobEvent;
using redag::PreemptionMode;
using redag::Time;

namespace {

constexpr Duration kConnectTimeout = 20 * redag::kSecond;
constexpr Duration kStartMargin = 300 * redag::kMillisecond;  // from the timers' creation to time 0
constexpr Duration kCollectEvery = 100 * redag::kMillisecond;
constexpr Duration kDrainTimeout = 5 * redag::kSecond;
constexpr std::uint32_t kSpareThreads = 16;  // spare threads of ReDAGExecutor with os
constexpr std::size_t kSchedulerEvents = std::size_t{1} << 17U;

bool is_redag(const std::string &name) { return name.rfind("redag", 0) == 0; }

std::optional<PreemptionMode> preemption_of(const std::string &name) {
  if (name == "redag-none") return PreemptionMode::None;
  if (name == "redag-cooperative") return PreemptionMode::Cooperative;
  if (name == "redag-os") return PreemptionMode::Os;
  return std::nullopt;
}

class Run {
 public:
  Run(const redag::Workload &workload, const WorkloadRunOptions &options) : workload_(workload), options_(options) {
    // The check judges max_active and groups by this number. The threads that ran bodies can be more.
    workers_ = options_.threads > 0 ? options_.threads : workload_.platform.workers;
    if (has_one_thread(options_.executor)) workers_ = 1;
    workload_.platform.workers = workers_;
  }

  redag::Result<WorkloadRun> execute() {
    if (auto known = check_executor(options_.executor); !known) return tl::unexpected(known.error());
    if (auto possible = look_at_limits(); !possible) return tl::unexpected(possible.error());
    NodesOptions nodes;
    nodes.seed = options_.seed;
    nodes.intra_process = options_.intra_process;
    nodes.redag = is_redag(options_.executor);
    nodes.threads = workers_ + (nodes.redag ? kSpareThreads : 0) + 1;
    nodes.end = options_.duration;
    nodes_ = std::make_unique<WorkloadNodes>(workload_, nodes);
    if (auto connected = nodes_->connect(kConnectTimeout); !connected) return tl::unexpected(connected.error());
    try {
      make_executor();
    } catch (const std::runtime_error &error) {  // this process may not have the requested preemption
      return redag::make_error(error.what(), options_.executor == "redag-os" ? redag::runtime::realtime_hint() : "");
    }
    if (preempts_by_priority()) nodes_->note_absences();
    nodes_->arm(timer_clock_now() + kStartMargin);
    const Duration cost = nodes_->measurement_cost();
    for (const auto &node : nodes_->nodes()) executor_->add_node(node);
    std::thread spinning([this] { spin(); });
    collect_and_end();
    spinning.join();
    if (const auto failure = failure_text()) return redag::make_error(fmt::format("the executor failed: {}", *failure));
    collect();
    describe_run(cost);
    evaluate();
    return std::move(result_);
  }

 private:
  redag::Result<void> look_at_limits() {
    redag::Diagnostics errors;
    for (const redag::Diagnostic &found : ros_limits(workload_)) {
      if (found.severity == redag::Severity::Error) {
        errors.push_back(found);
      } else {
        result_.warnings.push_back(fmt::format("{} ({})", found.message, found.hint));
      }
    }
    if (!errors.empty()) return tl::unexpected(errors);
    if (const auto cpu = redag::runtime::unusable_cpu(workload_.platform.cpus)) {
      return redag::make_error(fmt::format("the platform has processor {}, which this process cannot use", *cpu),
                               "change 'cpus:' in the file");
    }
    const bool bounded = std::any_of(workload_.dags.begin(), workload_.dags.end(),
                                     [](const redag::Dag &dag) { return dag.max_active > 0; });
    if (bounded && !is_redag(options_.executor)) {
      result_.warnings.push_back(fmt::format("{} does not support max_active, which is ignored", options_.executor));
    }
    return {};
  }

  void make_executor() {
    const std::string &name = options_.executor;
    if (is_redag(name)) {
      ReDAGOptions redag;
      redag.workers = workers_;
      redag.preemption = preemption_of(name).value_or(workload_.platform.preemption);
      redag.threads = workers_ + kSpareThreads;
      redag.cpus = workload_.platform.cpus;
      redag.workload = redag::validated(nodes_->bound_workload()).value();
      redag.trace_capacity = kSchedulerEvents;
      redag_ = std::make_shared<ReDAGExecutor>(redag);
      executor_ = redag_;
    } else {
      executor_ = make_peer(name, workers_);
    }
  }

  // rclcpp's executors know no processors. Their threads inherit those of the thread that spins.
  void pin_peer() {
    const std::vector<int> &cpus = workload_.platform.cpus;
    if (redag_ || cpus.empty()) return;
    cpu_set_t set;
    CPU_ZERO(&set);
    for (const int cpu : cpus) CPU_SET(static_cast<std::size_t>(cpu), &set);
    const int error = pthread_setaffinity_np(pthread_self(), sizeof(set), &set);
    if (error != 0) throw std::system_error(error, std::generic_category(), "the executor's processors");
  }

  void spin() {
    try {
      pin_peer();
      executor_->spin();
    } catch (...) {
      const redag::LockGuard guard(failure_lock_);
      failure_ = std::current_exception();
    }
    spin_ended_ = true;
  }

  std::optional<std::string> failure_text() {
    const redag::LockGuard guard(failure_lock_);
    if (!failure_) return std::nullopt;
    try {
      std::rethrow_exception(failure_);
    } catch (const std::exception &error) {
      return error.what();
    } catch (...) {
      return "an exception of an unknown type";
    }
  }

  // True with preemption os: threads have the priorities of their jobs.
  [[nodiscard]] bool preempts_by_priority() const {
    return redag_ != nullptr && redag_->mode().mode == PreemptionMode::Os;
  }

  // A priority above the threads that execute bodies, which under overload leave no time to others. With os these
  // threads have priorities of their own. Under chrt they have this thread's priority.
  [[nodiscard]] int collecting_priority() const {
    return preempts_by_priority() ? redag::runtime::probe_priority_band().top_job + 1
                                  : redag::runtime::fifo_priority_above_this_thread();
  }

  void collect_and_end() {
    const RaisedThread raised(collecting_priority());
    collect_until_end();
    nodes_->halt();
    if (!nodes_->wait_idle(timer_clock_now() + kDrainTimeout)) {
      nodes_->give_up();
      result_.warnings.push_back(
          fmt::format("bodies were still running {} after the end", redag::format_duration(kDrainTimeout)));
    }
    // Repeats cancel(), because one before the spin began is lost: by rclcpp's executors, and on Humble by
    // ReDAGExecutor, where cancel() is not virtual.
    while (!spin_ended_) {
      executor_->cancel();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  void collect_until_end() {
    for (Time now = nodes_->now(); now < options_.duration; now = nodes_->now()) {
      if (options_.stop != nullptr && options_.stop->load()) {
        result_.stopped = true;
        break;
      }
      std::this_thread::sleep_for(std::chrono::nanoseconds(std::min(kCollectEvery, options_.duration - now)));
      collect();
    }
    end_ = result_.stopped ? std::clamp<Time>(nodes_->now(), 0, options_.duration) : options_.duration;
  }

  void collect() {
    nodes_->drain(bodies_);
    if (redag_ != nullptr) redag_->drain_trace(decisions_);
  }

  void describe_run(Duration cost) {
    redag::trace::RunInfo &info = result_.trace.info;
    info.workload = workload_;
    info.executor = options_.executor;
    // The number of threads that ran bodies. With os it exceeds the number that ran at the same time, which the
    // workload's platform states.
    info.config.workers = std::max(workers_, nodes_->threads_seen());
    info.config.policy = workload_.policy;
    info.config.ties = workload_.ties;
    info.preemption = "none";
    info.preemption_why = options_.executor + " has no other";
    if (redag_ != nullptr) {
      info.preemption = to_string(redag_->mode().mode);
      info.preemption_why = redag_->mode().reason;
      const bool cooperative = redag_->mode().mode == PreemptionMode::Cooperative;
      if (cooperative) info.config.preemption = redag::sched::Preemption::Cooperative;
      for (std::string &warning : redag_->warnings()) result_.warnings.push_back(std::move(warning));
    }
    info.driver = redag::trace::Driver::RosNodes;
    info.seed = options_.seed;
    info.end = end_;
    info.warm_up = options_.warm_up;
    info.overheads = fmt::format("ROS 2 {} transport; measuring costs {} per job; timers are within {} of the grid",
                                 options_.intra_process ? "intra-process" : "middleware", redag::format_duration(cost),
                                 redag::format_duration(nodes_->phase_error()));
    redag::trace::add_provenance(info);
    info.lost_events = nodes_->lost_events();
    if (info.lost_events > 0) {
      result_.warnings.push_back(fmt::format("{} events were lost: the figures are incomplete", info.lost_events));
    }
  }

  void evaluate() {
    result_.trace.events =
        node_events(workload_, bodies_, {end_, nodes_->phase_error(), options_.executor == "events"});
    result_.summary = redag::metrics::summarize(result_.trace);
    result_.check = redag::metrics::check_trace(result_.trace, redag::metrics::rules_for(result_.trace.info));
    if (redag_ == nullptr) return;
    SchedulerTrace scheduler;
    scheduler.trace = redag_->as_trace(std::move(decisions_));
    scheduler.trace.info.seed = options_.seed;
    scheduler.check = redag::metrics::check_trace(scheduler.trace, redag::metrics::rules_for(scheduler.trace.info));
    result_.scheduler = std::move(scheduler);
  }

  redag::Workload workload_;
  const WorkloadRunOptions &options_;
  std::uint32_t workers_ = 1;
  WorkloadRun result_;
  std::unique_ptr<WorkloadNodes> nodes_;
  std::shared_ptr<rclcpp::Executor> executor_;  // declared after the nodes: destroyed before them
  std::shared_ptr<ReDAGExecutor> redag_;        // the same object, if it is a ReDAGExecutor
  std::vector<JobEvent> bodies_;
  std::vector<JobEvent> decisions_;
  Time end_ = 0;
  std::atomic<bool> spin_ended_{false};
  redag::Mutex failure_lock_;
  std::exception_ptr failure_ REDAG_GUARDED_BY(failure_lock_);
};

}  // namespace

const std::vector<std::string> &executor_names() {
  static const std::vector<std::string> kNames = [] {
    std::vector<std::string> all = {"redag", "redag-none", "redag-cooperative", "redag-os"};
    all.insert(all.end(), peer_names().begin(), peer_names().end());
    return all;
  }();
  return kNames;
}

redag::Result<void> check_executor(const std::string &name) {
  const std::vector<std::string> &names = executor_names();
  if (std::find(names.begin(), names.end(), name) == names.end()) {
    return redag::make_error(fmt::format("there is no executor '{}'", name),
                             fmt::format("one of {}", fmt::join(names, ", ")));
  }
  return is_redag(name) ? redag::Result<void>() : check_peer(name);
}

redag::Result<WorkloadRun> run_as_nodes(const redag::Workload &workload, const WorkloadRunOptions &options) {
  return Run(workload, options).execute();
}

}  // namespace redag_rclcpp::lab
