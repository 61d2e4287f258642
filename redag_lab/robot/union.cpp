// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/union.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "redag/model/validate.hpp"
#include "redag_lab/robot/links.hpp"
#include "redag_lab/robot/order.hpp"
#include "redag_lab/robot/reservation.hpp"

namespace redag::robot {
namespace {

// Joins the name of a process with that of a DAG or group in it.
std::string joined(const std::string &process, const std::string &name) { return process + "/" + name; }

constexpr const char *kThreads = "threads";
// The levels above those of the order.
constexpr int kAbove = -1;
constexpr int kReserved = -2;

class Union {
 public:
  Union(const Robot &robot, std::uint32_t levels) : robot_(robot), order_(order_of(robot, levels)) {
    workload_.name = robot.name;
    workload_.policy = robot.policy;
    workload_.platform.preemption = PreemptionMode::Os;
  }

  Result<United> run(LoadOptions options) {
    first_of_threads_.resize(robot_.threads.size());
    for (std::size_t p = 0; p < robot_.processes.size(); ++p) add_process(p);
    for (std::size_t t = 0; t < robot_.threads.size(); ++t) add_threads(t);
    if (mistakes_.empty() && workload_.dags.empty()) {
      mistakes_.push_back(
          Diagnostic{Severity::Error, {}, 0, 0, "no process of the robot has a workload", "add 'workload:' to one"});
    }
    if (!mistakes_.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes_));
    set_platform();
    set_phases();
    if (order_.is_merged() || has_above_ || robot_.by_bounds) fix_priorities();
    Diagnostics found = validate(workload_, options);
    if (has_errors(found)) return tl::unexpected<Diagnostics>(std::move(found));
    std::vector<bool> is_above;
    for (const int level : levels_) is_above.push_back(level < 0);
    return United{std::move(workload_), std::move(found), std::move(first_task_), std::move(first_of_threads_),
                  std::move(is_above)};
  }

 private:
  void refuse(const Place &at, std::string message, std::string hint) {
    mistakes_.push_back(Diagnostic{Severity::Error, at.file, at.line, at.column, std::move(message), std::move(hint)});
  }

  void add_process(std::size_t p) {
    const Process &process = robot_.processes[p];
    first_task_.push_back(levels_.size());
    if (!process.workload) return;
    check_executor(p);
    // More threads than processors: a job of the process can be started beside a more urgent one.
    const bool has_more_threads = process.workload->platform.workers > robot_.cpu_sets[process.cpu_set].cpus.size();
    starters_ += process.states_workers && has_more_threads ? 2 : 1;
    if (process.name == kThreads) {
      refuse(process.place, "the name 'threads' of a process is that of all threads in the union",
             "choose another name");
    }
    for (const Dag &original : process.workload->dags) {
      Dag &dag = workload_.dags.emplace_back(original);
      dag.name = joined(process.name, dag.name);
      dag.cluster = {};
      dag.executor = next_executor_;
      for (Task &task : dag.tasks) {
        if (!task.group.empty()) task.group = joined(process.name, task.group);
      }
      set_of_dag_.push_back(process.cpu_set);
    }
    levels_.insert(levels_.end(), order_.of_task[p].begin(), order_.of_task[p].end());
    ++next_executor_;
  }

  // Nothing synchronises the timers of a process with data of others, or with threads that execute a task.
  void set_phases() {
    std::vector<Task *> tasks;
    for (Dag &dag : workload_.dags) {
      for (Task &task : dag.tasks) tasks.push_back(&task);
    }
    const std::vector<TaskRef> refs = flatten(workload_);
    for (std::size_t p = 0; p < robot_.processes.size(); ++p) {
      const std::size_t count = robot_.processes[p].workload ? robot_.processes[p].workload->task_count() : 0;
      for (std::size_t t = 0; t < count; ++t) {
        Task &task = *tasks[first_task_[p] + t];
        const bool is_source = task.activation == Activation::Timer && task.predecessors.empty();
        if (is_source && task.phase == Phase::Common && is_of_threads(robot_, p, TaskId(t)))
          set_free(task, Phase::Unknown);
      }
    }
    for (const Link &link : robot_.links)
      set_free(*tasks[first_task_[link.to.process] + link.to.task.value], Phase::Unknown);
    // Data of events come by events, over as many links as there are.
    for (bool changed = true; changed;) {
      changed = false;
      for (const Link &link : robot_.links) {
        Task &to = *tasks[first_task_[link.to.process] + link.to.task.value];
        const Dag &dag = workload_.dags[refs[first_task_[link.from.process] + link.from.task.value].dag.value];
        const bool has_events = std::any_of(dag.tasks.begin(), dag.tasks.end(),
                                            [](const Task &task) { return task.phase == Phase::Event; });
        if (!has_events || to.phase == Phase::Event) continue;
        to.phase = Phase::Event;
        changed = true;
      }
    }
  }

  static void set_free(Task &task, Phase phase) {
    task.phase = phase;
    task.offset = 0;
  }

  // Within its process, an executor decides which jobs the kernel gets to choose from.
  void check_executor(std::size_t p) {
    const Process &process = robot_.processes[p];
    const Workload &workload = *process.workload;
    if (!workload.platform.clusters.empty()) {
      refuse(process.place, fmt::format("process '{}' has clusters of its own", process.name),
             "make each cluster a process, and its processors a CPU set");
      return;
    }
    if (!has_executor(robot_, p)) return;
    if (robot_.by_bounds) {
      check_own_order(process);
    } else if (workload.policy != robot_.policy) {
      refuse(process.place,
             fmt::format("process '{}' orders its jobs by {}, and the robot by {}", process.name,
                         to_string(workload.policy), to_string(robot_.policy)),
             fmt::format("write 'policy: {}' in the workload of the process, or change the robot's",
                         to_string(robot_.policy)));
    }
    const PreemptionMode preemption = workload.platform.preemption;
    if (preemption != PreemptionMode::Os && preemption != PreemptionMode::Auto) {
      refuse(
          process.place,
          fmt::format("process '{}' runs with preemption {}: its urgent jobs wait for its own less urgent ones, while "
                      "those wait for other processes",
                      process.name, to_string(preemption)),
          "write 'preemption: os' in its workload");
    }
    const std::size_t cpus = robot_.cpu_sets[process.cpu_set].cpus.size();
    if (process.states_workers && workload.platform.workers < cpus) {
      refuse(process.place,
             fmt::format("process '{}' has {} worker{} for {} processors: a processor can be idle while a job waits, "
                         "which no bound for all processes covers",
                         process.name, workload.platform.workers, workload.platform.workers == 1 ? "" : "s", cpus),
             fmt::format("write 'workers: {}' in its workload, or leave it out", cpus));
    }
  }

  // In an order by the bounds, a process keeps its own order of its own levels.
  void check_own_order(const Process &process) {
    const PolicyKind policy = process.workload->policy;
    if (policy == PolicyKind::RateMonotonic || policy == PolicyKind::DeadlineMonotonic || policy == PolicyKind::Fixed) {
      return;
    }
    refuse(process.place,
           fmt::format("process '{}' orders its jobs by {}, which has no levels that could have a place among those of "
                       "other processes",
                       process.name, to_string(policy)),
           "write 'policy: rate_monotonic', deadline_monotonic or fixed in its workload");
  }

  void add_threads(std::size_t t) {
    const Threads &threads = robot_.threads[t];
    if (!threads.level) return;
    if (threads.level->kind == Level::Kind::Task) {
      check_alone(threads);
      const Process &process = robot_.processes[threads.level->task.process];
      if (threads.cpus.empty() || threads.cpus == robot_.cpu_sets[process.cpu_set].cpus) return;
      refuse(threads.place,
             fmt::format("threads '{}' execute a task of process '{}', but on other processors than it has",
                         threads.name, process.name),
             "remove 'cpus:' of the threads");
      return;
    }
    if (!threads.level->interferes()) return;
    const std::optional<std::size_t> set = set_of(threads);
    if (!set) return;
    if (threads.level->kind == Level::Kind::Reservation) return add_reserved(t, *set);
    if (threads.wcet == 0) {
      refuse(threads.place, fmt::format("threads '{}' can delay tasks, and nothing says for how long", threads.name),
             "add 'wcet:' and 'period:': what one of them executes at most, and how often; or use a level below");
      return;
    }
    Task task;
    task.wcet = threads.wcet;
    task.period = task.deadline = threads.period;
    add_interference(t, *set, task, order_.of_threads[t] ? static_cast<int>(*order_.of_threads[t]) : kAbove);
  }

  // Only an executor keeps what a task shares with others.
  void check_alone(const Threads &threads) {
    const TaskOf &of = threads.level->task;
    const Workload &workload = *robot_.processes[of.process].workload;
    const TaskRef ref = flatten(workload)[of.task.value];
    const Dag &dag = workload.dags[ref.dag.value];
    const bool has_successor = std::any_of(dag.tasks.begin(), dag.tasks.end(), [&](const Task &task) {
      return std::find(task.predecessors.begin(), task.predecessors.end(), ref.index) != task.predecessors.end();
    });
    const char *shared = !ref.task->group.empty()                           ? "a group"
                         : dag.max_active > 0                               ? "a max_active"
                         : !ref.task->predecessors.empty() || has_successor ? "edges"
                                                                            : nullptr;
    if (shared == nullptr) return;
    refuse(threads.place,
           fmt::format("threads '{}' execute task '{}', which has {}: only an executor would keep to that",
                       threads.name, of.name, shared),
           "give the threads a task without that, in a DAG of its own");
  }

  // The bound for one of them assumes that it has a processor whenever the kernel lets it run.
  void add_reserved(std::size_t t, std::size_t set) {
    const Threads &threads = robot_.threads[t];
    const std::size_t reserved = reserved_[set] += threads.count;
    const std::size_t cpus = robot_.cpu_sets[set].cpus.size();
    if (reserved > cpus) {
      refuse(threads.place,
             fmt::format("{} threads have reservations, and there are {} processors: they can delay each other, which "
                         "no bound covers",
                         reserved, cpus),
             "give fewer threads a reservation");
      return;
    }
    const ReservedLoad load = load_of(threads.level->reservation);
    Task task;
    task.wcet = load.wcet;
    task.period = task.deadline = load.period;
    task.jitter = load.jitter;
    add_interference(t, set, task, kReserved);
  }

  // Adds a DAG with `count` such tasks.
  void add_interference(std::size_t t, std::size_t set, Task task, int level) {
    const Threads &threads = robot_.threads[t];
    first_of_threads_[t] = levels_.size();
    Dag &dag = workload_.dags.emplace_back();
    dag.name = joined(kThreads, threads.name);
    dag.is_foreign = true;
    dag.executor = next_executor_++;
    ++starters_;
    for (std::uint32_t i = 0; i < threads.count; ++i) {
      task.name = threads.count == 1 ? "run" : fmt::format("run_{}", i + 1);
      dag.tasks.push_back(task);
      levels_.push_back(level);
    }
    has_above_ = has_above_ || level < 0;
    set_of_dag_.push_back(set);
  }

  // Returns the CPU set where these threads run; nothing if no task runs where they do, or after a refusal.
  std::optional<std::size_t> set_of(const Threads &threads) {
    std::vector<std::size_t> met;
    for (std::size_t s = 0; s < robot_.cpu_sets.size(); ++s) {
      const std::vector<int> &cpus = robot_.cpu_sets[s].cpus;
      const bool meets = threads.cpus.empty() || std::any_of(cpus.begin(), cpus.end(), [&](int cpu) {
                           return std::binary_search(threads.cpus.begin(), threads.cpus.end(), cpu);
                         });
      if (meets) met.push_back(s);
    }
    if (met.empty()) return std::nullopt;
    const std::vector<int> &cpus = robot_.cpu_sets[met.front()].cpus;
    if (met.size() == 1 && (threads.cpus.empty() || threads.cpus == cpus)) return met.front();
    refuse(threads.place,
           fmt::format("threads '{}' can delay tasks, and their processors are not those of one CPU set", threads.name),
           threads.level->kind == Level::Kind::Reservation
               ? "a reservation is for all processors: give the robot 'cpus' instead of 'cpu_sets'"
               : "give them the 'cpus:' of one CPU set, or processors of none");
    return std::nullopt;
  }

  // One CPU set with tasks is the platform; several are its clusters.
  void set_platform() {
    std::vector<std::size_t> used = set_of_dag_;
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    Platform &platform = workload_.platform;
    platform.workers = 0;
    platform.several_executors = starters_ > 1;
    for (const std::size_t s : used) {
      const CpuSet &set = robot_.cpu_sets[s];
      const auto workers = static_cast<std::uint32_t>(set.cpus.size());
      platform.workers += workers;
      if (used.size() > 1) platform.clusters.push_back(Cluster{set.name, workers, set.cpus});
    }
    if (used.size() == 1) return;
    for (std::size_t d = 0; d < workload_.dags.size(); ++d) {
      workload_.dags[d].cluster = robot_.cpu_sets[set_of_dag_[d]].name;
    }
  }

  // The order is not that of rates or deadlines alone: states it task by task.
  void fix_priorities() {
    workload_.policy = PolicyKind::Fixed;
    std::size_t id = 0;
    for (Dag &dag : workload_.dags) {
      for (Task &task : dag.tasks) task.priority = -levels_[id++];
    }
  }

  const Robot &robot_;
  Order order_;
  Workload workload_;
  Diagnostics mistakes_;
  std::vector<std::size_t> set_of_dag_;
  std::vector<int> levels_;              // by TaskId of the union
  std::vector<std::size_t> first_task_;  // by process: the first of its tasks in the union
  std::vector<std::optional<std::size_t>> first_of_threads_;
  std::map<std::size_t, std::size_t> reserved_;  // by CPU set: threads with reservations
  std::uint32_t next_executor_ = 0;
  std::size_t starters_ = 0;  // what starts jobs without knowing of the others
  bool has_above_ = false;    // some task is above all levels of the order
};

}  // namespace

Result<United> unite(const Robot &robot, std::uint32_t levels, LoadOptions options) {
  return Union(robot, levels).run(options);
}

Result<LoadedWorkload> union_of(const Robot &robot, std::uint32_t levels, LoadOptions options) {
  Result<United> united = unite(robot, levels, options);
  if (!united) return tl::unexpected<Diagnostics>(std::move(united.error()));
  Workload &workload = united->workload;
  const Result<void> linked = set_jitter_of_links(robot, united->first_task, analysis::platform_of(workload), workload);
  if (!linked) return tl::unexpected<Diagnostics>(linked.error());
  return LoadedWorkload{std::move(workload), std::move(united->warnings), true};
}

}  // namespace redag::robot
