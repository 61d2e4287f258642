// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/union.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "redag/loader/validate.hpp"
#include "redag/sched/policy.hpp"
#include "redag/threads/setup.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/robot/reservation.hpp"

namespace redag::robot {
namespace {

// Joins the name of a process with that of a DAG or group in it.
std::string joined(const std::string &process, const std::string &name) { return process + "/" + name; }

constexpr const char *kThreads = "threads";
// The levels above those of the order.
constexpr int kAbove = -1;
constexpr int kReserved = -2;

// One order of all tasks, and of threads that have the rate of tasks. Tasks that the policy ranks equal share a level.
struct Order {
  std::vector<int> of_task;     // by TaskId of all processes, one after the other; 0 is the most urgent level
  std::vector<int> of_threads;  // by entry; meaningless without a rate
  std::uint32_t levels = 0;
};

Order order_of(const Robot &robot) {
  std::vector<sched::RankedTask> ranked;
  std::uint32_t first_dag = 0;
  for (const Process &process : robot.processes) {
    for (const TaskRef &ref : flatten(process.workload)) {
      ranked.push_back(sched::RankedTask{.period = ref.task->period,
                                         .deadline = ref.task->deadline,
                                         .priority = ref.task->priority.value_or(0),
                                         .dag = first_dag + ref.dag.value,
                                         .task = TaskId(ranked.size())});
    }
    first_dag += static_cast<std::uint32_t>(process.workload.dags.size());
  }
  const std::size_t tasks = ranked.size();
  for (const Threads &threads : robot.threads) {
    const Duration rate = threads.level.rate;
    if (threads.level.kind != Level::Kind::Rate) continue;
    ranked.push_back(
        sched::RankedTask{.period = rate, .deadline = rate, .dag = first_dag++, .task = TaskId(ranked.size())});
  }
  Order order;
  for (const sched::Priority &priority : sched::assign_priorities(ranked, robot.policy, Ties::Share)) {
    order.of_task.push_back(static_cast<int>(priority.tier));
    order.levels = std::max(order.levels, priority.tier + 1);
  }
  auto next = order.of_task.begin() + static_cast<std::ptrdiff_t>(tasks);
  for (const Threads &threads : robot.threads) {
    order.of_threads.push_back(threads.level.kind == Level::Kind::Rate ? *next++ : 0);
  }
  order.of_task.resize(tasks);
  return order;
}

class Union {
 public:
  explicit Union(const Robot &robot) : robot_(robot), order_(order_of(robot)) {
    workload_.name = robot.name;
    workload_.policy = robot.policy;
    workload_.platform.preemption = PreemptionMode::Os;
  }

  Result<LoadedWorkload> run(LoadOptions options) {
    check_levels();
    for (std::size_t p = 0; p < robot_.processes.size(); ++p) add_process(p);
    for (std::size_t t = 0; t < robot_.threads.size(); ++t) add_threads(t);
    if (!mistakes_.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes_));
    set_platform();
    set_phases();
    if (has_own_order_) fix_priorities();
    Diagnostics found = validate(workload_, options);
    if (has_errors(found)) return tl::unexpected<Diagnostics>(std::move(found));
    return LoadedWorkload{std::move(workload_), std::move(found), true};
  }

 private:
  void refuse(const Place &at, std::string message, std::string hint) {
    mistakes_.push_back(Diagnostic{Severity::Error, at.file, at.line, at.column, std::move(message), std::move(hint)});
  }

  // Executors with too few levels merge their own first, and then those of all.
  void check_levels() {
    const std::uint32_t most = runtime::band_up_to(runtime::kHighestPriority).levels();
    if (order_.levels <= most) return;
    refuse(robot_.processes.front().place,
           fmt::format("the robot has {} different rates, and executors tell {} apart", order_.levels, most),
           "give similar tasks one rate");
  }

  void add_process(std::size_t p) {
    const Process &process = robot_.processes[p];
    first_task_.push_back(levels_.size());
    check_executor(p);
    // More threads than processors: a job of the process can be started beside a more urgent one.
    const bool has_more_threads = process.workload.platform.workers > robot_.cpu_sets[process.cpu_set].cpus.size();
    starters_ += process.states_workers && has_more_threads ? 2 : 1;
    if (process.name == kThreads) {
      refuse(process.place, "the name 'threads' of a process is that of all threads in the union",
             "choose another name");
    }
    for (const Dag &original : process.workload.dags) {
      Dag &dag = workload_.dags.emplace_back(original);
      dag.name = joined(process.name, dag.name);
      dag.cluster = {};
      dag.executor = next_executor_;
      for (Task &task : dag.tasks) {
        if (!task.group.empty()) task.group = joined(process.name, task.group);
      }
      set_of_dag_.push_back(process.cpu_set);
    }
    const auto first = order_.of_task.begin() + static_cast<std::ptrdiff_t>(levels_.size());
    levels_.insert(levels_.end(), first, first + static_cast<std::ptrdiff_t>(process.workload.task_count()));
    ++next_executor_;
  }

  // Nothing synchronises the timers of a process with threads that execute a task.
  void set_phases() {
    std::vector<Task *> tasks;
    for (Dag &dag : workload_.dags) {
      for (Task &task : dag.tasks) tasks.push_back(&task);
    }
    for (std::size_t p = 0; p < robot_.processes.size(); ++p) {
      for (std::size_t t = 0; t < robot_.processes[p].workload.task_count(); ++t) {
        Task &task = *tasks[first_task_[p] + t];
        const bool is_source = task.activation == Activation::Timer && task.predecessors.empty();
        if (is_source && task.phase == Phase::Common && is_of_threads(robot_, p, TaskId(t)))
          set_free(task, Phase::Unknown);
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
    const Workload &workload = process.workload;
    if (!workload.platform.clusters.empty()) {
      refuse(process.place, fmt::format("process '{}' has clusters of its own", process.name),
             "make each cluster a process, and its processors a CPU set");
      return;
    }
    if (!has_executor(robot_, p)) return;
    if (workload.policy != robot_.policy) {
      refuse(process.place,
             fmt::format("process '{}' orders its jobs by {}, and the robot by {}", process.name,
                         to_string(workload.policy), to_string(robot_.policy)),
             fmt::format("write 'policy: {}' in the workload of the process, or change the robot's",
                         to_string(robot_.policy)));
    }
    if (robot_.policy == PolicyKind::Fixed && executors_++ > 0) {
      refuse(process.place,
             "executors with policy fixed share no order: their priorities have no meaning for each other",
             "order the robot by rate_monotonic or deadline_monotonic");
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
             fmt::format("process '{}' has {} for {} processors: a processor can be idle while a job waits, "
                         "which no bound for all processes covers",
                         process.name, plural(workload.platform.workers, "worker"), cpus),
             fmt::format("write 'workers: {}' in its workload, or leave it out", cpus));
    }
  }

  void add_threads(std::size_t t) {
    const Threads &threads = robot_.threads[t];
    Task task;
    task.wcet = threads.wcet;
    task.period = task.deadline = threads.period;
    switch (threads.level.kind) {
      case Level::Kind::Task: return check_alone(threads);
      case Level::Kind::Reservation: return add_reserved(threads);
      case Level::Kind::Above: return add_interference(threads, task, kAbove);
      case Level::Kind::Rate: break;
    }
    has_own_order_ = has_own_order_ || threads.period != threads.level.rate;
    add_interference(threads, task, order_.of_threads[t]);
  }

  // Only an executor keeps what a task shares with others.
  void check_alone(const Threads &threads) {
    const TaskOf &of = threads.level.task;
    const Workload &workload = robot_.processes[of.process].workload;
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
  void add_reserved(const Threads &threads) {
    if (robot_.cpu_sets.size() > 1) {
      refuse(
          threads.place,
          fmt::format("threads '{}' have a reservation, which the kernel gives only for all processors", threads.name),
          "give the robot 'cpus' instead of 'cpu_sets'");
      return;
    }
    reserved_ += threads.count;
    const std::size_t cpus = robot_.cpu_sets.front().cpus.size();
    if (reserved_ > cpus) {
      refuse(threads.place,
             fmt::format("{} threads have reservations, and there are {} processors: they can delay each other, which "
                         "no bound covers",
                         reserved_, cpus),
             "give fewer threads a reservation");
      return;
    }
    const ReservedLoad load = load_of(threads.level.reservation);
    Task task;
    task.wcet = load.wcet;
    task.period = task.deadline = load.period;
    task.jitter = load.jitter;
    add_interference(threads, task, kReserved);
  }

  // Adds a DAG with `count` such tasks.
  void add_interference(const Threads &threads, Task task, int level) {
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
    has_own_order_ = has_own_order_ || level < 0;
    set_of_dag_.push_back(threads.cpu_set);
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
  std::size_t reserved_ = 0;             // threads with reservations
  std::uint32_t next_executor_ = 0;
  std::size_t starters_ = 0;    // what starts jobs without knowing of the others
  std::size_t executors_ = 0;   // that have been checked, with policy fixed
  bool has_own_order_ = false;  // some task's level does not follow from its period or deadline
};

}  // namespace

Result<LoadedWorkload> union_of(const Robot &robot, LoadOptions options) { return Union(robot).run(options); }

}  // namespace redag::robot
