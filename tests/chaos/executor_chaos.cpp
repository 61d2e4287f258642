// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/derived/rng.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/runtime/blocking.hpp"
#include "redag/runtime/executor.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "tests/chaos/chaos.hpp"

namespace redag::chaos {
namespace {

using namespace std::chrono_literals;
using runtime::DagBuilder;
using runtime::Executor;
using runtime::TaskHandle;
using std::chrono::nanoseconds;

constexpr Duration kWcet = 30 * kMicrosecond;

enum Fault : std::uint8_t {
  None,
  Throws,
  ThrowsNoException,
  RunsOutOfMemory,
  SaysItsBudgetIsUsed,
  Sleeps,
  Overruns,
  Locks,
  Asks,
  AddsADag,
  RemovesItsDag,
  WaitsForItself,
  Blocks,
  Stops,
};
constexpr std::array<const char *, 14> kFaultNames = {"bodies without a fault",
                                                      "bodies that throw",
                                                      "bodies that throw what is no exception",
                                                      "bodies that throw bad_alloc",
                                                      "bodies that cut themselves off",
                                                      "bodies that sleep",
                                                      "bodies that run 100 times their wcet",
                                                      "bodies that share a lock",
                                                      "bodies that ask the executor",
                                                      "bodies that add a DAG",
                                                      "bodies that remove their own DAG",
                                                      "bodies that wait for their executor",
                                                      "bodies that block and lend their workers",
                                                      "bodies that stop the executor"};

std::atomic<Executor *> signalled{nullptr};
void on_signal(int) {
  if (Executor *executor = signalled.load()) executor->request_stop();
}

void spin(Duration processor_time, bool with_points) {
  const Duration until = job_cpu_time() + processor_time;
  while (job_cpu_time() < until) {
    if (with_points) preemption_point();
  }
}

std::size_t thread_count() {
  std::size_t threads = 0;
  for ([[maybe_unused]] const auto &entry : std::filesystem::directory_iterator("/proc/self/task")) ++threads;
  return threads;
}

// Moves all threads of the process, as a container's manager does.
void move_to(const std::vector<int> &cpus) {
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int cpu : cpus) CPU_SET(static_cast<std::size_t>(cpu), &set);
  std::error_code ignored;
  for (const auto &entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    (void)::sched_setaffinity(std::stoi(entry.path().filename()), sizeof(set), &set);
  }
}

class Run {
 public:
  explicit Run(std::uint64_t seed) : seed_(seed), rng_(seed), usable_(runtime::usable_cpus()) {
    runtime::ExecutorOptions options;
    options.workers = static_cast<std::uint32_t>(rng_.uniform(1, 4));
    constexpr std::array kModes = {PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Auto};
    options.preemption = kModes[static_cast<std::size_t>(rng_.uniform(0, 2))];
    options.policy = static_cast<PolicyKind>(rng_.uniform(0, 5));
    options.trace_capacity = 1U << 16U;
    options.threads = options.workers + static_cast<std::uint32_t>(rng_.uniform(0, 6));
    options.ties = rng_.uniform01() < 0.7 ? Ties::Share : Ties::Fixed;
    options.stop_timeout = 60s;
    options.on_exception = [this](const runtime::ExceptionInfo &) {
      ++exceptions_;
      return runtime::OnException::Continue;
    };
    points_ = rng_.uniform01() < 0.7;
    fault_rate_ = rng_.uniform01() * 0.5;
    crowded_ = rng_.uniform01() < 0.2;
    executor_ = std::make_unique<Executor>(options);
    policy_ = options.policy;
  }

  std::string go(Survived &survived) {
    const std::size_t threads_before = thread_count();
    for (auto dags = rng_.uniform(1, 4); dags > 0; --dags) add();
    signalled = executor_.get();
    executor_->start();
    const Time end = runtime::monotonic_now() + rng_.uniform(2, 40) * kMillisecond;
    bool moved = false;
    while (runtime::monotonic_now() < end && !executor_->stopping()) {
      switch (rng_.uniform(0, 7)) {
        case 0:
          for (auto dags = crowded_ ? 12 : 1; dags > 0; --dags) add();
          break;
        case 1: remove_one(); break;
        case 2: executor_->drain(events_); break;
        case 3:
          move_to({usable_[static_cast<std::size_t>(rng_.uniform(0, std::ssize(usable_) - 1))]});
          moved = true;
          break;
        case 4: move_to(usable_); break;
        default: std::this_thread::sleep_for(nanoseconds(rng_.uniform(1, 2'000'000)));
      }
    }
    if (rng_.uniform01() < 0.3) ::raise(SIGUSR1);
    executor_->stop();
    move_to(usable_);
    signalled = nullptr;
    executor_->drain(events_);
    std::string verdict = judge();
    executor_.reset();
    // A joined thread may be listed for a moment longer.
    const Time give_up = runtime::monotonic_now() + 10 * kSecond;
    while (thread_count() > threads_before && runtime::monotonic_now() < give_up) std::this_thread::sleep_for(1ms);
    if (thread_count() > threads_before) return "threads are left over\n" + verdict;
    if (alive_.use_count() != 1) return "bodies are left over\n" + verdict;
    for (std::size_t fault = 0; fault < kFaultNames.size(); ++fault) survived[kFaultNames[fault]] += faults_[fault];
    survived["exceptions told"] += exceptions_;
    survived["DAGs, most of them added while running"] += dags_.size();
    survived["runs with processors taken away"] += moved ? 1 : 0;
    survived[fmt::format("runs, preemption {}", to_string(trace_preemption_))] += 1;
    survived["runs with more tasks than priority levels"] += levels_shared_ ? 1 : 0;
    survived["runs of which events were lost"] += events_lost_ ? 1 : 0;
    return verdict;
  }

 private:
  // Adds a DAG to the executor and to `dags_`, where its position is its DagId. Drawn apart from random_dag(): the
  // periods are long enough for real threads, and DagBuilder takes bodies instead of execution times.
  void add() {
    const LockGuard guard(lock_);
    if (dags_.size() >= kMostDags) return;
    const auto number = dags_.size();
    Dag dag;
    dag.name = fmt::format("d{}", number);
    runtime::DagOptions dag_options;
    dag.max_active = dag_options.max_active = static_cast<std::uint32_t>(dice_.uniform(0, 2));
    dag.max_pending = dag_options.max_pending = static_cast<std::uint32_t>(dice_.uniform(0, 3));
    dag.criticality = dag_options.criticality = static_cast<Criticality>(dice_.uniform(0, 2));
    if (dag.criticality != Criticality::High && dice_.uniform01() < 0.5) {
      dag.degrade = dag_options.degrade = Degrade{Degrade::Kind::Skip, 1, 2};
    }
    DagBuilder builder(dag.name, dag_options);
    std::vector<TaskHandle> handles;
    const auto tasks = dice_.uniform(1, 4);
    for (std::int64_t i = 0; i < tasks; ++i) {
      Task task;
      task.name = fmt::format("t{}", i);
      task.wcet = kWcet;
      runtime::TaskOptions options;
      options.wcet = nanoseconds(kWcet);
      task.criticality = dag.criticality;
      if (dice_.uniform01() < 0.2) options.group = task.group = "g";
      if (task.group.empty() && dice_.uniform01() < 0.2) options.concurrency = task.concurrency = 2;
      if (dag.criticality == Criticality::High && dice_.uniform01() < 0.3) {
        task.wcet_low = kWcet / 2;
        options.wcet_low = nanoseconds(task.wcet_low);
      }
      if (dice_.uniform01() < 0.3) {
        options.overrun = task.overrun = Overrun::Queue;
        options.queue_depth = task.queue_depth = static_cast<std::uint32_t>(dice_.uniform(1, 4));
      }
      if (dice_.uniform01() < 0.3) {
        task.budget = 100 * kMicrosecond;
        options.budget = nanoseconds(task.budget);
        options.on_budget = task.on_budget = static_cast<OnBudget>(dice_.uniform(0, 3));
      }
      const auto body = [this, number, alive = alive_] { misbehave(DagId(number)); };
      if (i > 0 && dice_.uniform01() < 0.5) {
        task.activation = Activation::Data;
        const auto after = dice_.uniform(0, i - 1);
        task.predecessors = {static_cast<std::uint32_t>(after)};
        handles.push_back(builder.data(task.name, {handles[static_cast<std::size_t>(after)]}, body, options));
      } else {
        task.period = dice_.uniform(1, 8) * 500 * kMicrosecond;
        handles.push_back(builder.timer(task.name, nanoseconds(task.period), body, options));
      }
      dag.tasks.push_back(task);
    }
    inherit_periods(dag);
    executor_->add(std::move(builder));
    dags_.push_back(std::move(dag));
    there_.push_back(true);
  }

  void remove(DagId dag) {
    {
      const LockGuard guard(lock_);
      if (!there_[dag.value]) return;
      there_[dag.value] = false;
    }
    executor_->remove(dag);
  }

  void remove_one() {
    std::size_t count = 0;
    {
      const LockGuard guard(lock_);
      count = dags_.size();
    }
    remove(DagId(static_cast<std::size_t>(rng_.uniform(0, static_cast<std::int64_t>(count) - 1))));
  }

  void misbehave(DagId dag) {
    Rng dice = Rng::stream(seed_, dag.value, jobs_.fetch_add(1));
    const Fault fault = dice.uniform01() < fault_rate_ ? static_cast<Fault>(dice.uniform(1, Stops)) : None;
    // Only few runs are to end early.
    if (fault == Stops && dice.uniform01() > 0.02) return;
    ++faults_[fault];
    switch (fault) {
      case None: spin(dice.uniform(0, kWcet), points_); break;
      case Throws: throw std::runtime_error("a fault");
      case ThrowsNoException: throw 7;
      case RunsOutOfMemory: throw std::bad_alloc();
      case SaysItsBudgetIsUsed: throw BudgetExceeded{};
      case Sleeps: std::this_thread::sleep_for(nanoseconds(dice.uniform(1, 1'000'000))); break;
      case Overruns: spin(100 * kWcet, points_); break;
      case Locks: {
        const LockGuard guard(shared_);  // a preempted body may hold it
        spin(kWcet, false);
        break;
      }
      case Asks:
        (void)executor_->stats(dag);
        (void)executor_->task_name(TaskId(0));
        (void)executor_->lost_events();
        if (points_) preemption_point();
        break;
      case AddsADag: add(); break;
      case RemovesItsDag: remove(dag); break;
      case WaitsForItself:
        try {
          executor_->wait();
          ++mistakes_;
        } catch (const std::logic_error &) {
        }
        break;
      case Blocks: {
        const Blocking lends;
        std::this_thread::sleep_for(nanoseconds(dice.uniform(1, 1'000'000)));
        break;
      }
      case Stops: executor_->stop(); break;
    }
  }

  std::string judge() {
    trace::Trace trace;
    trace.info.executor = "redag";
    trace.info.config = executor_->config();
    trace.info.driver = trace::Driver::Threads;
    trace.info.workload.name = "chaos";
    trace.info.workload.policy = policy_;
    trace.info.workload.ties = trace.info.config.ties;
    trace.info.workload.platform.workers = trace.info.config.workers;
    trace.info.workload.dags = dags_;
    trace.info.lost_events = executor_->lost_events();
    trace.info.end = std::max<Time>(0, executor_->stopped_at());
    std::erase_if(events_, [&](const JobEvent &event) { return event.time >= trace.info.end; });
    trace.events = std::move(events_);
    trace_preemption_ = executor_->mode().mode;
    if (mistakes_ > 0) return "a body could wait for its own executor";
    // DAGs that are added later have grids of their own.
    metrics::RuleSet rules = metrics::RuleSet::all().without(metrics::Rule::Grid);
    // Once the tasks of a removed DAG have left the order, its smallest period is that of the other tasks. The trace
    // does not record this.
    if (policy_ == PolicyKind::ChainAware) {
      rules = rules.without(metrics::Rule::Priority).without(metrics::Rule::Preemption);
    }
    // Nor does the trace record which tasks shared a level at a time. Only the order of preemption can be checked.
    std::uint32_t &levels = trace.info.config.levels;
    levels_shared_ = levels > 0 && trace.info.workload.task_count() > levels;
    if (levels_shared_) {
      levels = 0;
      rules = rules.without(metrics::Rule::Priority);
    }
    // In os mode, overload can keep this thread from draining. A trace with lost events cannot be checked; the counts
    // can.
    events_lost_ = trace.info.lost_events > 0;
    if (events_lost_) rules = rules.without(metrics::Rule::Stream);
    const metrics::CheckReport report = metrics::check_trace(trace, rules);
    std::string text = lawful_but_for_removals(report) ? "" : report.to_string();
    for (std::size_t d = 0; d < dags_.size(); ++d) {
      for (const runtime::TaskStats &task : executor_->stats(DagId(d))) {
        const sched::Accounting &jobs = task.jobs;
        if (jobs.released >= jobs.finished + jobs.skipped + jobs.aborted) continue;
        text += fmt::format("{}: more jobs ended than were released\n", task.task);
      }
    }
    if (text.empty()) return {};
    return fmt::format("{}preemption {}, {} workers, {}\n", text, to_string(trace_preemption_),
                       trace.info.config.workers, to_string(policy_));
  }

  // True if all violations belong to removed DAGs. The trace does not record removals; started jobs of a removed DAG
  // release no successors.
  [[nodiscard]] bool lawful_but_for_removals(const metrics::CheckReport &report) const {
    if (report.violation_count > report.violations.size()) return false;
    return std::all_of(report.violations.begin(), report.violations.end(), [this](const metrics::Violation &violation) {
      if (violation.rule != metrics::Rule::Precedence) return false;
      return !there_[std::stoul(violation.job.substr(1))];  // the DAG's number in "d5.t1#7"
    });
  }

  static constexpr std::size_t kMostDags = 60;

  std::uint64_t seed_;
  Rng rng_;  // used by the controlling thread
  std::vector<int> usable_;
  bool points_ = false;
  double fault_rate_ = 0;
  bool crowded_ = false;  // many DAGs at a time, often with more tasks than the system has priority levels
  PolicyKind policy_ = PolicyKind::RateMonotonic;
  PreemptionMode trace_preemption_ = PreemptionMode::None;
  bool levels_shared_ = false;  // tasks may have shared levels for some time
  bool events_lost_ = false;
  std::shared_ptr<int> alive_ = std::make_shared<int>(0);  // every body holds a reference
  PiMutex shared_;
  PiMutex lock_;
  Rng dice_{seed_ + 1};      // guarded by lock_
  std::vector<Dag> dags_;    // guarded by lock_
  std::vector<bool> there_;  // guarded by lock_
  std::vector<JobEvent> events_;
  std::atomic<std::uint32_t> jobs_{0};
  std::array<std::atomic<std::uint64_t>, kFaultNames.size()> faults_{};
  std::atomic<std::uint64_t> exceptions_{0};
  std::atomic<std::uint64_t> mistakes_{0};
  std::unique_ptr<Executor> executor_;  // last member: its bodies use the others
};

}  // namespace

std::string executor_run(std::uint64_t seed, Survived &survived) {
  std::signal(SIGUSR1, on_signal);
  return Run(seed).go(survived);
}

}  // namespace redag::chaos
