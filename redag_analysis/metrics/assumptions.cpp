// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/assumptions.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag::metrics {
namespace {

// A job that follows another on its thread is charged for the decision between the two. A job that ends within
// CpuMeter::kShort is charged for all the time since it began, the dispatch included.
constexpr Duration kDecision = 10 * kMicrosecond;
constexpr Duration kShort = 10 * kMicrosecond;

// A single execution beyond all measured noise may be the first of its kind. At twice that distance it is no noise.
constexpr Duration kMargin = 2;

Duration slack_of(const JobRecord &job, const Overheads &allowed) {
  return allowed.clock + kDecision + (job.processor <= kShort ? allowed.dispatch : 0);
}

Duration most_noise(Duration wcet, const Loss &noise) { return (kMargin - 1) * noise.longest + noise.in(wcet); }

// Follows the events of a run twice. In the first pass it judges executions and responses; in the second one it looks
// at what happened during the worst responses.
class AssumptionWatch {
 public:
  /// `run` must outlive this object.
  AssumptionWatch(const trace::RunInfo &run, const BoundOf &bound_of)
      : refs_(flatten(run.workload)),
        calibrated_(parse_overheads(run.overheads)),
        is_virtual_time_(run.driver == trace::Driver::Simulator),
        first_(run.workload),
        second_(run.workload),
        excess_(refs_.size(), DurationSketch(exact_jobs_of_task(refs_.size()))),
        worst_(refs_.size()),
        during_(refs_.size()) {
    check_.is_calibrated = calibrated_.has_value();
    check_.workers = run.config.workers;
    check_.allowed = calibrated_.value_or(plausible_overheads());
    check_.tasks.resize(refs_.size());
    for (std::size_t t = 0; t < refs_.size(); ++t) {
      check_.tasks[t].task = TaskId(t);
      check_.tasks[t].response.bound = bound_of(TaskId(t));
    }
  }

  void add(std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      if (event.kind == JobEventKind::Released && event.task.value < refs_.size()) see_release(event);
      first_.add(std::span(&event, 1));
      first_.drain_ended([this](const JobRecord &job) { see(measured(job)); });
    }
  }

  /// Ends the first pass. Returns true if there is something to explain in a second one.
  bool conclude() {
    judge_waiting(kNever);
    for (std::size_t t = 0; t < refs_.size(); ++t) {
      ExecutionCheck &execution = check_.tasks[t].execution;
      execution.is_exceeded = is_beyond_noise(excess_[t], execution.jobs, refs_[t].task->wcet, check_.allowed.noise);
    }
    return std::any_of(worst_.begin(), worst_.end(), [](const auto &worst) { return worst.has_value(); });
  }

  void explain(std::span<const JobEvent> events) {
    second_.add(events);
    second_.drain_ended([this](const JobRecord &ended) {
      const JobRecord job = measured(ended);
      for (std::size_t t = 0; t < refs_.size(); ++t) {
        if (worst_[t]) look(job, *worst_[t], during_[t]);
      }
    });
  }

  AssumptionCheck take() {
    for (std::size_t t = 0; t < refs_.size(); ++t) {
      if (worst_[t]) explain(*worst_[t], during_[t], check_.tasks[t].response);
    }
    return std::move(check_);
  }

 private:
  static constexpr std::size_t kMostWaiting = std::size_t{1} << 16U;

  struct LateRelease {
    Time release = 0;  // nominal
    Duration lateness = 0;
  };
  /// An execution above its wcet, of which it is open whether the machine stood still during it.
  struct Above {
    TaskId task;
    Time start = 0;
    Time finish = 0;
    Duration excess = 0;
  };
  /// What happened between the release and the finish of the worst job of a task.
  struct During {
    Duration wcet = 0;
    Duration late = 0;
    Duration lost = 0;
    std::uint64_t jobs = 0;  // whose processor time is known
    Duration largest = 0;
    std::uint64_t sequence = 0;  // of the job with the largest excess
    TaskId culprit;
    Duration used = 0;
  };

  [[nodiscard]] JobRecord measured(JobRecord job) const {
    if (is_virtual_time_) job.processor = job.on_worker;  // nothing else runs there
    return job;
  }

  // A job waits for its judgement until no release during it can still be seen: the timer sees them in their order.
  void see_release(const JobEvent &event) {
    if (refs_[event.task.value].task->activation != Activation::Timer) return;
    judge_waiting(event.value);
    const Duration lateness = event.time - event.value;
    if (lateness <= check_.allowed.lateness) return;
    // Jobs end after the last release: of earlier ones, only later ones than all that follow can matter.
    auto at = std::upper_bound(late_.begin(), late_.end(), event.value,
                               [](Time release, const LateRelease &late) { return release < late.release; });
    const auto is_later = [&](const LateRelease &late) { return late.lateness >= lateness; };
    if (std::any_of(at, late_.end(), is_later)) return;
    const auto first = std::find_if_not(std::make_reverse_iterator(at), late_.rend(),
                                        [&](const LateRelease &late) { return late.lateness <= lateness; });
    at = late_.erase(first.base(), at);
    late_.insert(at, {event.value, lateness});
    if (late_.size() > kMostWaiting) late_.erase(late_.begin());
  }

  void see(const JobRecord &job) {
    if (job.outcome != JobOutcome::Finished) return;
    see_execution(job);
    ResponseCheck &response = check_.tasks[job.task.value].response;
    if (response.bound == 0 || job.response() <= response.bound) return;
    ++response.exceeded;
    std::optional<JobRecord> &worst = worst_[job.task.value];
    const bool is_first_of_equals =
        worst && job.response() == response.worst && job.sequence < worst->sequence;  // they need not end in order
    if (job.response() <= response.worst && !is_first_of_equals) return;
    response.worst = job.response();
    worst = job;
  }

  void see_execution(const JobRecord &job) {
    const Duration wcet = refs_[job.task.value].task->wcet;
    if (job.processor == kNever || wcet == 0) return;
    ExecutionCheck &execution = check_.tasks[job.task.value].execution;
    ++execution.jobs;
    execution.longest = std::max(execution.longest, job.processor);
    const Duration above = job.processor - wcet - slack_of(job, check_.allowed);
    if (above <= 0) return;
    ++execution.above;
    waiting_.push_back({job.task, job.start, job.finish, above});
    if (waiting_.size() >= kMostWaiting) judge_waiting(kNever);
  }

  // Judges the executions that ended before `release`.
  void judge_waiting(Time release) {
    if (waiting_.empty()) return;
    std::erase_if(waiting_, [&](const Above &above) {
      if (above.finish >= release) return false;
      if (2 * lateness_during(above) < above.excess) excess_[above.task.value].add(above.excess);
      return true;
    });
  }

  // Returns how late the release timer was while the job ran. No job delays the timer. If it was late by most of the
  // job's excess, the machine stood still, and the kernel charged that time to the job.
  [[nodiscard]] Duration lateness_during(const Above &job) const {
    Duration latest = 0;
    auto late = std::lower_bound(late_.begin(), late_.end(), job.start,
                                 [](const LateRelease &one, Time start) { return one.release < start; });
    for (; late != late_.end() && late->release <= job.finish; ++late) latest = std::max(latest, late->lateness);
    return latest;
  }

  // Adds what a job did between the release and the finish of another one.
  void look(const JobRecord &job, const JobRecord &worst, During &during) const {
    if (!job.has_started() || job.finish == kNever || job.finish <= worst.release || job.start >= worst.finish) return;
    if (job.release >= worst.release) during.late = std::max(during.late, job.seen - job.release);
    if (job.processor == kNever) return;
    const Duration within = std::min(job.finish, worst.finish) - std::max(job.start, worst.release);
    during.lost += std::clamp<Duration>(job.on_worker - job.processor, 0, within);
    ++during.jobs;
    const Duration above = job.processor - refs_[job.task.value].task->wcet;
    if (above <= 0 || !check_.tasks[job.task.value].execution.is_exceeded) return;
    during.wcet += above;
    const bool is_first_of_equals = above == during.largest && job.sequence < during.sequence;
    if (above <= during.largest && !is_first_of_equals) return;
    during.largest = above;
    during.sequence = job.sequence;
    during.culprit = job.task;
    during.used = job.processor;
  }

  // Compares what happened with what was charged, and names the largest excess.
  void explain(const JobRecord &worst, const During &during, ResponseCheck &response) const {
    const Overheads charged = calibrated_.value_or(Overheads());
    const Duration granted = Duration{check_.workers} * charged.stall.in(worst.response()) +
                             static_cast<Duration>(during.jobs) * (charged.dispatch + charged.preempt + charged.timer);
    const Duration release_excess = during.late - charged.lateness;
    const Duration platform_excess = during.lost - granted;
    const Duration most = std::max({during.wcet, release_excess, platform_excess});
    if (most > 0 && most == during.wcet) {
      response.broken = Broken::Wcet;
      response.task = during.culprit;
      response.amount = during.used;
    } else if (most > 0) {
      response.broken = most == release_excess ? Broken::Release : Broken::Platform;
      response.amount = most == release_excess ? during.late : during.lost;
    }
    response.is_alarm =
        response.broken == Broken::Wcet || response.worst > response.bound + check_.unalarming(response.worst);
  }

  std::vector<TaskRef> refs_;
  std::optional<Overheads> calibrated_;
  bool is_virtual_time_;
  JobFolder first_;
  JobFolder second_;
  std::vector<LateRelease> late_;                // in order of release, with decreasing lateness
  std::vector<Above> waiting_;                   // executions that are not judged yet
  std::vector<DurationSketch> excess_;           // by TaskId, of executions above the wcet
  std::vector<std::optional<JobRecord>> worst_;  // by TaskId, of responses above the bound
  std::vector<During> during_;                   // by TaskId
  AssumptionCheck check_;
};

// True if `count` of `jobs` executions meet more noise than can be expected.
bool is_too_often(std::uint64_t count, std::uint64_t jobs, Duration excess, Duration wcet, const Loss &noise) {
  const auto expected = static_cast<double>(noise.in(wcet)-noise.longest);
  const double mean = static_cast<double>(jobs) * std::min(1.0, expected / static_cast<double>(excess));
  // Allows five standard deviations, plus four executions in any run.
  return static_cast<double>(count) > mean + 5 * std::sqrt(mean) + 4;
}

std::string on_execution(const ExecutionCheck &execution, Duration wcet) {
  const std::string above = fmt::format("{} of {} exceeded the wcet of {}", format_count(execution.above),
                                        plural(execution.jobs, "execution"), humanize_duration(wcet));
  return execution.is_exceeded
             ? fmt::format("wcet exceeded: {} of processor time, {}", humanize_duration(execution.longest), above)
             : fmt::format("{}, with up to {} of processor time; stalls of the machine can explain this", above,
                           humanize_duration(execution.longest));
}

std::string why(const ResponseCheck &response, const AssumptionCheck &check, const Workload &workload) {
  const std::string amount = humanize_duration(response.amount);
  const auto charged = [&](Duration part) {
    return check.is_calibrated ? fmt::format("the calibration allows {}", humanize_duration(part))
                               : std::string("the analysis allows none");
  };
  switch (response.broken) {
    case Broken::Wcet:
      return fmt::format("wcet exceeded: {} used {} of processor time", trace::task_name(workload, response.task),
                         amount);
    case Broken::Release: return fmt::format("late release: by {} ({})", amount, charged(check.allowed.lateness));
    case Broken::Platform:
      return fmt::format("machine: jobs that held their workers got no processor for {} ({})", amount,
                         charged(check.allowed.stall.longest));
    case Broken::Nothing: break;
  }
  return "every assumption of the bound that can be checked held";
}

std::string on_response(const ResponseCheck &response, const AssumptionCheck &check, const Workload &workload) {
  return fmt::format("{} exceeded the bound of {}, the longest is {}; {}", plural(response.exceeded, "response"),
                     humanize_duration(response.bound), humanize_duration(response.worst),
                     why(response, check, workload));
}

}  // namespace

bool AssumptionCheck::has_alarms() const {
  return std::any_of(tasks.begin(), tasks.end(),
                     [](const TaskCheck &task) { return task.execution.is_exceeded || task.response.is_alarm; });
}

Duration AssumptionCheck::unalarming(Duration response) const {
  if (is_calibrated) return 0;
  const auto jobs = static_cast<Duration>(tasks.size());
  return allowed.lateness + workers * allowed.stall.in(response) +
         jobs * (allowed.dispatch + allowed.preempt + allowed.timer);
}

void AssumptionCheck::add(const AssumptionCheck &other) {
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    ExecutionCheck &execution = tasks[t].execution;
    const ExecutionCheck &more = other.tasks[t].execution;
    execution.jobs += more.jobs;
    execution.above += more.above;
    execution.longest = std::max(execution.longest, more.longest);
    execution.is_exceeded = execution.is_exceeded || more.is_exceeded;
    ResponseCheck &response = tasks[t].response;
    const ResponseCheck &its = other.tasks[t].response;
    const std::uint64_t exceeded = response.exceeded + its.exceeded;
    const bool is_alarm = response.is_alarm || its.is_alarm;
    if (its.worst > response.worst) response = its;
    response.exceeded = exceeded;
    response.is_alarm = is_alarm;
  }
}

bool is_beyond_noise(const DurationSketch &excess, std::uint64_t jobs, Duration wcet, const Loss &noise) {
  const std::vector<CountedDurations> all = excess.counted();
  if (all.empty()) return false;
  if (all.back().high > most_noise(wcet, noise)) return true;
  std::uint64_t count = 0;
  for (auto each = all.rbegin(); each != all.rend(); ++each) {
    count += each->count;
    if (is_too_often(count, jobs, each->low, wcet, noise)) return true;
  }
  return false;
}

bool is_beyond_noise(const ExecutionPercentiles &executions, Duration wcet,
                     const std::optional<Overheads> &calibrated) {
  const Overheads &allowed = calibrated ? *calibrated : plausible_overheads();
  const Duration slack = allowed.clock + kDecision + (wcet <= kShort ? allowed.dispatch : 0);
  if (executions.longest - wcet - slack > most_noise(wcet, allowed.noise)) return true;
  const auto has_excess = [&](Duration percentile, std::uint64_t executions_from_it) {
    // A percentile of the histogram is at most 1/8 above the true one.
    const Duration excess = percentile - percentile / 9 - wcet - slack;
    return excess > 0 && is_too_often(executions_from_it, executions.jobs, excess, wcet, allowed.noise);
  };
  return has_excess(executions.p50, executions.jobs / 2) || has_excess(executions.p99, executions.jobs / 100);
}

Result<AssumptionCheck> check_assumptions(const trace::Recording &run, const BoundOf &bound_of) {
  AssumptionWatch watch(run.info(), bound_of);
  Result<void> read = run.visit([&](std::span<const JobEvent> events) { watch.add(events); });
  if (read && watch.conclude()) read = run.visit([&](std::span<const JobEvent> events) { watch.explain(events); });
  if (!read) return tl::unexpected<Diagnostics>(std::move(read.error()));
  return watch.take();
}

AssumptionCheck check_assumptions(const trace::RunInfo &run, std::span<const JobEvent> events,
                                  const BoundOf &bound_of) {
  AssumptionWatch watch(run, bound_of);
  watch.add(events);
  if (watch.conclude()) watch.explain(events);
  return watch.take();
}

std::vector<Remark> remarks(const AssumptionCheck &check, const Workload &workload) {
  std::vector<Remark> all;
  const std::vector<TaskRef> refs = flatten(workload);
  for (const TaskCheck &task : check.tasks) {
    const std::string name = trace::task_name(workload, task.task) + ": ";
    if (task.execution.above > 0) {
      all.push_back({task.execution.is_exceeded, task.task,
                     name + on_execution(task.execution, refs[task.task.value].task->wcet)});
    }
    if (task.response.exceeded > 0) {
      all.push_back({task.response.is_alarm, task.task, name + on_response(task.response, check, workload)});
    }
  }
  std::stable_partition(all.begin(), all.end(), [](const Remark &remark) { return remark.is_alarm; });
  return all;
}

const char *not_calibrated_hint() {
  return "overheads of the platform are not charged; measure them with 'redag doctor --measure' and charge them with "
         "--overheads";
}

}  // namespace redag::metrics
