// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/sim/simulator.hpp"

#include <algorithm>
#include <numeric>
#include <span>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/base/int128.hpp"
#include "redag/derived/demand.hpp"
#include "redag/derived/release_queue.hpp"
#include "redag/derived/waits.hpp"
#include "redag_analysis/sim/release_tree.hpp"

namespace redag::sim {
namespace {

class Simulation {
 public:
  Simulation(const Workload &workload, sched::Scheduler &scheduler, std::uint32_t workers, const Options &options,
             const EventSink &sink)
      : scheduler_(scheduler),
        options_(options),
        sink_(sink),
        processors_(workers),
        at_once_(workers),
        releases_(workload.task_count()) {
    const std::vector<std::uint32_t> places = places_of(workload);
    for (const TaskRef &ref : flatten(workload)) {
      const Task &task = *ref.task;
      tasks_.push_back(task_state(task, ref.id, places[ref.id.value]));
      has_regions_ = has_regions_ || task.region > 0;
      has_waits_ = has_waits_ || !task.waits.empty();
      has_limits_ = has_limits_ || task.wcet_low > 0 || (task.budget > 0 && task.on_budget != OnBudget::Abort);
      if (task.activation != Activation::Timer || task.offset >= options.horizon) continue;
      TimerRelease &release = tasks_.back().release;
      release = {.seen = task.offset + jitter(task, ref.id, 0), .nominal = task.offset, .task = ref.id};
      expect(release);
    }
  }

  Result run() {
    if (!sink_) scheduler_.record_only({});
    has_points_ = has_regions_ || has_limits_;
    bool goes_on = true;
    while (goes_on) {
      Time next = std::min(releases_.next(), first_end_);
      if (has_points_ || has_waits_) next = std::min(next, next_rare_event());
      if (next > options_.horizon) break;
      now_ = next;
      if (first_end_ == now_) complete_jobs();
      if (has_limits_) reach_limits();
      if (has_waits_) {
        if (first_end_ == now_) begin_waits();
        end_waits();
      }
      release_jobs();
      if (has_regions_) reach_preemption_points();
      goes_on = carry_out(scheduler_.dispatch(now_));
    }
    result_.end = goes_on ? options_.horizon : now_;
    return result_;
  }

 private:
  // A job's progress, by slot; valid while the job is started.
  struct Progress {
    Duration left = 0;      // processor time until it ends or waits, overheads included
    Duration executed = 0;  // up to its last loss of the processor
    Duration lead = 0;      // overheads; they come before the body and hold no preemption point
    TaskId task;
    std::uint32_t number = 0;  // within its task
    std::uint32_t next_wait = 0;
    bool cut_off = false;       // it ends at its budget
    bool ends_in_wait = false;  // it waits once `left` is used up, and does not end
    Duration demand = 0;        // of the body; of a task with waits
    Duration wait = 0;          // length of the wait that it began last
    // Processor time of the body that uses these up; kNever: not watched, or already reported.
    Duration budget = kNever;
    Duration wcet_low = kNever;
  };
  // What the simulation needs of a task, together in memory.
  struct TaskState {
    const Task *task = nullptr;
    std::uint32_t place = 0;  // in the static order
    bool has_jitter = false;
    bool demand_varies = true;  // if not, each of its jobs begins as `fresh`
    Duration period = 0;
    TimerRelease release;  // its next one
    Progress fresh;
  };
  struct Processor {
    JobSlot job;
    bool ends_in_wait = false;  // as its job
    Time since = 0;             // when the job last got the processor
    Time end = kNever;          // when the job ends or begins to wait if nothing intervenes
    Time point = kNever;        // the next preemption point that matters, or the next limit
  };

  // A job without a processor, which a device serves or which waits without one.
  struct Away {
    JobSlot job;
    Time until = 0;
  };

  [[nodiscard]] Time first_end() const {
    Time first = kNever;
    for (const Processor &processor : processors_) first = std::min(first, processor.end);
    return first;
  }

  // Returns when the next preemption point, the next limit, or the end of the next wait is.
  [[nodiscard]] Time next_rare_event() const {
    Time next = kNever;
    for (const Processor &processor : processors_) next = std::min(next, processor.point);
    for (const Away &away : away_) next = std::min(next, away.until);
    return next;
  }

  // Returns the static order by TaskId: DAG by DAG, in topological order.
  static std::vector<std::uint32_t> places_of(const Workload &workload) {
    std::vector<std::uint32_t> places;
    for (const Dag &dag : workload.dags) {
      const auto first = static_cast<std::uint32_t>(places.size());
      for (const std::uint32_t rank : topological_ranks(dag)) places.push_back(first + rank);
    }
    return places;
  }

  // Reports what happens at one instant in the static order of tasks. The order of processors depends on unrelated
  // tasks and must not matter.
  template <class Predicate, class Tell>
  void tell_in_order(Predicate which, Tell tell) {
    std::size_t count = 0;
    for (Processor &processor : processors_) {
      at_once_[count] = &processor;  // without a branch: which processor it is cannot be predicted
      count += which(processor) ? 1U : 0U;
    }
    const std::span<Processor *> found = std::span(at_once_).first(count);
    if (found.size() > 1) {
      std::sort(found.begin(), found.end(),
                [this](const Processor *a, const Processor *b) { return comes_first(a->job, b->job); });
    }
    for (Processor *processor : found) tell(*processor);
  }

  [[nodiscard]] bool comes_first(JobSlot a, JobSlot b) const {
    const Progress &x = progress_[a.value];
    const Progress &y = progress_[b.value];
    return x.task != y.task ? tasks_[x.task.value].place < tasks_[y.task.value].place : x.number < y.number;
  }

  // Returns true if the job there ends now, or begins to wait now. If not, its end counts for first_end_.
  [[nodiscard]] bool is_due(const Processor &processor, bool in_wait) {
    const bool due = processor.end == now_ && processor.ends_in_wait == in_wait;
    first_end_ = std::min(first_end_, due ? kNever : processor.end);
    return due;
  }

  void complete_jobs() {
    first_end_ = kNever;
    tell_in_order([this](const Processor &processor) { return is_due(processor, false); },
                  [this](Processor &processor) {
                    const JobSlot job = processor.job;
                    const bool cut_off = progress_[job.value].cut_off;
                    processor = Processor{};
                    ++result_.finished;
                    scheduler_.complete(job, now_, cut_off ? sched::Outcome::BudgetExceeded : sched::Outcome::Finished);
                  });
  }

  void begin_waits() {
    first_end_ = kNever;
    tell_in_order([this](const Processor &processor) { return is_due(processor, true); },
                  [this](Processor &processor) {
                    const JobSlot job = processor.job;
                    Progress &progress = progress_[job.value];
                    progress.executed += now_ - processor.since;
                    processor = Processor{};
                    const Task &task = *tasks_[progress.task.value].task;
                    const std::size_t wait = progress.next_wait++;
                    progress.wait = options_.wait
                                        ? options_.wait(task, progress.task, progress.number, wait)
                                        : wait_time(task, progress.task, progress.number, wait, options_.seed);
                    REDAG_CHECK(progress.wait > 0, "a wait has a positive length");
                    const DeviceId device = task.waits[wait].device;
                    set_stretch(progress, task, wait_point(task, wait, progress.demand));
                    scheduler_.wait(job, device, now_);
                    if (!device.valid()) go_away(job);
                  });
  }

  // The wait of the job takes its time from now on.
  void go_away(JobSlot job) { away_.push_back(Away{job, now_ + progress_[job.value].wait}); }

  void end_waits() {
    const auto over =
        std::partition(away_.begin(), away_.end(), [this](const Away &away) { return away.until > now_; });
    std::sort(over, away_.end(), [this](const Away &a, const Away &b) { return comes_first(a.job, b.job); });
    for (auto away = over; away != away_.end(); ++away) scheduler_.wake(away->job, now_);
    away_.erase(over, away_.end());
  }

  void release_jobs() {
    while (releases_.next() <= now_) {
      TaskState &state = tasks_[releases_.task().value];
      TimerRelease &release = state.release;
      ++result_.released;
      scheduler_.release(release.task, release.nominal, now_);
      const std::uint32_t next = release.number + 1;
      const Duration gap = options_.gap ? options_.gap(*state.task, release.task, next) : 0;
      release.advance(state.period + gap, state.has_jitter ? jitter(*state.task, release.task, next) : 0);
      expect(release);
    }
  }

  void expect(const TimerRelease &release) {
    releases_.set(release.task, release.seen < options_.horizon ? release.seen : kNever);
  }

  // Processor time of the body up to now; negative during the overheads before it.
  [[nodiscard]] Duration body_of(const Processor &processor) const {
    const Progress &progress = progress_[processor.job.value];
    return progress.executed + (now_ - processor.since) - progress.lead;
  }

  // Reports jobs that have used their budget or their wcet_low and continue.
  void reach_limits() {
    const auto reaches_one = [this](const Processor &processor) {
      if (!processor.job.valid()) return false;
      const Progress &progress = progress_[processor.job.value];
      return body_of(processor) >= std::min(progress.wcet_low, progress.budget);
    };
    tell_in_order(reaches_one, [this](const Processor &processor) {
      Progress &progress = progress_[processor.job.value];
      const Duration body = body_of(processor);
      if (body >= progress.wcet_low) {
        progress.wcet_low = kNever;
        scheduler_.exceed(processor.job, sched::Limit::WcetLow, now_);
      }
      if (body >= progress.budget) {
        progress.budget = kNever;
        scheduler_.exceed(processor.job, sched::Limit::Budget, now_);
      }
    });
  }

  [[nodiscard]] Duration region_of(const Processor &processor) const {
    return tasks_[progress_[processor.job.value].task.value].task->region;
  }

  // Reports jobs at a multiple of their region, if another job outranks them.
  void reach_preemption_points() {
    for (Processor &processor : processors_) {
      if (!processor.job.valid() || !scheduler_.outranked(processor.job)) continue;
      const Duration region = region_of(processor);
      const Duration body = body_of(processor);
      if (region > 0 && body > 0 && body % region == 0) {
        scheduler_.preemption_point(processor.job, now_);
      }
    }
  }

  bool carry_out(const sched::Step &step) {
    for (const sched::Dispatch &dispatch : step.dispatches) {
      switch (dispatch.kind) {
        case sched::DispatchKind::Start:
        case sched::DispatchKind::Resume: give_processor(dispatch); break;
        case sched::DispatchKind::Level: break;  // other dispatches tell which jobs run
        case sched::DispatchKind::Serve: go_away(dispatch.job); break;
      }
    }
    if (has_points_) plan_points();
    return !sink_ || sink_(step.events);
  }

  void take_processor(Processor &processor) {
    Progress &progress = progress_[processor.job.value];
    progress.executed += now_ - processor.since;
    progress.left = processor.end - now_;
    processor = Processor{};
    first_end_ = first_end();
  }

  void give_processor(const sched::Dispatch &dispatch) {
    Processor &processor = processors_[dispatch.worker.value];
    // A job that is suspended under another may have lost its processor before.
    if (dispatch.over.valid() && processor.job == dispatch.over) take_processor(processor);
    REDAG_CHECK(!processor.job.valid(), "the scheduler gave a processor to two jobs");
    if (dispatch.kind == sched::DispatchKind::Start) begin_job(dispatch);
    Progress &progress = progress_[dispatch.job.value];
    if (dispatch.kind == sched::DispatchKind::Resume) {
      progress.left += options_.overheads.preempt;
      progress.lead += options_.overheads.preempt;
    }
    processor.job = dispatch.job;
    processor.ends_in_wait = progress.ends_in_wait;
    processor.since = now_;
    processor.end = now_ + progress.left;
    first_end_ = std::min(first_end_, processor.end);
  }

  [[nodiscard]] TaskState task_state(const Task &task, TaskId id, std::uint32_t place) const {
    TaskState state;
    state.task = &task;
    state.place = place;
    state.period = task.period;
    state.has_jitter = task.jitter > 0 || options_.jitter;
    state.demand_varies = task.execution.kind != ExecutionTime::Kind::Constant || options_.demand || task.wcet <= 0;
    if (task.on_budget != OnBudget::Abort && task.budget > 0) state.fresh.budget = task.budget;
    if (task.wcet_low > 0) state.fresh.wcet_low = task.wcet_low;
    state.fresh.lead = options_.overheads.release + options_.overheads.dispatch;
    state.fresh.task = id;
    set_demand(state.fresh, task, task.wcet);
    return state;
  }

  // The job executes until its next wait or its end, from this much executed on.
  static void set_stretch(Progress &progress, const Task &task, Duration from) {
    const Duration end = progress.cut_off ? task.budget : progress.demand;
    const std::size_t next = progress.next_wait;
    const Duration point = next < task.waits.size() ? wait_point(task, next, progress.demand) : kNever;
    progress.ends_in_wait = point < end;
    progress.left = std::min(point, end) - from;
  }

  static void set_demand(Progress &progress, const Task &task, Duration demand) {
    progress.cut_off = task.on_budget == OnBudget::Abort && task.budget > 0 && demand > task.budget;
    progress.left = (progress.cut_off ? task.budget : demand) + progress.lead;
    if (task.waits.empty()) return;
    REDAG_CHECK(demand >= shortest_demand(task), "a job executes before each of its waits and after the last one");
    progress.demand = demand;
    set_stretch(progress, task, 0);
    progress.left += progress.lead;
  }

  void begin_job(const sched::Dispatch &dispatch) {
    if (dispatch.job.value >= progress_.size()) progress_.resize(dispatch.job.value + 1);
    Progress &progress = progress_[dispatch.job.value];
    const TaskState &state = tasks_[dispatch.task.value];
    progress = state.fresh;
    progress.number = dispatch.number;
    if (!state.demand_varies) return;
    const Task &task = *state.task;
    const Duration demand = options_.demand ? options_.demand(task, dispatch.task, dispatch.number)
                                            : execution_time(task, dispatch.task, dispatch.number, options_.seed);
    REDAG_CHECK(demand > 0, "a job executes for a positive time");
    set_demand(progress, task, demand);
  }

  // Only a job that another one outranks needs an event at its preemption point.
  void plan_points() {
    for (Processor &processor : processors_) {
      processor.point = kNever;
      if (!processor.job.valid()) continue;
      const Progress &progress = progress_[processor.job.value];
      const Duration region = region_of(processor);
      const Duration body = body_of(processor);
      Duration next_body = std::min(progress.budget, progress.wcet_low);
      if (region > 0 && scheduler_.outranked(processor.job)) {
        next_body = std::min(next_body, body < 0 ? region : (body / region + 1) * region);
      }
      if (next_body == kNever) continue;
      const Time point = now_ + (next_body - body);
      if (point < processor.end) processor.point = point;
    }
  }

  [[nodiscard]] Duration jitter(const Task &task, TaskId id, std::uint32_t number) const {
    return options_.jitter ? options_.jitter(task, id, number) : release_jitter(task, id, number, options_.seed);
  }

  sched::Scheduler &scheduler_;
  const Options &options_;
  const EventSink &sink_;
  std::vector<TaskState> tasks_;  // by TaskId
  std::vector<Processor> processors_;
  std::vector<Processor *> at_once_;
  std::vector<Progress> progress_;
  std::vector<Away> away_;
  ReleaseTree releases_;
  Result result_;
  Time now_ = 0;
  Time first_end_ = kNever;  // the earliest Processor::end
  bool has_regions_ = false;
  bool has_limits_ = false;
  bool has_points_ = false;  // one of these two
  bool has_waits_ = false;
};

}  // namespace

Result simulate(const Workload &workload, sched::Scheduler &scheduler, std::uint32_t workers, const Options &options,
                const EventSink &sink) {
  return Simulation(workload, scheduler, workers, options, sink).run();
}

Overheads overheads_of(const redag::Overheads &machine) {
  return Overheads{.release = machine.timer, .dispatch = machine.dispatch, .preempt = machine.preempt};
}

std::optional<Duration> hyperperiod(const Workload &workload, Duration limit) {
  Int128 result = 1;
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) {
      if (task.activation != Activation::Timer) continue;
      result = result / std::gcd(static_cast<Duration>(result), task.period) * task.period;
      if (result > limit) return std::nullopt;
    }
  }
  return static_cast<Duration>(result);
}

}  // namespace redag::sim
