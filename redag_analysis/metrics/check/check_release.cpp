// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/check/check_release.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "redag/base/int128.hpp"
#include "redag_analysis/executors/executors.hpp"

namespace redag::metrics {
namespace {

bool is_aligned(const Task &from, const Task &to) {
  return from.activation == Activation::Timer && to.activation == Activation::Timer && from.period == to.period &&
         from.offset == to.offset;
}

std::string expected_and_got(const char *what, std::int64_t expected, std::int64_t got) {
  return std::string(what) + " is " + format_duration(got) + "; expected " + format_duration(expected);
}

}  // namespace

ReleaseRules::ReleaseRules(CheckContext &context) : context_(context) {
  const Workload &workload = context.info.workload;
  const executors::ExecutorKind *kind = executors::find_executor(context.info.executor);
  const bool keeps_timers = kind != nullptr && kind->keeps_releases;
  tasks_.resize(workload.task_count());
  removed_.resize(workload.dags.size(), false);
  removed_at_.resize(workload.dags.size(), kNever);
  for (const trace::Removal &removal : context.info.removals) {
    Time &at = removed_at_[context.replay.dag_of(removal.task).value];
    at = std::min(at, removal.at);
  }
  std::size_t first = 0;
  for (const Dag &dag : workload.dags) {
    for (std::size_t i = 0; i < dag.tasks.size(); ++i) {
      TaskState &task = tasks_[first + i];
      task.timer = dag.tasks[i].activation == Activation::Timer;
      const bool keeps = task.timer && keeps_timers;
      task.overrun = keeps ? Overrun::Queue : dag.tasks[i].overrun;
      task.queue_depth = keeps ? std::numeric_limits<std::uint32_t>::max() : dag.tasks[i].queue_depth;
      for (const std::uint32_t p : dag.tasks[i].predecessors) {
        const auto edge = static_cast<std::uint32_t>(edges_.size());
        tasks_[first + i].in.push_back(edge);
        tasks_[first + p].out.push_back(edge);
        edges_.push_back(Edge{TaskId(first + p), TaskId(first + i), is_aligned(dag.tasks[p], dag.tasks[i])});
      }
    }
    first += dag.tasks.size();
  }
  for (const trace::Edge &edge : context.info.edges) {
    const auto link = static_cast<std::uint32_t>(links_.size());
    tasks_[edge.to.value].links_in.push_back(link);
    tasks_[edge.from.value].links_out.push_back(link);
    const std::optional<Callback> &callback = context.replay.task(edge.to).callback;
    links_.push_back({.edge = edge, .gives_back = callback && callback->kind == Callback::Kind::Timer});
  }
  for (const TaskId task : context.info.event_tasks) tasks_[task.value].on_grid = false;
}

void ReleaseRules::before(const JobEvent &event) {
  const LiveJob *job = context_.replay.find(event.task, event.job);
  switch (event.kind) {
    case JobEventKind::Released: released(event); break;
    case JobEventKind::Ready:
      if (job != nullptr) ready(event, *job);
      break;
    case JobEventKind::Skipped: skipped(event, job); break;
    case JobEventKind::Exceeded: exceeded(event); break;
    case JobEventKind::HighMode: mode_begins(); break;
    case JobEventKind::LowMode: mode_ends(); break;
    case JobEventKind::Finished:
      if (job != nullptr) finished(event, *job);
      break;
    default: break;
  }
  just_released_ = ExpectedSkip{};
  if (event.kind == JobEventKind::Released) just_released_ = ExpectedSkip{event.task, event.job, Reason::None};
}

void ReleaseRules::released(const JobEvent &event) {
  TaskState &task = tasks_[event.task.value];
  const std::uint32_t expected = task.next_number;
  context_.expect(Rule::Life, event.job == expected, event.task, event.job,
                  [&] { return "the task's next job has number " + std::to_string(expected); });
  task.next_number = event.job + 1;
  touch(event.task);
  expect_skips(event);
  task.timer ? check_grid(event) : check_data_release(event);
}

void ReleaseRules::check_grid(const JobEvent &event) {
  const Task &task = context_.replay.task(event.task);
  // Int128 holds the result for any number that a damaged trace can contain.
  const Int128 exact_nominal = Int128{context_.info.start} + task.offset + Int128{event.job} * task.period;
  const Time nominal = static_cast<Time>(std::min(exact_nominal, Int128{kNever}));
  context_.expect(Rule::Grid, event.value == nominal || !tasks_[event.task.value].on_grid, event.task, event.job,
                  [&] { return expected_and_got("its release", nominal, event.value); });
  // Only the simulator keeps to the given jitter; a real timer can be late by any time.
  const bool exact = context_.info.driver == trace::Driver::Simulator;
  const bool in_time = event.time >= event.value && (!exact || event.time <= event.value + task.jitter);
  context_.expect(Rule::Grid, in_time, event.task, event.job, [&] {
    return "it was released at " + format_duration(event.time) + " for the grid point " + format_duration(event.value) +
           ", which is outside its jitter of " + format_duration(task.jitter);
  });
}

void ReleaseRules::check_data_release(const JobEvent &event) {
  TaskState &task = tasks_[event.task.value];
  const TaskId absent = missing(task, event.value);
  context_.expect(Rule::Precedence, !absent.valid(), event.task, event.job, [&] {
    return "it was released although " + trace::task_name(context_.info.workload, absent) +
           " has not completed since the task's last release";
  });
  Time finish = std::numeric_limits<Time>::min();  // a merged run can begin before 0
  Time decided = finish;
  for (const std::uint32_t edge : task.in) {
    finish = std::max(finish, edges_[edge].finish);
    decided = std::max(decided, edges_[edge].finish_decided);
  }
  context_.expect(Rule::Precedence, event.value == finish || event.value == decided, event.task, event.job, [&] {
    return expected_and_got("its release", finish, event.value) + ", when its last predecessor finished";
  });
  task.data_origin = consume(task);
}

// Applies the rules of docs/model.md, "Overrun and admission", in their order. The skips must follow within the
// instant.
void ReleaseRules::expect_skips(const JobEvent &event) {
  if (const Reason reason = refusal(event); reason != Reason::None) {
    expected_skips_.push_back(ExpectedSkip{event.task, event.job, reason});
    return;
  }
  const TaskState &task = tasks_[event.task.value];
  const DagId dag_id = context_.replay.dag_of(event.task);
  const Dag &dag = context_.info.workload.dags[dag_id.value];
  std::uint32_t pending = context_.replay.pending(dag_id);
  std::uint32_t ready_jobs = 0;
  for (const LiveJob &job : context_.replay.jobs_of(event.task)) {
    if (job.state == LiveJob::State::Waiting) {
      expected_skips_.push_back(ExpectedSkip{event.task, job.number, Reason::Precedence});
      --pending;
    } else if (job.state == LiveJob::State::Ready && task.overrun == Overrun::Skip) {
      expected_skips_.push_back(ExpectedSkip{event.task, job.number, Reason::Overrun});
      --pending;
    } else if (job.state == LiveJob::State::Ready) {
      ++ready_jobs;
    }
  }
  if (task.overrun == Overrun::Queue && ready_jobs >= task.queue_depth) {
    expected_skips_.push_back(ExpectedSkip{event.task, event.job, Reason::QueueFull});
  } else if (dag.max_pending > 0 && pending >= dag.max_pending) {
    expected_skips_.push_back(ExpectedSkip{event.task, event.job, Reason::DagFull});
  }
}

// Returns the reason for which this release is refused regardless of the task's other jobs; None if it is taken.
Reason ReleaseRules::refusal(const JobEvent &event) {
  TaskState &task = tasks_[event.task.value];
  Refusals &refusals = task.refusals;
  if (refusals.skips_next) {
    refusals.skips_next = false;
    return Reason::Budget;
  }
  const Replay &replay = context_.replay;
  if (!replay.high_mode() || !replay.is_degradable(event.task)) return Reason::None;
  const Degrade &degrade = context_.info.workload.dags[replay.dag_of(event.task).value].degrade;
  if (degrade.kind == Degrade::Kind::Stop) return Reason::Degraded;
  if (!task.timer) return Reason::None;  // its predecessors are held back
  if (!is_let_through(event)) return Reason::Degraded;
  refusals.let_through = event.value;
  return Reason::None;
}

// Tasks of a DAG that have edges decide together if their releases are on one grid; each other task decides alone.
bool ReleaseRules::is_let_through(const JobEvent &event) const {
  const Replay &replay = context_.replay;
  const Task &task = replay.task(event.task);
  const auto has_edges = [this](const TaskState &state) { return !state.in.empty() || !state.out.empty(); };
  Time newest = tasks_[event.task.value].refusals.let_through;
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const Task &other = replay.task(TaskId(t));
    if (replay.dag_of(TaskId(t)) != replay.dag_of(event.task) || !tasks_[t].timer) continue;
    if (other.period != task.period || other.offset != task.offset) continue;
    if (!has_edges(tasks_[t]) || !has_edges(tasks_[event.task.value])) continue;
    newest = std::max(newest, tasks_[t].refusals.let_through);
  }
  if (newest == std::numeric_limits<Time>::min()) return true;
  const Degrade &degrade = context_.info.workload.dags[replay.dag_of(event.task).value].degrade;
  const bool skips = degrade.kind == Degrade::Kind::Skip;
  const Int128 period = task.period;
  const Int128 passed = Int128{event.value} - newest;
  if (passed <= 0) {
    const Int128 every = skips ? Int128{degrade.skip} + 1 : static_cast<Int128>(std::ceil(degrade.stretch));
    return -passed % (every * period) == 0;
  }
  if (skips) return 2 * passed > (2 * Int128{degrade.skip} + 1) * period;
  return passed >= static_cast<Int128>(std::ceil(degrade.stretch * static_cast<double>(task.period)));
}

void ReleaseRules::exceeded(const JobEvent &event) {
  if (context_.replay.task(event.task).on_budget != OnBudget::SkipNext) return;
  if (!is_removed(event.task)) tasks_[event.task.value].refusals.skips_next = true;
}

// Jobs of DAGs of lower criticality that have not started are to be skipped.
void ReleaseRules::mode_begins() {
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const TaskId id(t);
    if (!context_.replay.is_degradable(id)) continue;
    tasks_[t].refusals.let_through = std::numeric_limits<Time>::min();
    for (const LiveJob &job : context_.replay.jobs_of(id)) {
      if (!job.started()) expected_skips_.push_back(ExpectedSkip{id, job.number, Reason::Degraded});
    }
  }
}

// The degraded DAGs begin afresh: jobs that wait for data are to be skipped, and earlier data is discarded.
void ReleaseRules::mode_ends() {
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const TaskId id(t);
    if (!context_.replay.is_degradable(id)) continue;
    for (const LiveJob &job : context_.replay.jobs_of(id)) {
      expected_skips_.push_back(ExpectedSkip{id, job.number, Reason::Degraded});
    }
    for (const std::uint32_t edge : tasks_[t].in) edges_[edge].fresh = false;
  }
}

void ReleaseRules::ready(const JobEvent &event, const LiveJob &job) {
  TaskState &task = tasks_[event.task.value];
  const bool refused = std::any_of(expected_skips_.begin(), expected_skips_.end(), [&](const ExpectedSkip &skip) {
    return skip.task == event.task && skip.number == event.job;
  });
  context_.expect(Rule::Admission, !refused, event.task, event.job,
                  [] { return std::string("it became ready although it had to be skipped"); });
  follow_links(event);
  Time origin = job.release;
  if (!task.timer) {
    origin = task.data_origin;
  } else if (!task.in.empty()) {
    const TaskId absent = missing(task, job.release);
    context_.expect(Rule::Precedence, !absent.valid(), event.task, event.job, [&] {
      return "it became ready although " + trace::task_name(context_.info.workload, absent) +
             " has no fresh data for it";
    });
    origin = consume(task);
  }
  // Of a ROS 2 callback, this process knows when the data began its way.
  const bool may_be_older = task.timer && task.in.empty() && context_.replay.task(event.task).callback.has_value();
  const bool as_expected = may_be_older ? event.value <= origin : event.value == origin;
  context_.expect(Rule::Precedence, as_expected || !task.links_in.empty(), event.task, event.job,
                  [&] { return expected_and_got("its origin", origin, event.value); });
}

// A callback's job becomes ready: its predecessors must have completed since the last one did.
void ReleaseRules::follow_links(const JobEvent &event) {
  for (const std::uint32_t index : tasks_[event.task.value].links_in) {
    Link &link = links_[index];
    const bool holds = link.edge.since <= event.time && event.time < link.edge.until;
    context_.expect(Rule::Precedence, link.fresh || !holds, event.task, event.job, [&] {
      return "it became ready although " + trace::task_name(context_.info.workload, link.edge.from) +
             " has not completed since its last job became ready";
    });
    link.fresh = false;
  }
}

// True for a release that the driver skips itself, regardless of the task's other jobs. The reason is `overrun` for a
// period slept through and `queue_full` for an overwritten message. The model itself skips no job as `overrun` right
// after its own release.
bool ReleaseRules::is_miss(const JobEvent &event) const {
  if (context_.info.driver == trace::Driver::Simulator) return false;
  if (event.task != just_released_.task || event.job != just_released_.number) return false;
  if (event.reason == Reason::Overrun) return true;
  return event.reason == Reason::QueueFull &&
         std::none_of(expected_skips_.begin(), expected_skips_.end(), [&](const ExpectedSkip &skip) {
           return skip.task == event.task && skip.number == event.job && skip.reason == Reason::QueueFull;
         });
}

void ReleaseRules::skipped(const JobEvent &event, const LiveJob *job) {
  if (event.reason == Reason::Removed) removed_[context_.replay.dag_of(event.task).value] = true;
  TaskState &task = tasks_[event.task.value];
  if (job != nullptr && job->state == LiveJob::State::Ready && task.timer) {
    // No job used its data.
    for (const std::uint32_t edge : task.in) edges_[edge].fresh = true;
    for (const std::uint32_t link : task.links_in) links_[link].fresh = links_[link].fresh || links_[link].gives_back;
    touch(event.task);
  }
  if (event.reason == Reason::Removed) return;
  if (is_miss(event)) {
    std::erase_if(expected_skips_, [&](const ExpectedSkip &skip) { return skip.task == event.task; });
    return;
  }
  const auto expected = std::find_if(expected_skips_.begin(), expected_skips_.end(), [&](const ExpectedSkip &skip) {
    return skip.task == event.task && skip.number == event.job;
  });
  context_.expect(Rule::Admission, expected != expected_skips_.end(), event.task, event.job,
                  [&] { return std::string("it was skipped (") + to_string(event.reason) + ") without a cause"; });
  if (expected == expected_skips_.end()) return;
  const Reason reason = expected->reason;
  context_.expect(Rule::Admission, event.reason == reason, event.task, event.job, [&] {
    return std::string("it was skipped as ") + to_string(event.reason) + ", but the reason is " + to_string(reason);
  });
  expected_skips_.erase(expected);
}

void ReleaseRules::finished(const JobEvent &event, const LiveJob &job) {
  for (const std::uint32_t index : tasks_[event.task.value].out) {
    Edge &edge = edges_[index];
    edge.fresh = true;
    if (job.release >= edge.release) {  // an older job that ends late does not replace newer data
      edge.release = job.release;
      edge.origin = job.origin;
    }
    edge.finish = event.value;
    edge.finish_decided = event.time;
    touch(edge.to);
  }
  for (const std::uint32_t link : tasks_[event.task.value].links_out) links_[link].fresh = true;
}

void ReleaseRules::end_of_instant() {
  for (const ExpectedSkip &skip : expected_skips_) {
    context_.expect(Rule::Admission, false, skip.task, skip.number,
                    [&] { return std::string("it was not skipped (") + to_string(skip.reason) + ")"; });
  }
  expected_skips_.clear();
  for (const TaskId id : touched_) {
    tasks_[id.value].touched = false;
    if (!is_removed(id)) check_nothing_is_owed(id);
  }
  touched_.clear();
}

// A data job that could be released, or a waiting job that could be ready, must be so in the same instant.
void ReleaseRules::check_nothing_is_owed(TaskId id) {
  TaskState &task = tasks_[id.value];
  if (!task.timer) {
    const bool owed = !missing(task, 0).valid();
    context_.expect(Rule::Precedence, !owed, id, task.next_number,
                    [] { return std::string("it was not released although every predecessor has completed"); });
    if (owed) consume(task);
  }
  for (const LiveJob &job : context_.replay.jobs_of(id)) {
    if (job.state != LiveJob::State::Waiting || !task.links_in.empty()) continue;
    const bool owed = !task.timer || !missing(task, job.release).valid();
    context_.expect(Rule::Precedence, !owed, id, job.number,
                    [] { return std::string("it did not become ready although every predecessor has fresh data"); });
  }
}

void ReleaseRules::end_of_trace() {
  if (context_.info.driver != trace::Driver::Simulator) return;
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const TaskId id(t);
    if (!tasks_[t].timer || !tasks_[t].on_grid || is_removed(id)) continue;
    const Task &task = context_.replay.task(id);
    const std::uint32_t next = tasks_[t].next_number;
    const Int128 due = Int128{context_.info.start} + task.offset + Int128{next} * task.period;
    context_.expect(Rule::Grid, due + task.jitter >= context_.info.end, id, next,
                    [&] { return "it was never released, but was due at " + format_duration(static_cast<Time>(due)); });
  }
}

void ReleaseRules::touch(TaskId id) {
  if (tasks_[id.value].touched) return;
  tasks_[id.value].touched = true;
  touched_.push_back(id);
}

TaskId ReleaseRules::missing(const TaskState &task, Time release) const {
  for (const std::uint32_t edge : task.in) {
    if (!is_fresh(edges_[edge], release)) return edges_[edge].from;
  }
  return TaskId::none();
}

Time ReleaseRules::consume(const TaskState &task) {
  Time origin = kNever;
  for (const std::uint32_t edge : task.in) {
    edges_[edge].fresh = false;
    origin = std::min(origin, edges_[edge].origin);
  }
  return origin;
}

}  // namespace redag::metrics
