// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/schedule_script.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "redag/sched/policy.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::testing {
namespace {

using sched::Dispatch;
using sched::Outcome;
using sched::Preemption;
using sched::Step;
using Kind = ScriptStep::Kind;

using JobKey = std::pair<std::uint32_t, std::uint32_t>;  // task, number

std::string describe(const JobEvent &event) {
  return fmt::format("    {:>8} task {} job {}: {} {} worker {} value {}\n", event.time, event.task.value, event.job,
                     to_string(event.kind), event.reason == Reason::None ? "" : to_string(event.reason),
                     static_cast<std::int32_t>(event.worker), event.value);
}

std::string describe(const std::vector<JobEvent> &events) {
  std::string text;
  for (const JobEvent &event : events) text += describe(event);
  return text;
}

// Sorts neighbouring events whose order is not specified.
std::vector<JobEvent> normalised(const Step &step, const std::set<TaskId> &uncounted) {
  std::vector<JobEvent> events;
  for (const JobEvent &event : step.events) {
    if (event.kind != JobEventKind::Deferred || uncounted.count(event.task) == 0) events.push_back(event);
  }
  const auto order_class = [](const JobEvent &event) {
    if (event.kind == JobEventKind::Resumed) return 1;
    return event.reason == Reason::Removed || event.reason == Reason::Degraded ? 2 : 0;
  };
  for (auto first = events.begin(); first != events.end();) {
    const int its_class = order_class(*first);
    const bool alone = its_class == 0 || first->kind == JobEventKind::Released;
    const auto last =
        alone ? first + 1
              : std::find_if(first, events.end(), [&](const JobEvent &e) { return order_class(e) != its_class; });
    std::sort(first, last, [](const JobEvent &a, const JobEvent &b) {
      return std::tie(a.worker, a.task, a.job) < std::tie(b.worker, b.task, b.job);
    });
    first = last;
  }
  return events;
}

/// What a driver knows of one scheduler: its names for the jobs that have started.
class Side {
 public:
  explicit Side(sched::Scheduler &scheduler) : scheduler_(&scheduler) {}

  sched::Scheduler &operator*() const { return *scheduler_; }
  sched::Scheduler *operator->() const { return scheduler_; }

  std::vector<JobEvent> take(const Step &step, const std::set<TaskId> &uncounted) {
    for (const Dispatch &d : step.dispatches) {
      const JobKey key{d.task.value, d.number};
      slots_[key] = d.job;
      if (d.kind != sched::DispatchKind::Serve) levels_[key] = d.level;
    }
    return normalised(step, uncounted);
  }
  [[nodiscard]] JobSlot slot(const JobKey &key) const { return slots_.at(key); }
  [[nodiscard]] std::uint32_t level(const JobKey &key) const { return levels_.at(key); }

 private:
  sched::Scheduler *scheduler_;
  std::map<JobKey, JobSlot> slots_;
  std::map<JobKey, std::uint32_t> levels_;
};

class Run {
 public:
  Run(sched::Scheduler &tested, sched::Scheduler &expected, const Workload &workload, const sched::Config &config)
      : tested_(tested), expected_(expected), config_(config), devices_(workload.platform.devices.size()) {
    for (const Dag &dag : workload.dags) know(dag);
  }

  std::optional<std::string> step(const ScriptStep &step) {
    switch (step.kind) {
      case Kind::Advance: now_ += kMicrosecond * step.choice; break;
      case Kind::Release: release(step.choice, false); break;
      case Kind::Miss: release(step.choice, true); break;
      case Kind::Complete: complete(step.choice); break;
      case Kind::Finish: return finish(step.choice);
      case Kind::PreemptionPoint: preemption_point(step.choice); break;
      case Kind::Exceed: exceed(step.choice); break;
      case Kind::Wait: wait(step.choice); break;
      case Kind::Wake: wake(step.choice); break;
      case Kind::Dispatch: return dispatch();
      case Kind::DispatchSome: return dispatch_some(step.choice);
      case Kind::AddDag: add_dag(step.choice); break;
      case Kind::RemoveDag: remove_dag(step.choice); break;
      case Kind::AddTask: return add_task(step.choice);
      case Kind::RemoveTask: remove_task(step.choice); break;
      case Kind::SetTiming: set_timing(step.choice); break;
    }
    return std::nullopt;
  }

  /// Dispatches twice; the second dispatch must do nothing.
  std::optional<std::string> dispatch() {
    if (auto difference = dispatch_once(sched::kNoLimit)) return difference;
    if (!tested_->dispatch(now_).events.empty()) return "a dispatch without an event decided something";
    static_cast<void>(expected_->dispatch(now_));
    return std::nullopt;
  }

  /// Dispatches with a limit, and again with a limit of 0; the second dispatch must do nothing.
  std::optional<std::string> dispatch_some(std::uint8_t choice) {
    if (auto difference = dispatch_once(choice % 3U)) return difference;
    if (!tested_->dispatch(now_, 0).events.empty()) return "a dispatch that may start nothing decided something";
    static_cast<void>(expected_->dispatch(now_, 0));
    return std::nullopt;
  }

 private:
  enum class State : std::uint8_t { Running, Suspended, Queued, Away, Woken };
  struct KnownDag {
    bool bounded = false;  // has a max_active
    bool removed = false;
  };

  void know(const Dag &dag) {
    dags_.push_back(KnownDag{dag.max_active > 0, false});
    for (const Task &task : dag.tasks) know(dags_.back(), task);
  }

  void know(const KnownDag &dag, const Task &task) {
    const TaskId id(task_count_++);
    if (task.activation == Activation::Timer) timers_.push_back(id);
    if (task.predecessors.empty()) sources_.insert(id);
    releases_.push_back(task.offset);
    periods_.push_back(task.period);
    if (dag.bounded && (!task.group.empty() || config_.max_started > 0)) uncounted_.insert(id);
  }

  // Releases one of the timers that are due; the others are late.
  void release(std::uint8_t choice, bool missed) {
    std::vector<TaskId> due;
    for (const TaskId task : timers_) {
      if (releases_[task.value] <= now_) due.push_back(task);
    }
    if (due.empty()) return;
    const TaskId task = due[choice % due.size()];
    for (const Side *side : {&tested_, &expected_}) {
      if (missed) {
        (*side)->miss(task, releases_[task.value], now_, choice % 2 == 0 ? Reason::Overrun : Reason::QueueFull);
      } else {
        const Time nominal = releases_[task.value];
        const bool is_older = choice % 3 == 0 && sources_.count(task) > 0;
        (*side)->release(task, nominal, now_, is_older ? nominal - choice : nominal);
      }
    }
    releases_[task.value] += periods_[task.value];
  }

  // Returns a running job, which ends; with full preemption sometimes one that counts as preempted, because the
  // operating system ran it. Sometimes a job ends while it waits.
  [[nodiscard]] std::optional<JobKey> job_that_ends(std::uint8_t choice) const {
    std::vector<JobKey> jobs;
    for (const auto &[key, state] : jobs_) {
      const bool can_end = state != State::Suspended || config_.preemption == Preemption::Full;
      if (state == State::Running || (choice >= 240 && can_end)) jobs.push_back(key);
    }
    if (jobs.empty()) return std::nullopt;
    return jobs[choice / 8U % jobs.size()];
  }

  // A running job waits; with full preemption sometimes one that the scheduler has not resumed.
  void wait(std::uint8_t choice) {
    std::vector<JobKey> jobs;
    for (const auto &[key, state] : jobs_) {
      const bool runs_unseen = config_.preemption == Preemption::Full && choice >= 240 &&
                               (state == State::Suspended || state == State::Woken);
      if (state == State::Running || runs_unseen) jobs.push_back(key);
    }
    if (jobs.empty()) return;
    const JobKey key = jobs[choice / 4U % jobs.size()];
    const std::size_t device = choice % 4U;
    const DeviceId asked = device < devices_ ? DeviceId(device) : DeviceId::none();
    tested_->wait(tested_.slot(key), asked, now_);
    expected_->wait(expected_.slot(key), asked, now_);
    jobs_[key] = asked.valid() ? State::Queued : State::Away;
  }

  void wake(std::uint8_t choice) {
    std::vector<JobKey> jobs;
    for (const auto &[key, state] : jobs_) {
      if (state == State::Away) jobs.push_back(key);
    }
    if (jobs.empty()) return;
    const JobKey key = jobs[choice % jobs.size()];
    tested_->wake(tested_.slot(key), now_);
    expected_->wake(expected_.slot(key), now_);
    jobs_[key] = State::Woken;
  }
  [[nodiscard]] static Outcome outcome_of(std::uint8_t choice) {
    return choice % 8 == 0   ? Outcome::Threw
           : choice % 8 == 1 ? Outcome::BudgetExceeded
           : choice % 8 == 2 ? Outcome::NoData
                             : Outcome::Finished;
  }

  void complete(std::uint8_t choice) {
    const std::optional<JobKey> key = job_that_ends(choice);
    if (!key) return;
    tested_->complete(tested_.slot(*key), now_, outcome_of(choice));
    expected_->complete(expected_.slot(*key), now_, outcome_of(choice));
    jobs_.erase(*key);
  }

  std::optional<std::string> finish(std::uint8_t choice) {
    const std::optional<JobKey> key = job_that_ends(choice);
    if (!key) return std::nullopt;
    jobs_.erase(*key);
    const std::uint32_t most = choice % 5 == 0 ? choice % 3U : sched::kNoLimit;
    const Step actual = tested_->finish(tested_.slot(*key), now_, outcome_of(choice), most);
    expected_->complete(expected_.slot(*key), now_, outcome_of(choice));
    return compare(actual, most);
  }

  void preemption_point(std::uint8_t choice) {
    if (config_.preemption != Preemption::Cooperative) return;
    std::vector<JobKey> jobs;
    for (const auto &[key, state] : jobs_) {
      if (state == State::Running) jobs.push_back(key);
    }
    if (jobs.empty()) return;
    const JobKey key = jobs[choice % jobs.size()];
    tested_->preemption_point(tested_.slot(key), now_);
    expected_->preemption_point(expected_.slot(key), now_);
  }

  void exceed(std::uint8_t choice) {
    std::vector<JobKey> jobs;
    for (const auto &[key, state] : jobs_) {
      if (state == State::Running || config_.preemption == Preemption::Full) jobs.push_back(key);
    }
    if (jobs.empty()) return;
    const JobKey key = jobs[choice / 4U % jobs.size()];
    const auto limit = choice % 4 == 0 ? sched::Limit::WcetLow : sched::Limit::Budget;
    if (!exceeded_.emplace(key, limit).second) return;
    tested_->exceed(tested_.slot(key), limit, now_);
    expected_->exceed(expected_.slot(key), limit, now_);
  }

  void add_dag(std::uint8_t choice) {
    Rng rng(choice);
    Dag dag = random_dag(rng);
    for (Task &task : dag.tasks) task.offset += now_ / task.period * task.period;
    static_cast<void>(tested_->add_dag(dag, now_));
    static_cast<void>(expected_->add_dag(dag, now_));
    know(dag);
  }

  void remove_dag(std::uint8_t choice) {
    const DagId dag(choice % dags_.size());
    dags_[dag.value].removed = true;
    tested_->remove_dag(dag, now_);
    expected_->remove_dag(dag, now_);
  }

  // Adds a task, or two as one change, to one of the remaining DAGs, anywhere in its order.
  std::optional<std::string> add_task(std::uint8_t choice) {
    std::vector<std::size_t> left;
    for (std::size_t d = 0; d < dags_.size(); ++d) {
      if (!dags_[d].removed) left.push_back(d);
    }
    if (left.empty()) return std::nullopt;
    Rng rng(choice);
    const std::size_t dag = left[choice % left.size()];
    for (std::int64_t others = rng.uniform(0, 1); others >= 0; --others) {
      Task task = random_dag(rng, {1, 1, true, true, false}).tasks.front();
      task.offset += now_ / task.period * task.period;
      const auto rank = static_cast<std::uint32_t>(rng.uniform(0, 4));
      const TaskId id = tested_->add_task(DagId(dag), rank, task, now_, others > 0);
      if (id != expected_->add_task(DagId(dag), rank, task, now_)) return "  a task has another id";
      know(dags_[dag], task);
    }
    const auto actual = tested_->tasks_of(DagId(dag));
    const auto wanted = expected_->tasks_of(DagId(dag));
    if (!std::equal(actual.begin(), actual.end(), wanted.begin(), wanted.end())) return "  a DAG has other tasks";
    return std::nullopt;
  }

  void remove_task(std::uint8_t choice) {
    if (task_count_ == 0) return;
    const TaskId task(choice % task_count_);
    tested_->remove_task(task, now_);
    expected_->remove_task(task, now_);
  }

  void set_timing(std::uint8_t choice) {
    if (task_count_ == 0) return;
    Rng rng(choice);
    const TaskId task(choice % task_count_);
    const Duration period = 10 * kMicrosecond * rng.uniform(1, 5);
    const Duration deadline = 10 * kMicrosecond * rng.uniform(1, 4);
    tested_->set_timing(task, period, deadline, now_);
    expected_->set_timing(task, period, deadline, now_);
    periods_[task.value] = period;
  }

  std::optional<std::string> dispatch_once(std::uint32_t most) { return compare(tested_->dispatch(now_, most), most); }

  // Compares a step of the tested scheduler with the next one of the other.
  std::optional<std::string> compare(const Step &step, std::uint32_t most) {
    const std::vector<JobEvent> actual = tested_.take(step, uncounted_);
    const std::vector<JobEvent> wanted = expected_.take(expected_->dispatch(now_, most), uncounted_);
    if (actual != wanted) {
      return fmt::format("  decided:\n{}  expected:\n{}", describe(actual), describe(wanted));
    }
    for (const JobEvent &event : actual) follow(event);
    for (std::size_t task = 0; task < task_count_; ++task) {
      sched::Accounting actual_count = tested_->accounting(TaskId(task));
      if (uncounted_.count(TaskId(task)) > 0) actual_count.deferred = expected_->accounting(TaskId(task)).deferred;
      if (actual_count != expected_->accounting(TaskId(task))) {
        return fmt::format("  different accounting of task {}", task);
      }
      if (tested_->ready(TaskId(task)) != expected_->ready(TaskId(task))) {
        return fmt::format("  different ready jobs of task {}", task);
      }
    }
    return compare_started();
  }

  // With full preemption the operating system also schedules suspended jobs, by the level that it was told.
  std::optional<std::string> compare_started() {
    for (const auto &[key, state] : jobs_) {
      if (state != State::Running && config_.preemption != Preemption::Full) continue;
      if (is_static(config_.policy) && tested_.level(key) != expected_.level(key)) {
        return fmt::format("  task {} job {} has level {}, expected {}", key.first, key.second, tested_.level(key),
                           expected_.level(key));
      }
      if (state != State::Running) continue;
      // outranked() may answer yes too often, because it ignores bounds and groups; it must never wrongly answer no.
      if (expected_->outranked(expected_.slot(key)) && !tested_->outranked(tested_.slot(key))) {
        return fmt::format("  task {} job {} is outranked and does not know", key.first, key.second);
      }
    }
    return std::nullopt;
  }

  void follow(const JobEvent &event) {
    const JobKey key{event.task.value, event.job};
    if (event.kind == JobEventKind::Dispatched || event.kind == JobEventKind::Resumed) jobs_[key] = State::Running;
    if (event.kind == JobEventKind::Preempted) jobs_[key] = State::Suspended;
    if (event.kind == JobEventKind::Served) jobs_[key] = State::Away;
  }

  Side tested_;
  Side expected_;
  sched::Config config_;
  std::size_t devices_;
  Time now_ = 0;
  std::vector<KnownDag> dags_;
  std::size_t task_count_ = 0;
  std::vector<TaskId> timers_;
  std::set<TaskId> sources_;    // tasks without predecessors
  std::set<TaskId> uncounted_;  // tasks whose deferrals are not compared
  std::vector<Time> releases_;  // the next one of each task
  std::vector<Duration> periods_;
  std::map<JobKey, State> jobs_;  // started and unfinished
  std::set<std::pair<JobKey, sched::Limit>> exceeded_;
};

const char *name_of(Kind kind) {
  switch (kind) {
    case Kind::Advance: return "advance";
    case Kind::Release: return "release";
    case Kind::Miss: return "miss";
    case Kind::Complete: return "complete";
    case Kind::Finish: return "finish";
    case Kind::PreemptionPoint: return "point";
    case Kind::Exceed: return "exceed";
    case Kind::Wait: return "wait";
    case Kind::Wake: return "wake";
    case Kind::Dispatch: return "dispatch";
    case Kind::DispatchSome: return "dispatch_some";
    case Kind::AddDag: return "add";
    case Kind::RemoveDag: return "remove";
    case Kind::AddTask: return "add_task";
    case Kind::RemoveTask: return "remove_task";
    case Kind::SetTiming: return "set_timing";
  }
  return "?";
}

}  // namespace

Script random_script(std::uint64_t seed, std::size_t length, bool reconfigure) {
  Rng rng = Rng::stream(seed, 1, 0);
  Script script;
  // The rates differ from script to script: some scripts starve the scheduler, some keep it idle.
  const double dispatch = 0.1 + 0.4 * rng.uniform01();
  const double release = 0.3 + 0.5 * rng.uniform01();
  const double point = 0.2 * rng.uniform01();
  const double advance = 0.1 + 0.5 * rng.uniform01();
  const double exceed = rng.uniform01() < 0.5 ? 0 : 0.15 * rng.uniform01();
  const double waits = rng.uniform01() < 0.5 ? 0 : 0.4 * rng.uniform01();
  const double limited = rng.uniform01() < 0.5 ? 0 : 0.5 * rng.uniform01();
  constexpr std::array<Kind, 6> kReconfigurations{Kind::AddDag,     Kind::RemoveDag, Kind::AddTask,
                                                  Kind::RemoveTask, Kind::SetTiming, Kind::SetTiming};
  while (script.size() < length) {
    ScriptStep step;
    const double kind = rng.uniform01();
    step.choice = static_cast<std::uint8_t>(rng.uniform(0, 255));
    if (rng.uniform01() < dispatch) {
      step.kind = rng.uniform01() < limited ? Kind::DispatchSome : Kind::Dispatch;
    } else if (reconfigure && rng.uniform01() < 0.06) {
      step.kind = kReconfigurations.at(static_cast<std::size_t>(rng.uniform(0, kReconfigurations.size() - 1)));
    } else if (waits > 0 && rng.uniform01() < waits) {
      step.kind = rng.uniform01() < 0.5 ? Kind::Wait : Kind::Wake;
    } else if (rng.uniform01() < exceed) {
      step.kind = Kind::Exceed;
    } else if (kind < release) {
      step.kind = rng.uniform01() < 0.05 ? Kind::Miss : Kind::Release;
    } else if (kind < release + point) {
      step.kind = Kind::PreemptionPoint;
    } else if (rng.uniform01() < advance) {
      step = ScriptStep{Kind::Advance, static_cast<std::uint8_t>(rng.uniform(1, 60))};
    } else {
      step.kind = rng.uniform01() < 0.5 ? Kind::Complete : Kind::Finish;
    }
    script.push_back(step);
  }
  return script;
}

std::string describe(const Script &script) {
  std::string text;
  for (const ScriptStep &step : script) text += fmt::format("{}({}) ", name_of(step.kind), step.choice);
  return text;
}

std::optional<std::string> find_difference(sched::Scheduler &tested, sched::Scheduler &expected,
                                           const Workload &workload, const sched::Config &config,
                                           const Script &script) {
  Run run(tested, expected, workload, config);
  for (const ScriptStep &step : script) {
    if (auto difference = run.step(step)) return difference;
  }
  return run.dispatch();
}

}  // namespace redag::testing
