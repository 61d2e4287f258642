// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/reference_scheduler.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "redag/base/check.hpp"
#include "redag/sched/policy.hpp"

namespace redag::testing {

using sched::Accounting;
using sched::Dispatch;
using sched::Outcome;
using sched::Preemption;
using sched::Step;

ReferenceScheduler::ReferenceScheduler(const Workload &workload, const sched::Config &config)
    : config_(config), devices_(workload.platform.devices), workers_(config.workers) {
  for (const Dag &dag : workload.dags) add_tasks(dag);
  rank_tasks();
}

// ---- tasks and their order ------------------------------------------------------------------------------------------

void ReferenceScheduler::add_tasks(const Dag &dag) {
  const std::size_t first = tasks_.size();
  const std::vector<std::uint32_t> topological = topological_ranks(dag);
  dags_.push_back(DagState{dag, {}, false});
  for (std::size_t i = 0; i < dag.tasks.size(); ++i) {
    TaskState state;
    state.task = dag.tasks[i];
    state.dag = dags_.size() - 1;
    state.topological = topological[i];
    for (const std::uint32_t p : dag.tasks[i].predecessors) state.predecessors.push_back(first + p);
    for (const Task &other : dag.tasks) {
      const auto &of = other.predecessors;
      if (!state.predecessors.empty() || std::find(of.begin(), of.end(), i) != of.end()) state.has_edges = true;
    }
    state.inputs.resize(state.predecessors.size());
    dags_.back().tasks.emplace_back(tasks_.size());
    tasks_.push_back(state);
  }
}

Duration ReferenceScheduler::shortest_period(std::size_t dag) const {
  Duration shortest = kNever;
  for (const TaskState &state : tasks_) {
    if (state.dag == dag && !state.gone) shortest = std::min(shortest, state.task.period);
  }
  return shortest;
}

// The table of docs/model.md, "Priority".
bool ReferenceScheduler::more_urgent(const TaskState &a, const TaskState &b) const {
  const Criticality criticality_a = dags_[a.dag].dag.criticality;
  const Criticality criticality_b = dags_[b.dag].dag.criticality;
  switch (config_.policy) {
    case PolicyKind::RateMonotonic: return a.task.period < b.task.period;
    case PolicyKind::DeadlineMonotonic: return a.task.deadline < b.task.deadline;
    case PolicyKind::Fixed: return a.task.priority.value_or(0) > b.task.priority.value_or(0);
    case PolicyKind::ChainAware:
      if (criticality_a != criticality_b) return criticality_a > criticality_b;
      if (shortest_period(a.dag) != shortest_period(b.dag)) return shortest_period(a.dag) < shortest_period(b.dag);
      if (a.dag != b.dag) return a.dag < b.dag;
      return a.topological > b.topological;
    case PolicyKind::Edf:
    case PolicyKind::Fifo: break;
  }
  return false;
}

// The table with its ties. TaskId is last: `tasks_` is in that order.
bool ReferenceScheduler::task_before(const TaskState &a, const TaskState &b) const {
  if (more_urgent(a, b) || more_urgent(b, a)) return more_urgent(a, b);
  return std::tuple(a.dag, a.topological, &a - tasks_.data()) < std::tuple(b.dag, b.topological, &b - tasks_.data());
}

void ReferenceScheduler::forget_what_is_gone() {
  for (std::size_t task = 0; task < tasks_.size(); ++task) {
    TaskState &state = tasks_[task];
    if (!state.removed || state.gone) continue;
    bool used = false;
    for (std::size_t job = 0; job < jobs_.size(); ++job) {
      if (jobs_[job].state != State::Done) used = used || jobs_[job].task == task || effective(job).task == task;
    }
    state.gone = !used;
    if (state.gone) std::erase(dags_[state.dag].tasks, TaskId(task));
  }
}

void ReferenceScheduler::rank_tasks() {
  std::vector<sched::RankedTask> ranked;
  for (std::size_t i = 0; i < tasks_.size(); ++i) {
    const TaskState &state = tasks_[i];
    if (state.gone) continue;
    ranked.push_back({state.task.period, state.task.deadline, state.task.priority.value_or(0),
                      dags_[state.dag].dag.criticality, shortest_period(state.dag),
                      static_cast<std::uint32_t>(state.dag), state.topological, TaskId(i)});
  }
  const auto priorities = sched::assign_priorities(ranked, config_.policy, config_.ties, config_.levels);
  for (std::size_t i = 0; i < ranked.size(); ++i) tasks_[ranked[i].task.value].level = priorities[i].level;
  for (TaskState &state : tasks_) {
    state.rank = state.tier = 0;
    for (const TaskState &other : tasks_) {
      if (other.gone) continue;
      if (task_before(other, state)) ++state.rank;
      if (more_urgent(other, state)) ++state.tier;
    }
    if (config_.ties == Ties::Fixed) state.tier = state.rank;
  }
  // An inheritance that is no higher than the job's own priority is over.
  for (Job &job : jobs_) {
    if (job.heir_of == kNone) continue;
    if (!is_of_higher_priority(own_standing(jobs_[job.heir_of]), own_standing(job))) job.heir_of = kNone;
  }
}

bool ReferenceScheduler::same_phase(const TaskState &predecessor, const TaskState &successor) const {
  return predecessor.task.activation == Activation::Timer && successor.task.activation == Activation::Timer &&
         predecessor.task.period == successor.task.period && predecessor.task.offset == successor.task.offset;
}

// ---- releases and completions ---------------------------------------------------------------------------------------

void ReferenceScheduler::release(TaskId task, Time nominal, Time now, Time origin) {
  TaskState &state = tasks_[task.value];
  REDAG_CHECK(state.task.activation == Activation::Timer, "data tasks are released by their predecessors");
  if (state.removed || closed_) return;
  create_job(task.value, nominal, origin, now, {});
}

void ReferenceScheduler::miss(TaskId task, Time nominal, Time now, Reason reason) {
  if (tasks_[task.value].removed || closed_) return;
  const Reason refused = refusal(task.value, nominal);
  skip(new_job(task.value, nominal, now), now, refused == Reason::None ? reason : refused);
}

std::size_t ReferenceScheduler::new_job(std::size_t task, Time release, Time now) {
  TaskState &state = tasks_[task];
  const std::size_t job = jobs_.size();
  jobs_.emplace_back();
  jobs_[job].task = task;
  jobs_[job].number = state.next_number++;
  jobs_[job].release = release;
  jobs_[job].deadline = release + state.task.deadline;
  ++state.count.released;
  emit(JobEventKind::Released, job, now, release, WorkerId::kNoneValue);
  return job;
}

// Applies "Overrun and admission" to timer and data tasks alike.
void ReferenceScheduler::create_job(std::size_t task, Time release, Time origin, Time now,
                                    const std::vector<Data> &consumed) {
  TaskState &state = tasks_[task];
  const std::size_t job = new_job(task, release, now);
  if (const Reason reason = refusal(task, release); reason != Reason::None) {
    skip(job, now, reason);
    return;
  }
  jobs_[job].consumed = consumed;
  jobs_[job].origin = origin;
  for (const Data &data : consumed) jobs_[job].origin = std::min(jobs_[job].origin, data.origin);
  // "Ties": the job has the turn of the job that it replaces, and none before that of an earlier job of its task.
  jobs_[job].turn = jobs_[job].origin;
  for (const std::size_t other : jobs_of(task, State::Ready)) {
    const bool takes_its_place = state.task.overrun == Overrun::Skip;
    jobs_[job].turn = takes_its_place ? jobs_[other].turn : std::max(jobs_[job].turn, jobs_[other].turn);
  }
  for (const std::size_t other : jobs_of(task, State::Waiting)) {
    if (other != job) jobs_[job].turn = jobs_[other].turn;
  }
  for (const std::size_t other : jobs_of(task, State::Waiting)) {
    if (other != job) skip(other, now, Reason::Precedence);
  }
  if (state.task.overrun == Overrun::Skip) {
    for (const std::size_t other : jobs_of(task, State::Ready)) skip(other, now, Reason::Overrun);
  }
  if (state.task.overrun == Overrun::Queue && jobs_of(task, State::Ready).size() >= state.task.queue_depth) {
    skip(job, now, Reason::QueueFull);
    return;
  }
  std::size_t pending = 0;
  for (const Job &other : jobs_) {
    const bool waits = other.state == State::Waiting || other.state == State::Ready;
    if (waits && tasks_[other.task].dag == state.dag && &other != &jobs_[job]) ++pending;
  }
  const std::uint32_t bound = dags_[state.dag].dag.max_pending;
  if (bound != 0 && pending >= bound) {
    skip(job, now, Reason::DagFull);
    return;
  }
  resolve(job, now);
}

// "Readiness": makes a waiting job ready if it can be.
void ReferenceScheduler::resolve(std::size_t job, Time now) {
  Job &j = jobs_[job];
  TaskState &state = tasks_[j.task];
  if (state.task.activation == Activation::Timer) {
    for (std::size_t i = 0; i < state.inputs.size(); ++i) {
      const Data &input = state.inputs[i];
      // "Job k waits for job k."
      const bool other_period = same_phase(tasks_[state.predecessors[i]], state) && input.release != j.release;
      if (!input.fresh || other_period) return;
    }
    j.consumed = state.inputs;
    for (Data &input : state.inputs) input.fresh = false;
    if (!j.consumed.empty()) j.origin = kNever;
    for (const Data &data : j.consumed) j.origin = std::min(j.origin, data.origin);
  }
  j.state = State::Ready;
  j.ready_order = ready_count_++;
  emit(JobEventKind::Ready, job, now, j.origin, WorkerId::kNoneValue);
}

void ReferenceScheduler::skip(std::size_t job, Time now, Reason reason) {
  Job &j = jobs_[job];
  TaskState &state = tasks_[j.task];
  if (j.state == State::Ready && state.task.activation == Activation::Timer) {
    // No job used the data: they, or newer data, are fresh again.
    for (Data &input : state.inputs) input.fresh = true;
  }
  j.state = State::Done;
  ++state.count.skipped;
  emit(JobEventKind::Skipped, job, now, 0, WorkerId::kNoneValue, reason);
}

void ReferenceScheduler::complete(JobSlot slot, Time now, Outcome outcome) {
  const std::size_t job = slot.value;
  Job &j = jobs_[job];
  const bool waits = j.state == State::AtDevice || j.state == State::Away;
  REDAG_CHECK(j.state == State::Running || waits_for_worker(j) || waits, "only a job that runs or waits can end");
  leave_worker(j);
  j.state = State::Done;
  if (outcome == Outcome::Finished) {
    ++tasks_[j.task].count.finished;
    emit(JobEventKind::Finished, job, now, now, j.worker);
    deliver(job, now);
  } else {
    ++tasks_[j.task].count.aborted;
    if (outcome == Outcome::NoData) ++tasks_[j.task].count.no_data;
    const Reason reason = outcome == Outcome::Threw            ? Reason::Exception
                          : outcome == Outcome::BudgetExceeded ? Reason::Budget
                                                               : Reason::NoData;
    emit(JobEventKind::Aborted, job, now, now, j.worker, reason);
  }
}

// ---- "Waits" --------------------------------------------------------------------------------------------------------

void ReferenceScheduler::wait(JobSlot slot, DeviceId device, Time now) {
  Job &j = jobs_[slot.value];
  const bool ran_unseen = config_.preemption == Preemption::Full && waits_for_worker(j);
  REDAG_CHECK(j.state == State::Running || ran_unseen, "only a job that runs can wait");
  leave_worker(j);
  j.device = device.valid() ? device.value : kNone;
  j.asked = requests_++;
  j.state = device.valid() ? State::AtDevice : State::Away;
  emit(JobEventKind::Waits, slot.value, now, device.valid() ? std::int64_t{device.value} : -1, j.worker);
}

void ReferenceScheduler::wake(JobSlot slot, Time now) {
  Job &j = jobs_[slot.value];
  REDAG_CHECK(j.state == State::Away, "only a job that waits can be woken");
  j.state = State::Woken;
  emit(JobEventKind::Woken, slot.value, now, j.device == kNone ? -1 : static_cast<std::int64_t>(j.device),
       WorkerId::kNoneValue);
}

// Every free slot of a device goes to the first job that waits for it.
void ReferenceScheduler::serve(Time now) {
  for (std::size_t device = 0; device < devices_.size(); ++device) {
    for (;;) {
      std::size_t used = 0;
      std::size_t first = kNone;
      for (std::size_t i = 0; i < jobs_.size(); ++i) {
        if (jobs_[i].device != device) continue;
        if (jobs_[i].state == State::Away) ++used;
        if (jobs_[i].state != State::AtDevice) continue;
        const bool is_fifo = devices_[device].queue == Device::Queue::Fifo;
        const bool is_first =
            first == kNone || (is_fifo ? jobs_[i].asked < jobs_[first].asked : is_before(standing(i), standing(first)));
        if (is_first) first = i;
      }
      if (first == kNone || used >= devices_[device].slots) break;
      jobs_[first].state = State::Away;
      emit(JobEventKind::Served, first, now, static_cast<std::int64_t>(device), WorkerId::kNoneValue);
      dispatches_.push_back(Dispatch{.job = JobSlot(first),
                                     .task = TaskId(jobs_[first].task),
                                     .number = jobs_[first].number,
                                     .release = jobs_[first].release,
                                     .origin = jobs_[first].origin,
                                     .worker = WorkerId::none(),
                                     .over = JobSlot::none(),
                                     .kind = sched::DispatchKind::Serve});
    }
  }
}

// True for a started job that any worker could continue.
bool ReferenceScheduler::waits_for_worker(const Job &job) const {
  return job.state == State::Woken || (job.state == State::Suspended && config_.preemption == Preemption::Full);
}

void ReferenceScheduler::leave_worker(const Job &job) {
  if (job.state == State::Running) workers_[job.worker].pop_back();
}

void ReferenceScheduler::deliver(std::size_t job, Time now) {
  const std::size_t producer = jobs_[job].task;
  if (tasks_[producer].removed || closed_) return;
  const Data data{true, jobs_[job].release, jobs_[job].origin};
  for (std::size_t s = 0; s < tasks_.size(); ++s) {
    TaskState &state = tasks_[s];
    const auto input = std::find(state.predecessors.begin(), state.predecessors.end(), producer);
    if (input == state.predecessors.end()) continue;
    Data &newest = state.inputs[static_cast<std::size_t>(input - state.predecessors.begin())];
    if (data.release < newest.release) {
      newest.fresh = true;  // it completed, but newer data are already known
    } else {
      newest = data;
    }
    if (state.removed) continue;
    if (state.task.activation == Activation::Timer) {
      for (const std::size_t waiting : jobs_of(s, State::Waiting)) resolve(waiting, now);
    } else if (std::all_of(state.inputs.begin(), state.inputs.end(), [](const Data &d) { return d.fresh; })) {
      const std::vector<Data> consumed = state.inputs;
      for (Data &d : state.inputs) d.fresh = false;
      create_job(s, now, kNever, now, consumed);
    }
  }
}

// ---- "Budgets" and "Criticality" ------------------------------------------------------------------------------------

void ReferenceScheduler::exceed(JobSlot slot, sched::Limit limit, Time now) {
  const std::size_t job = slot.value;
  const std::size_t task = jobs_[job].task;
  if (limit == sched::Limit::WcetLow) {
    if (!is_degradable(task) && !high_mode_ && !closed_) begin_high_mode(job, now);
    return;
  }
  emit(JobEventKind::Exceeded, job, now, 0, jobs_[job].worker);
  if (tasks_[task].task.on_budget == OnBudget::Demote) demote(job);
  const bool has_next = !tasks_[task].removed && !closed_;
  if (tasks_[task].task.on_budget == OnBudget::SkipNext && has_next) tasks_[task].skips_next = true;
}

bool ReferenceScheduler::is_degradable(std::size_t task) const {
  return dags_[tasks_[task].dag].dag.criticality != Criticality::High;
}

Reason ReferenceScheduler::refusal(std::size_t task, Time release) {
  TaskState &state = tasks_[task];
  if (state.skips_next) {
    state.skips_next = false;
    return Reason::Budget;
  }
  if (!high_mode_ || !is_degradable(task)) return Reason::None;
  const Degrade &degrade = dags_[state.dag].dag.degrade;
  if (degrade.kind == Degrade::Kind::Stop) return Reason::Degraded;
  if (state.task.activation == Activation::Data) return Reason::None;
  if (!is_taken(state, release)) return Reason::Degraded;
  state.let_through.push_back(release);
  return Reason::None;
}

// Compares with everything let through for the tasks that count together; a task that counts alone uses only its own.
bool ReferenceScheduler::is_taken(const TaskState &state, Time release) const {
  std::vector<Time> taken = state.let_through;
  for (const TaskState &other : tasks_) {
    const bool together = state.has_edges && other.has_edges && other.dag == state.dag && !other.removed &&
                          other.task.activation == Activation::Timer && other.task.period == state.task.period &&
                          other.task.offset == state.task.offset;
    if (together) taken.insert(taken.end(), other.let_through.begin(), other.let_through.end());
  }
  if (taken.empty()) return true;
  const Time newest = *std::max_element(taken.begin(), taken.end());
  const Degrade &degrade = dags_[state.dag].dag.degrade;
  const bool skips = degrade.kind == Degrade::Kind::Skip;
  const auto period = static_cast<double>(state.task.period);
  const Duration every = skips ? degrade.skip + 1 : static_cast<Duration>(std::ceil(degrade.stretch));
  if (release <= newest) return (newest - release) % (every * state.task.period) == 0;
  const auto passed = static_cast<double>(release - newest);
  return skips ? passed / period > degrade.skip + 0.5 : passed >= degrade.stretch * period;
}

void ReferenceScheduler::begin_high_mode(std::size_t cause, Time now) {
  emit(JobEventKind::HighMode, cause, now, 0, jobs_[cause].worker);
  high_mode_ = true;
  mode_cause_ = cause;
  high_since_ = now;
  // The newest jobs first: of the data that no job used, the newest are kept.
  for (std::size_t job = jobs_.size(); job-- > 0;) {
    const std::size_t heir_of = jobs_[job].heir_of;
    if (heir_of != kNone && is_degradable(jobs_[heir_of].task)) jobs_[job].heir_of = kNone;
    if (jobs_[job].state == State::Done || !is_degradable(jobs_[job].task)) continue;
    started(jobs_[job]) ? demote(job) : skip(job, now, Reason::Degraded);
  }
  for (TaskState &state : tasks_) {
    state.let_through.clear();
  }
}

void ReferenceScheduler::end_high_mode(Time now) {
  for (const Job &job : jobs_) {
    if (job.state == State::Ready || started(job)) return;
  }
  emit(JobEventKind::LowMode, mode_cause_, now, high_since_, WorkerId::kNoneValue);
  for (std::size_t task = 0; task < tasks_.size(); ++task) {
    if (!is_degradable(task)) continue;
    for (const std::size_t job : jobs_of(task, State::Waiting)) skip(job, now, Reason::Degraded);
    for (Data &input : tasks_[task].inputs) input.fresh = false;
  }
  high_mode_ = false;
}

void ReferenceScheduler::demote(std::size_t job) {
  if (jobs_[job].demoted) return;
  jobs_[job].demoted = true;
  jobs_[job].heir_of = kNone;
}

bool ReferenceScheduler::is_demoted(const Job &job) const {
  return job.demoted || (high_mode_ && is_degradable(job.task));
}

void ReferenceScheduler::preemption_point(JobSlot job, Time /*now*/) {
  if (config_.preemption == Preemption::Cooperative) jobs_[job.value].at_point = true;
}

// ---- who may run ----------------------------------------------------------------------------------------------------

bool ReferenceScheduler::started(const Job &job) const {
  return job.state != State::Waiting && job.state != State::Ready && job.state != State::Done;
}

std::vector<std::size_t> ReferenceScheduler::jobs_of(std::size_t task, State state) const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < jobs_.size(); ++i) {
    if (jobs_[i].task == task && jobs_[i].state == state) found.push_back(i);
  }
  return found;
}

bool ReferenceScheduler::task_busy(const Job &job) const {
  const auto in_progress =
      std::count_if(jobs_.begin(), jobs_.end(), [&](const Job &o) { return o.task == job.task && started(o); });
  return in_progress >= static_cast<std::ptrdiff_t>(tasks_[job.task].task.concurrency);
}

bool ReferenceScheduler::dag_at_bound(const Job &job) const {
  const std::size_t dag = tasks_[job.task].dag;
  const std::uint32_t bound = dags_[dag].dag.max_active;
  const auto active =
      std::count_if(jobs_.begin(), jobs_.end(), [&](const Job &o) { return tasks_[o.task].dag == dag && started(o); });
  return bound != 0 && active >= static_cast<std::ptrdiff_t>(bound);
}

std::size_t ReferenceScheduler::group_holder(const Job &job) const {
  const std::string &group = tasks_[job.task].task.group;
  if (group.empty()) return kNone;
  for (std::size_t i = 0; i < jobs_.size(); ++i) {
    if (started(jobs_[i]) && tasks_[jobs_[i].task].task.group == group) return i;
  }
  return kNone;
}

// ---- the order of jobs ----------------------------------------------------------------------------------------------

/// The job whose priority `job` has.
const ReferenceScheduler::Job &ReferenceScheduler::effective(std::size_t job) const {
  const std::size_t heir_of = jobs_[job].heir_of;
  return jobs_[heir_of == kNone ? job : heir_of];
}

ReferenceScheduler::Standing ReferenceScheduler::own_standing(const Job &job) const {
  const TaskState &task = tasks_[job.task];
  Standing own;
  own.demoted = is_demoted(job);
  switch (config_.policy) {
    case PolicyKind::Edf: own.priority = own.demoted ? 0 : job.deadline; break;
    case PolicyKind::Fifo: own.priority = own.demoted ? 0 : static_cast<std::int64_t>(job.ready_order); break;
    default: own.priority = task.tier; break;
  }
  const bool take_turns = config_.ties == Ties::Share && config_.policy != PolicyKind::Fifo;
  own.turn = take_turns ? job.turn : 0;
  own.rank = task.rank;
  own.number = job.number;
  return own;
}

bool ReferenceScheduler::is_of_higher_priority(const Standing &a, const Standing &b) {
  return std::tie(a.demoted, a.priority) < std::tie(b.demoted, b.priority);
}

bool ReferenceScheduler::is_before(const Standing &a, const Standing &b) {
  return std::tie(a.demoted, a.priority, a.turn, a.rank, a.number) <
         std::tie(b.demoted, b.priority, b.turn, b.rank, b.number);
}

/// The standing with what the job has inherited.
ReferenceScheduler::Standing ReferenceScheduler::standing(std::size_t job) const {
  Standing result = own_standing(jobs_[job]);
  const Standing lent = own_standing(effective(job));
  if (is_of_higher_priority(lent, result)) {
    result.demoted = lent.demoted;
    result.priority = lent.priority;
  }
  return result;
}

/// Full preemption with static priorities: the operating system schedules by levels.
bool ReferenceScheduler::has_levels() const {
  return config_.preemption == Preemption::Full && is_static(config_.policy);
}

std::uint32_t ReferenceScheduler::level_of(std::size_t job) const {
  std::uint32_t below_all = config_.levels;
  for (const TaskState &task : tasks_) {
    if (config_.levels == 0 && !task.gone) below_all = std::max(below_all, task.level + 1);
  }
  const auto level = [&](const Job &j) { return is_demoted(j) ? below_all : tasks_[j.task].level; };
  return std::min(level(jobs_[job]), level(effective(job)));
}

/// True if `a` takes the worker of `b`, which has started.
bool ReferenceScheduler::outranks(std::size_t a, std::size_t b) const {
  if (config_.policy == PolicyKind::Fifo) return false;  // a running job became ready earlier, or had to wait
  const Standing by = standing(a);
  const Standing of = standing(b);
  if (by.demoted && of.demoted) return false;  // all on one level
  if (has_levels()) return level_of(a) < level_of(b);
  // Under a static policy a level is at least a task: jobs of one task do not interrupt each other.
  const bool by_levels = config_.ties == Ties::Share || is_static(config_.policy);
  return by_levels ? is_of_higher_priority(by, of) : is_before(by, of);
}

/// True if `a` is considered first. Within a level, as in the operating system, a started job is.
bool ReferenceScheduler::considered_before(std::size_t a, std::size_t b) const {
  if (has_levels()) {
    const auto rank = [this](std::size_t job) { return std::pair(level_of(job), !started(jobs_[job])); };
    if (rank(a) != rank(b)) return rank(a) < rank(b);
  }
  return is_before(standing(a), standing(b));
}

// ---- dispatch -------------------------------------------------------------------------------------------------------

Step ReferenceScheduler::dispatch(Time now, std::uint32_t most) {
  dispatches_.clear();
  // Takes one decision at a time. Each can change the order, because a job that waits for a group hands on its
  // priority.
  std::vector<std::size_t> passed_over;
  for (;;) {
    const std::size_t job = first_candidate(passed_over, most > 0);
    if (job == kNone) break;
    const std::uint32_t worker = worker_for(job);
    if (worker == WorkerId::kNoneValue) break;
    const bool starts = !started(jobs_[job]);
    if (!starts || can_start(job, now)) {
      if (starts) --most;
      place(job, worker, now);
    } else {
      passed_over.push_back(job);
    }
  }
  if (config_.preemption == Preemption::Cooperative) resume_uncovered(now);
  serve(now);
  for (Job &job : jobs_) job.at_point = false;
  if (high_mode_) end_high_mode(now);
  tell_levels();
  step_events_.swap(events_);
  events_.clear();
  return Step{dispatches_, step_events_};
}

std::size_t ReferenceScheduler::first_candidate(const std::vector<std::size_t> &passed_over, bool may_start) const {
  std::size_t first = kNone;
  for (std::size_t i = 0; i < jobs_.size(); ++i) {
    const bool resumable = waits_for_worker(jobs_[i]);
    if (!(jobs_[i].state == State::Ready && may_start) && !resumable) continue;
    if (std::find(passed_over.begin(), passed_over.end(), i) != passed_over.end()) continue;
    if (first == kNone || considered_before(i, first)) first = i;
  }
  return first;
}

/// The worker that is available to `job`: the one that it had, the lowest free one, or that of the least urgent job
/// that it may interrupt.
std::uint32_t ReferenceScheduler::worker_for(std::size_t job) const {
  const std::uint32_t before = jobs_[job].worker;
  if (before != WorkerId::kNoneValue && workers_[before].empty()) return before;
  for (std::uint32_t w = 0; w < workers_.size(); ++w) {
    if (workers_[w].empty()) return w;
  }
  if (config_.preemption == Preemption::None) return WorkerId::kNoneValue;
  std::uint32_t best = WorkerId::kNoneValue;
  for (std::uint32_t w = 0; w < workers_.size(); ++w) {
    const std::size_t top = workers_[w].back();
    const bool available =
        config_.preemption == Preemption::Full || jobs_[top].state == State::Suspended || jobs_[top].at_point;
    if (!available || !outranks(job, top)) continue;
    if (best == WorkerId::kNoneValue || considered_before(workers_[best].back(), top)) best = w;
  }
  return best;
}

/// `job` has an available worker. Returns whether it is eligible; if not, handles deferral and inheritance.
bool ReferenceScheduler::can_start(std::size_t job, Time now) {
  Job &j = jobs_[job];
  if (task_busy(j)) return false;
  if (dag_at_bound(j)) {
    if (!j.deferred) emit(JobEventKind::Deferred, job, now, 0, WorkerId::kNoneValue);
    j.deferred = true;
    return false;
  }
  const std::size_t holder = group_holder(j);
  if (holder != kNone) {
    const bool inherits = config_.policy != PolicyKind::Fifo;
    if (inherits && is_of_higher_priority(own_standing(j), standing(holder))) jobs_[holder].heir_of = job;
    return false;
  }
  const auto all_started = std::count_if(jobs_.begin(), jobs_.end(), [this](const Job &o) { return started(o); });
  return config_.max_started == 0 || all_started < static_cast<std::ptrdiff_t>(config_.max_started);
}

void ReferenceScheduler::place(std::size_t job, std::uint32_t worker, Time now) {
  Job &j = jobs_[job];
  j.worker = worker;
  Dispatch decision = decision_of(job);
  Stack &stack = workers_[worker];
  if (!stack.empty()) {
    Job &under = jobs_[stack.back()];
    decision.over = JobSlot(stack.back());
    if (under.state == State::Running) emit(JobEventKind::Preempted, stack.back(), now, 0, worker);
    under.state = State::Suspended;
    if (config_.preemption == Preemption::Full) stack.pop_back();
  }
  const bool resumes = j.state == State::Suspended || j.state == State::Woken;
  if (resumes) decision.kind = sched::DispatchKind::Resume;
  j.state = State::Running;
  j.told_level = decision.level;
  stack.push_back(job);
  emit(resumes ? JobEventKind::Resumed : JobEventKind::Dispatched, job, now, resumes ? 0 : j.deadline, worker);
  dispatches_.push_back(decision);
}

/// Cooperative: a suspended job with nothing on top of it continues.
void ReferenceScheduler::resume_uncovered(Time now) {
  for (std::uint32_t w = 0; w < workers_.size(); ++w) {
    if (workers_[w].empty()) continue;
    const std::size_t top = workers_[w].back();
    if (jobs_[top].state != State::Suspended) continue;
    jobs_[top].state = State::Running;
    jobs_[top].told_level = level_of(top);
    emit(JobEventKind::Resumed, top, now, 0, w);
    dispatches_.push_back(decision_of(top));
    dispatches_.back().kind = sched::DispatchKind::Resume;
  }
}

Dispatch ReferenceScheduler::decision_of(std::size_t job) const {
  const Job &j = jobs_[job];
  return Dispatch{.job = JobSlot(job),
                  .task = TaskId(j.task),
                  .number = j.number,
                  .release = j.release,
                  .origin = j.origin,
                  .worker = WorkerId(j.worker),
                  .over = JobSlot::none(),
                  .level = level_of(job)};
}

/// The driver must know each new level of a job that it schedules; with full preemption this includes suspended jobs.
void ReferenceScheduler::tell_levels() {
  for (std::size_t i = 0; i < jobs_.size(); ++i) {
    Job &j = jobs_[i];
    const bool is_scheduled = j.state == State::Running || (started(j) && config_.preemption == Preemption::Full);
    if (!is_scheduled || j.told_level == level_of(i)) continue;
    j.told_level = level_of(i);
    dispatches_.push_back(decision_of(i));
    dispatches_.back().kind = sched::DispatchKind::Level;
  }
}

bool ReferenceScheduler::outranked(JobSlot job) const {
  if (config_.preemption != Preemption::Cooperative || jobs_[job.value].state != State::Running) return false;
  ReferenceScheduler copy = *this;
  ReferenceScheduler without = *this;
  without.dispatch(0);
  copy.preemption_point(job, 0);
  const Step step = copy.dispatch(0);
  // A point at which another job only inherits must be reported, too.
  const bool inherits = !std::equal(without.jobs_.begin(), without.jobs_.end(), copy.jobs_.begin(),
                                    [](const Job &a, const Job &b) { return a.heir_of == b.heir_of; });
  return inherits || std::any_of(step.dispatches.begin(), step.dispatches.end(),
                                 [job](const Dispatch &d) { return d.over == job; });
}

// ---- reconfiguration and counts -------------------------------------------------------------------------------------

DagId ReferenceScheduler::add_dag(const Dag &dag, Time /*now*/) {
  forget_what_is_gone();
  add_tasks(dag);
  rank_tasks();
  return DagId(dags_.size() - 1);
}

TaskId ReferenceScheduler::add_task(DagId dag, std::uint32_t rank, const Task &task, Time /*now*/, bool /*more*/) {
  forget_what_is_gone();
  TaskState state;
  state.task = task;
  state.dag = dag.value;
  state.topological = rank;
  const TaskId id(tasks_.size());
  tasks_.push_back(state);
  dags_[dag.value].tasks.push_back(id);
  rank_tasks();
  return id;
}

void ReferenceScheduler::remove_dag(DagId dag, Time now) {
  for (const TaskId task : dags_[dag.value].tasks) remove_task(task, now);
  dags_[dag.value].removed = true;
}

void ReferenceScheduler::remove_task(TaskId task, Time now) {
  if (tasks_[task.value].removed) return;
  skip_all(task.value, now);
  tasks_[task.value].removed = true;
}

void ReferenceScheduler::set_timing(TaskId task, Duration period, Duration deadline, Time /*now*/) {
  if (tasks_[task.value].gone) return;
  tasks_[task.value].task.period = period;
  tasks_[task.value].task.deadline = deadline;
  rank_tasks();
}

void ReferenceScheduler::close(Time now) {
  for (std::size_t task = 0; task < tasks_.size(); ++task) skip_all(task, now);
  closed_ = true;
}

void ReferenceScheduler::skip_all(std::size_t task, Time now) {
  for (std::size_t job = 0; job < jobs_.size(); ++job) {
    const bool waits = jobs_[job].state == State::Waiting || jobs_[job].state == State::Ready;
    if (jobs_[job].task == task && waits) skip(job, now, Reason::Removed);
  }
}

Accounting ReferenceScheduler::accounting(TaskId task) const {
  Accounting count = tasks_[task.value].count;
  for (const Job &job : jobs_) {
    if (job.task == task.value && job.deferred) ++count.deferred;
  }
  return count;
}

std::uint32_t ReferenceScheduler::ready(TaskId task) const {
  return static_cast<std::uint32_t>(jobs_of(task.value, State::Ready).size());
}

void ReferenceScheduler::emit(JobEventKind kind, std::size_t job, Time now, std::int64_t value, std::uint32_t worker,
                              Reason reason) {
  JobEvent event;
  event.time = now;
  event.value = value;
  event.task = TaskId(jobs_[job].task);
  event.job = jobs_[job].number;
  event.worker = worker;
  event.kind = kind;
  event.reason = reason;
  events_.push_back(event);
}

}  // namespace redag::testing
