// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/recording_scheduler.hpp"

#include <sys/syscall.h>
#include <unistd.h>

#include <map>
#include <optional>

#include "redag/threads/clock.hpp"

namespace redag::testing {

using sched::Dispatch;
using sched::DispatchKind;
using sched::Limit;
using sched::Outcome;
using sched::Scheduler;
using sched::Step;

namespace {

constexpr std::size_t kUsualCalls = 1U << 15U;

struct Call {
  enum class Kind : std::uint8_t {
    Release,
    Miss,
    Complete,
    Exceed,
    Dispatch,
    AddDag,
    RemoveDag,
    AddTask,
    RemoveTask,
    SetTiming,
    Close,
  };
  Kind kind = Kind::Dispatch;
  Time now = 0;
  TaskId task = {};
  DagId dag = {};
  JobKey job = {};
  Time nominal = 0;  // or the period
  Time origin = 0;
  Duration deadline = 0;
  Reason reason = Reason::None;
  Outcome outcome = Outcome::Finished;
  Limit limit = Limit::Budget;
  std::uint32_t number = 0;  // of `most`, or of the rank
  std::size_t what = 0;      // position of the DAG or task
  Time time = 0;
  pid_t thread = 0;
};

pid_t this_thread() {
  thread_local const auto kId = static_cast<pid_t>(::syscall(SYS_gettid));
  return kId;
}

}  // namespace

class RecordingScheduler::Log {
 public:
  Log() { calls.reserve(kUsualCalls); }
  std::vector<Call> calls;
  std::vector<Dag> dags;
  std::vector<Task> tasks;
};

RecordingScheduler::RecordingScheduler(std::unique_ptr<Scheduler> scheduler, std::shared_ptr<Log> log)
    : scheduler_(std::move(scheduler)), log_(std::move(log)) {}
RecordingScheduler::~RecordingScheduler() = default;

std::shared_ptr<RecordingScheduler::Log> RecordingScheduler::make_log() { return std::make_shared<Log>(); }

// ---- calls are recorded ----

void RecordingScheduler::release(TaskId task, Time nominal, Time now, Time origin) {
  log_->calls.push_back({.kind = Call::Kind::Release, .now = now, .task = task, .nominal = nominal, .origin = origin});
  scheduler_->release(task, nominal, now, origin);
}

void RecordingScheduler::miss(TaskId task, Time nominal, Time now, Reason reason) {
  log_->calls.push_back({.kind = Call::Kind::Miss, .now = now, .task = task, .nominal = nominal, .reason = reason});
  scheduler_->miss(task, nominal, now, reason);
}

void RecordingScheduler::complete(JobSlot job, Time now, Outcome outcome) {
  log_->calls.push_back({.kind = Call::Kind::Complete, .now = now, .job = jobs_[job.value], .outcome = outcome});
  scheduler_->complete(job, now, outcome);
}

void RecordingScheduler::preemption_point(JobSlot job, Time now) { scheduler_->preemption_point(job, now); }

void RecordingScheduler::exceed(JobSlot job, Limit limit, Time now) {
  log_->calls.push_back({.kind = Call::Kind::Exceed, .now = now, .job = jobs_[job.value], .limit = limit});
  scheduler_->exceed(job, limit, now);
}

Step RecordingScheduler::dispatch(Time now, std::uint32_t most) {
  log_->calls.push_back({.kind = Call::Kind::Dispatch,
                         .now = now,
                         .number = most,
                         .time = runtime::monotonic_now(),
                         .thread = this_thread()});
  const Step step = scheduler_->dispatch(now, most);
  for (const Dispatch &dispatch : step.dispatches) {
    if (dispatch.job.value >= jobs_.size()) jobs_.resize(dispatch.job.value + 1);
    jobs_[dispatch.job.value] = {dispatch.task.value, dispatch.number};
  }
  return step;
}

DagId RecordingScheduler::add_dag(const Dag &dag, Time now) {
  log_->calls.push_back({.kind = Call::Kind::AddDag, .now = now, .what = log_->dags.size()});
  log_->dags.push_back(dag);
  return scheduler_->add_dag(dag, now);
}

void RecordingScheduler::remove_dag(DagId dag, Time now) {
  log_->calls.push_back({.kind = Call::Kind::RemoveDag, .now = now, .dag = dag});
  scheduler_->remove_dag(dag, now);
}

TaskId RecordingScheduler::add_task(DagId dag, std::uint32_t rank, const Task &task, Time now, bool more) {
  log_->calls.push_back(
      {.kind = Call::Kind::AddTask, .now = now, .dag = dag, .number = rank, .what = log_->tasks.size()});
  log_->tasks.push_back(task);
  return scheduler_->add_task(dag, rank, task, now, more);
}

void RecordingScheduler::remove_task(TaskId task, Time now) {
  log_->calls.push_back({.kind = Call::Kind::RemoveTask, .now = now, .task = task});
  scheduler_->remove_task(task, now);
}

void RecordingScheduler::set_timing(TaskId task, Duration period, Duration deadline, Time now) {
  log_->calls.push_back(
      {.kind = Call::Kind::SetTiming, .now = now, .task = task, .nominal = period, .deadline = deadline});
  scheduler_->set_timing(task, period, deadline, now);
}

void RecordingScheduler::close(Time now) {
  log_->calls.push_back({.kind = Call::Kind::Close, .now = now});
  scheduler_->close(now);
}

// ---- and replayed ----

std::vector<Decision> RecordingScheduler::replay(const Log &log, Scheduler &other, std::size_t &differences) {
  std::vector<Decision> decisions;
  std::map<JobKey, JobSlot> slots;
  const auto slot_of = [&](const JobKey &job) -> std::optional<JobSlot> {
    const auto found = slots.find(job);
    if (found != slots.end()) return found->second;
    ++differences;
    return std::nullopt;
  };
  differences = 0;
  for (const Call &call : log.calls) {
    switch (call.kind) {
      case Call::Kind::Release: other.release(call.task, call.nominal, call.now, call.origin); break;
      case Call::Kind::Miss: other.miss(call.task, call.nominal, call.now, call.reason); break;
      case Call::Kind::Complete:
        if (const auto slot = slot_of(call.job)) other.complete(*slot, call.now, call.outcome);
        slots.erase(call.job);
        break;
      case Call::Kind::Exceed:
        if (const auto slot = slot_of(call.job)) other.exceed(*slot, call.limit, call.now);
        break;
      case Call::Kind::Dispatch: {
        Decision decision{call.time, call.thread, {}};
        for (const Dispatch &dispatch : other.dispatch(call.now, call.number).dispatches) {
          const JobKey job{dispatch.task.value, dispatch.number};
          slots[job] = dispatch.job;
          decision.changes.push_back({job, dispatch.kind == DispatchKind::Start, dispatch.level});
        }
        if (!decision.changes.empty()) decisions.push_back(std::move(decision));
        break;
      }
      case Call::Kind::AddDag: other.add_dag(log.dags[call.what], call.now); break;
      case Call::Kind::RemoveDag: other.remove_dag(call.dag, call.now); break;
      case Call::Kind::AddTask: other.add_task(call.dag, call.number, log.tasks[call.what], call.now); break;
      case Call::Kind::RemoveTask: other.remove_task(call.task, call.now); break;
      case Call::Kind::SetTiming: other.set_timing(call.task, call.nominal, call.deadline, call.now); break;
      case Call::Kind::Close: other.close(call.now); break;
    }
  }
  return decisions;
}

}  // namespace redag::testing
