// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "workload_nodes.hpp"

#include <fmt/format.h>

#include <cctype>
#include <chrono>
#include <limits>
#include <map>
#include <set>
#include <thread>
#include <utility>

#include "redag/derived/demand.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/threads/clock.hpp"

namespace redag_rclcpp::lab {

using redag::Activation;
using redag::Dag;
using redag::Duration;
using redag::JobEvent;
using redag::JobEventKind;
using redag::kNever;
using redag::Task;
using redag::TaskId;
using redag::Time;

namespace {

constexpr Duration kConnectLook = 5 * redag::kMillisecond;
constexpr Duration kForgotten = 3 * redag::kSecond;  // the middleware has forgotten an earlier run by then
// The shortest absence from the processor that is recorded. Interrupts and the like are shorter.
constexpr Duration kAbsence = 50 * redag::kMicrosecond;

std::atomic<std::uint64_t> instances{0};

// Spins for about a microsecond between two clock readings: reading the thread's clock is a system call.
void spin_briefly() {
  for (int i = 0; i < 400; ++i) asm volatile("" ::: "memory");
}

// Makes a part of a ROS name: letters, digits and underscores, without a digit first.
std::string ros_token(const std::string &name) {
  std::string token;
  for (const char c : name) token += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  if (token.empty() || std::isdigit(static_cast<unsigned char>(token.front())) != 0) token.insert(0, "t");
  return token;
}

// Returns `token`, or `token` with a number behind it if it is taken.
std::string unique(const std::string &token, std::set<std::string> &taken) {
  std::string name = token;
  for (int n = 2; !taken.insert(name).second; ++n) name = fmt::format("{}_{}", token, n);
  return name;
}

rclcpp::NodeOptions node_options(bool intra_process) {
  rclcpp::NodeOptions options;
  options.use_intra_process_comms(intra_process);
  // The nodes get no callbacks but the workload's own.
  options.start_parameter_services(false).start_parameter_event_publisher(false).enable_rosout(false);
  options.use_global_arguments(false);
  options.append_parameter_override("start_type_description_service", false);
  return options;
}

redag::Diagnostic diagnostic(redag::Severity severity, std::string message, std::string hint) {
  return redag::Diagnostic{severity, {}, 0, 0, std::move(message), std::move(hint)};
}

}  // namespace

redag::Diagnostics ros_limits(const redag::Workload &workload) {
  redag::Diagnostics found;
  for (const Dag &dag : workload.dags) {
    if (dag.max_pending > 0) {
      found.push_back(diagnostic(redag::Severity::Warning, fmt::format("DAG '{}': max_pending is ignored", dag.name),
                                 "rclcpp queues as many messages as the subscriptions' depths allow"));
    }
    for (const Task &task : dag.tasks) {
      const std::string name = fmt::format("task '{}.{}'", dag.name, task.name);
      if (task.jitter > 0) {
        found.push_back(diagnostic(redag::Severity::Error, name + ": a ROS timer has no release jitter",
                                   "remove 'jitter', or use 'redag run'"));
      }
      if (task.concurrency > 1) {
        found.push_back(diagnostic(redag::Severity::Error, name + ": jobs of one task do not overlap under ROS 2",
                                   "remove 'concurrency'"));
      }
      if (task.activation == Activation::Timer && task.overrun == redag::Overrun::Queue) {
        found.push_back(diagnostic(redag::Severity::Warning, name + ": a ROS timer does not queue releases",
                                   "'overrun: queue' is treated as 'skip'"));
      }
    }
  }
  return found;
}

// A topic on which a task publishes.
struct WorkloadNodes::Output {
  std::string topic;
  std::size_t depth = 1;
  std::size_t subscriptions = 0;
  rclcpp::Publisher<Message>::SharedPtr publisher;
};

// The input of a task from one predecessor. The task's callback group guards it, like all of TaskNode.
struct WorkloadNodes::Input {
  TaskId from;
  std::uint32_t output = 0;  // position among the predecessor's outputs
  bool aligned = false;      // both are timer tasks of one period and offset: job k waits for job k
  bool fresh = false;
  std::int64_t sequence = 0;
  Time release = 0;
  Time origin = 0;
  Time finish = 0;
  rclcpp::Subscription<Message>::SharedPtr subscription;
};

struct WorkloadNodes::TaskNode {
  TaskId id;
  const Task *task = nullptr;
  std::string dag_name;   // name in ROS
  std::string task_name;  // name in ROS
  rclcpp::Node::SharedPtr node;
  rclcpp::CallbackGroup::SharedPtr group;
  std::unique_ptr<PhasedTimer> timer;
  std::uint32_t timer_index = 0;  // index among the timers of its node
  std::int64_t last_job = -1;     // timer task: number of the last expired job
  std::int64_t waiting = -1;      // timer task with predecessors: job that waits for data; -1: none
  Time consumed = -1;             // data task: end of the last predecessor of the last job
  std::int64_t completed = 0;
  std::deque<Input> inputs;
  std::uint32_t slowest = 0;  // input with the largest period; it numbers the jobs of a data task
  std::deque<Output> outputs;
  Message message;
};

struct WorkloadNodes::Job {
  std::int64_t number = 0;  // selects the execution time; the job's number for timer tasks
  Time trigger = 0;         // data tasks: end of the last predecessor
  Time release = 0;
  Time origin = 0;
};

WorkloadNodes::WorkloadNodes(const redag::Workload &workload, const NodesOptions &options)
    : workload_(workload), options_(options), instance_(++instances) {
  std::set<std::string> dag_names;
  for (const redag::Dag &dag : workload_.dags) {
    const std::string dag_name = unique(ros_token(dag.name), dag_names);
    std::set<std::string> task_names;
    const std::size_t first = tasks_.size();
    for (const Task &task : dag.tasks) {
      TaskNode &made = tasks_.emplace_back();
      made.id = TaskId(tasks_.size() - 1);
      made.task = &task;
      made.dag_name = dag_name;
      made.task_name = unique(ros_token(task.name), task_names);
      for (const std::uint32_t p : task.predecessors) {
        const Task &from = dag.tasks[p];
        Input &input = made.inputs.emplace_back();
        input.from = TaskId(first + p);
        input.aligned = task.activation == Activation::Timer && from.activation == Activation::Timer &&
                        from.period == task.period && from.offset == task.offset;
        const auto position = static_cast<std::uint32_t>(made.inputs.size() - 1);
        if (from.period > dag.tasks[task.predecessors[made.slowest]].period) made.slowest = position;
      }
    }
  }
  for (TaskNode &task : tasks_) create_node(task);
  create_topics();
  for (std::uint32_t i = 0; i < options_.threads; ++i) {
    rings_.push_back(std::make_unique<redag::trace::Ring>(options_.trace_capacity));
  }
}

WorkloadNodes::~WorkloadNodes() = default;

// Tasks of one exclusive group share a node, because a callback group belongs to one node.
void WorkloadNodes::create_node(TaskNode &task) {
  if (!task.task->group.empty()) {
    for (const TaskNode &other : tasks_) {
      if (other.node == nullptr || other.task->group != task.task->group) continue;
      task.node = other.node;
      task.group = other.group;
      return;
    }
  }
  task.node = std::make_shared<rclcpp::Node>(task.task_name, "/" + task.dag_name, node_options(options_.intra_process));
  task.group = task.node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
  nodes_.push_back(task.node);
}

// Creates a topic for each task with successors. If tasks of one node share a predecessor, each but the first gets a
// topic of its own: the executor tells callbacks of a node apart by their topics alone.
void WorkloadNodes::create_topics() {
  std::set<std::pair<const rclcpp::Node *, std::string>> subscribed;
  for (TaskNode &task : tasks_) {
    for (Input &input : task.inputs) {
      TaskNode &from = tasks_[input.from.value];
      std::string topic = fmt::format("/{}/{}/output", from.dag_name, from.task_name);
      if (!subscribed.emplace(task.node.get(), topic).second) topic += "_" + task.task_name;
      auto output = std::find_if(from.outputs.begin(), from.outputs.end(),
                                 [&](const Output &known) { return known.topic == topic; });
      if (output == from.outputs.end()) output = from.outputs.insert(output, Output{topic, 1, 0, nullptr});
      input.output = static_cast<std::uint32_t>(output - from.outputs.begin());
      if (task.task->overrun == redag::Overrun::Queue) {
        output->depth = std::max<std::size_t>(output->depth, task.task->queue_depth);
      }
      ++output->subscriptions;
    }
  }
  for (TaskNode &task : tasks_) {
    task.message.data.resize(4);
    for (Output &output : task.outputs) {
      output.publisher = task.node->create_publisher<Message>(output.topic, rclcpp::QoS(output.depth).reliable());
    }
    for (Input &input : task.inputs) {
      rclcpp::SubscriptionOptions options;
      options.callback_group = task.group;
      const bool queue = task.task->overrun == redag::Overrun::Queue;
      const rclcpp::QoS qos = rclcpp::QoS(queue ? task.task->queue_depth : 1).reliable();
      input.subscription = task.node->create_subscription<Message>(
          tasks_[input.from.value].outputs[input.output].topic, qos,
          [this, &task, &input](Message::ConstSharedPtr message) { on_message(task, input, *message); }, options);
    }
  }
}

redag::Result<void> WorkloadNodes::connect(Duration timeout) {
  const Time start = timer_clock_now();
  for (;;) {
    bool all = true;
    const Output *shared = nullptr;
    for (const TaskNode &task : tasks_) {
      for (const Output &output : task.outputs) {
        const std::size_t seen = output.publisher->get_subscription_count();
        const std::size_t publishers = task.node->count_publishers(output.topic);
        if (seen > output.subscriptions || publishers > 1) shared = &output;
        all = all && seen == output.subscriptions && publishers == 1;
      }
      for (const Input &input : task.inputs) all = all && input.subscription->get_publisher_count() == 1;
    }
    if (all) return {};
    const Duration waited = timer_clock_now() - start;
    if (shared != nullptr && waited > std::min(timeout, kForgotten)) {
      return redag::make_error(fmt::format("another process uses the topic '{}'", shared->topic),
                               "give each run a ROS_DOMAIN_ID of its own");
    }
    if (waited > timeout) {
      return redag::make_error(
          fmt::format("the nodes do not discover each other within {}", redag::format_duration(timeout)),
          "check the middleware's configuration: 'ros2 doctor --report'");
    }
    std::this_thread::sleep_for(std::chrono::nanoseconds(kConnectLook));
  }
}

// ---- timers ----

void WorkloadNodes::arm(Time origin) {
  origin_ = origin;
  std::map<const rclcpp::Node *, std::uint32_t> timers;
  for (TaskNode &task : tasks_) {
    if (task.task->activation != Activation::Timer) continue;
    task.timer_index = timers[task.node.get()]++;
    task.timer = std::make_unique<PhasedTimer>(*task.node, task.group, origin_ + task.task->offset, task.task->period,
                                               [this, &task](std::int64_t job) { on_timer(task, job); });
    phase_error_ = std::max(phase_error_, task.timer->phase_error());
  }
}

// ---- bodies ----

void WorkloadNodes::on_timer(TaskNode &task, std::int64_t job) {
  if (halting_.load(std::memory_order_relaxed)) return;
  job = std::max(job, task.last_job + 1);  // a call may come before its point, within the phase error
  task.last_job = job;
  if (task.inputs.empty()) {
    const Time release = task.task->offset + job * task.task->period;
    execute(task, Job{job, 0, release, release});
  } else {
    task.waiting = job;
    run_if_complete(task);
  }
}

void WorkloadNodes::on_message(TaskNode &task, Input &input, const Message &message) {
  if (halting_.load(std::memory_order_relaxed) || message.data.size() != 4) return;
  // Ignores data completed before the release of the last job, which consumed all data up to then (docs/model.md,
  // "Release").
  if (message.data[3] <= task.consumed) return;
  input.fresh = true;
  input.sequence = message.data[0];
  input.release = message.data[1];
  input.origin = message.data[2];
  input.finish = message.data[3];
  run_if_complete(task);
}

void WorkloadNodes::run_if_complete(TaskNode &task) {
  const bool timed = task.task->activation == Activation::Timer;
  if (timed && task.waiting < 0) return;
  Job job;
  job.number = timed ? task.waiting : task.inputs[task.slowest].sequence;
  job.release = timed ? task.task->offset + job.number * task.task->period : 0;
  job.origin = timed ? job.release : kNever;
  for (const Input &input : task.inputs) {
    if (!input.fresh || (input.aligned && input.release < job.release)) return;
    job.trigger = std::max(job.trigger, input.finish);
    job.origin = std::min(job.origin, input.origin);
  }
  for (Input &input : task.inputs) input.fresh = false;
  task.waiting = -1;
  if (!timed) {
    job.release = job.trigger;
    task.consumed = job.trigger;
  }
  execute(task, job);
}

void WorkloadNodes::execute(TaskNode &task, const Job &job) {
  running_.fetch_add(1);
  if (const Time begin = now(); !halting_.load() && begin < options_.end) {
    std::uint32_t thread = 0;
    redag::trace::Ring *const events = ring(thread);
    const auto number = static_cast<std::uint32_t>(job.number);
    const JobEvent started{begin, job.trigger, task.id, number, thread, JobEventKind::Started};
    record(started, events);
    const Duration demand = redag::execution_time(*task.task, task.id, number, options_.seed);
    const bool cut_off =
        task.task->on_budget == redag::OnBudget::Abort && task.task->budget > 0 && demand > task.task->budget;
    use_processor(cut_off ? task.task->budget : demand, task.task->region, started, events);
    const Time finish = now();
    record({finish, finish, task.id, number, thread, cut_off ? JobEventKind::Aborted : JobEventKind::Finished,
            cut_off ? redag::Reason::Budget : redag::Reason::None},
           events);
    if (!cut_off) publish(task, job, finish);
  }
  running_.fetch_sub(1);
}

void WorkloadNodes::publish(TaskNode &task, const Job &job, Time finish) {
  const auto fill = [&](Message &message) {
    message.data[0] = task.completed;
    message.data[1] = job.release;
    message.data[2] = job.origin;
    message.data[3] = finish;
  };
  for (const Output &output : task.outputs) {
    if (options_.intra_process) {
      auto message = std::make_unique<Message>();
      message->data.resize(4);
      fill(*message);
      output.publisher->publish(std::move(message));
    } else {
      fill(task.message);
      output.publisher->publish(task.message);
    }
  }
  ++task.completed;
}

// Uses `demand` of the body's own processor time: being preempted does not shorten its work.
void WorkloadNodes::use_processor(Duration demand, Duration region, JobEvent job, redag::trace::Ring *events) {
  const auto used = [this] { return options_.redag ? redag::job_cpu_time() : redag::runtime::thread_cpu_now(); };
  const Duration begin = used();
  Duration next_point = region > 0 ? region : kNever;
  const Time begun = job.time;
  Time seen = begun;
  for (Duration so_far = 0; so_far < demand;) {
    if (give_up_.load(std::memory_order_relaxed)) return;
    if (options_.redag && so_far >= next_point) {
      redag::preemption_point();
      next_point += region;
    }
    spin_briefly();
    const Time time = notes_absences_ ? now() : seen;
    const Duration before = std::exchange(so_far, used() - begin);
    // The time that passed and that the body did not use belonged to others.
    const Duration absent = time - seen - (so_far - before);
    if (absent >= kAbsence) {
      job.value = 0;
      job.time = std::max(seen, begun + 1);  // strictly after Started
      job.kind = JobEventKind::Preempted;
      record(job, events);
      job.time = seen + absent;
      job.kind = JobEventKind::Resumed;
      record(job, events);
    }
    seen = time;
  }
}

// ---- records ----

redag::trace::Ring *WorkloadNodes::ring(std::uint32_t &thread) noexcept {
  struct Seat {
    std::uint64_t instance = 0;
    std::uint32_t thread = 0;
  };
  static thread_local Seat seat;
  if (seat.instance != instance_) seat = Seat{instance_, next_thread_.fetch_add(1)};
  thread = seat.thread;
  return thread < rings_.size() ? rings_[thread].get() : nullptr;
}

void WorkloadNodes::record(const JobEvent &event, redag::trace::Ring *ring) noexcept {
  if (ring == nullptr) {
    lost_.fetch_add(1, std::memory_order_relaxed);
  } else {
    ring->push(event);
  }
}

void WorkloadNodes::drain(std::vector<JobEvent> &events) {
  for (const auto &ring : rings_) ring->drain(events);
}

std::uint64_t WorkloadNodes::lost_events() const {
  std::uint64_t lost = lost_.load();
  for (const auto &ring : rings_) lost += ring->dropped();
  return lost;
}

bool WorkloadNodes::wait_idle(Time deadline) const {
  while (running_.load() > 0) {
    if (timer_clock_now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

Duration WorkloadNodes::measurement_cost() {
  constexpr int kRounds = 2000;
  redag::trace::Ring scratch(2 * kRounds);
  const PhasedTimer *timer = nullptr;
  for (const TaskNode &task : tasks_) {
    if (task.timer != nullptr) timer = task.timer.get();
  }
  const Time begin = timer_clock_now();
  for (int i = 0; i < kRounds; ++i) {
    running_.fetch_add(1);
    if (timer != nullptr) timer->repeat_numbering();
    for (const JobEventKind kind : {JobEventKind::Started, JobEventKind::Finished}) {
      record({now(), 0, TaskId(0), static_cast<std::uint32_t>(i), 0, kind}, &scratch);
    }
    running_.fetch_sub(1);
  }
  return (timer_clock_now() - begin) / kRounds;
}

// ---- the executor's workload ----

// Binds every callback to a task, because the executor executes one callback per task. A task here has one callback per
// predecessor, and perhaps a timer; its job can run in each of them. The further callbacks become tasks of their own,
// as urgent as the first.
redag::Workload WorkloadNodes::bound_workload() const {
  redag::Workload bound = workload_;
  std::size_t next = 0;
  for (Dag &dag : bound.dags) {
    std::vector<Task> more;
    for (Task &task : dag.tasks) {
      const TaskNode &node = tasks_[next++];
      task.budget = 0;  // the body enforces the budget
      task.on_budget = redag::OnBudget::Abort;
      const auto bind = [&](redag::Callback::Kind kind) -> redag::Callback & {
        Task *to = &task;
        if (task.callback) {
          to = &more.emplace_back(task);
          to->name += fmt::format(" ({})", more.size() + 1);
          to->activation = Activation::Timer;
          to->predecessors.clear();
        }
        to->callback = redag::Callback{node.node->get_fully_qualified_name(), kind, {}, 0, std::nullopt};
        return *to->callback;
      };
      task.callback.reset();
      if (task.activation == Activation::Timer) bind(redag::Callback::Kind::Timer).index = node.timer_index;
      for (const Input &input : node.inputs) {
        bind(redag::Callback::Kind::Subscription).name = input.subscription->get_topic_name();
      }
    }
    dag.tasks.insert(dag.tasks.end(), more.begin(), more.end());
  }
  return bound;
}

}  // namespace redag_rclcpp::lab
