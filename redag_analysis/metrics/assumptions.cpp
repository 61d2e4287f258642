// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/assumptions.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include <fmt/format.h>

#include "redag/base/text.hpp"

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

class Checker {
 public:
  Checker(const Workload &workload, std::uint32_t workers, const std::optional<Overheads> &calibrated,
          std::span<const JobRecord> jobs)
      : refs_(flatten(workload)), workers_(workers), calibrated_(calibrated), jobs_(jobs) {
    check_.is_calibrated = calibrated.has_value();
    check_.workers = workers;
    check_.allowed = calibrated.value_or(plausible_overheads());
    check_.tasks.resize(refs_.size());
    for (std::size_t t = 0; t < refs_.size(); ++t) check_.tasks[t].task = TaskId(t);
  }

  AssumptionCheck run(const BoundOf &bound_of) {
    find_late_releases();
    check_executions();
    std::vector<const JobRecord *> worst(refs_.size());
    for (TaskCheck &task : check_.tasks) task.response.bound = bound_of(task.task);
    for (const JobRecord &job : jobs_) {
      ResponseCheck &response = check_.tasks[job.task.value].response;
      if (job.outcome != JobOutcome::Finished || response.bound == 0 || job.response() <= response.bound) continue;
      ++response.exceeded;
      if (job.response() <= response.worst) continue;
      response.worst = job.response();
      worst[job.task.value] = &job;
    }
    for (std::size_t t = 0; t < worst.size(); ++t) {
      if (worst[t] != nullptr) explain(*worst[t], check_.tasks[t].response);
    }
    return std::move(check_);
  }

 private:
  void check_executions() {
    std::vector<std::vector<Duration>> excess(refs_.size());
    for (const JobRecord &job : jobs_) {
      const Duration wcet = refs_[job.task.value].task->wcet;
      if (job.processor == kNever || job.outcome != JobOutcome::Finished || wcet == 0) continue;
      ExecutionCheck &execution = check_.tasks[job.task.value].execution;
      ++execution.jobs;
      execution.longest = std::max(execution.longest, job.processor);
      const Duration above = job.processor - wcet - slack_of(job, check_.allowed);
      if (above > 0) {
        ++execution.above;
        if (2 * lateness_during(job) < above) excess[job.task.value].push_back(above);
      }
    }
    for (std::size_t t = 0; t < refs_.size(); ++t) {
      ExecutionCheck &execution = check_.tasks[t].execution;
      execution.is_exceeded =
          is_beyond_noise(std::move(excess[t]), execution.jobs, refs_[t].task->wcet, check_.allowed.noise);
    }
  }

  // Collects the releases that came later than the calibrated lateness.
  void find_late_releases() {
    for (const JobRecord &job : jobs_) {
      const bool is_timer = refs_[job.task.value].task->activation == Activation::Timer;
      if (!is_timer || job.seen == kNever || job.seen - job.release <= check_.allowed.lateness) continue;
      late_.emplace_back(job.release, job.seen - job.release);
    }
    std::sort(late_.begin(), late_.end());
  }

  // Returns how late the release timer was while the job ran. No job delays the timer. If it was late by most of the
  // job's excess, the machine stood still, and the kernel charged that time to the job.
  [[nodiscard]] Duration lateness_during(const JobRecord &job) const {
    Duration latest = 0;
    auto late = std::lower_bound(late_.begin(), late_.end(), std::pair(job.start, Duration{0}));
    for (; late != late_.end() && late->first <= job.finish; ++late) latest = std::max(latest, late->second);
    return latest;
  }

  // Compares what happened between the job's release and its finish with what was charged, and names the largest
  // excess.
  void explain(const JobRecord &worst, ResponseCheck &response) const {
    const Overheads charged = calibrated_.value_or(Overheads());
    Duration wcet = 0;
    Duration late = 0;
    Duration lost = 0;
    Duration granted = workers_ * charged.stall.in(worst.response());
    Duration largest = 0;
    TaskId culprit;
    Duration used = 0;
    for (const JobRecord &job : jobs_) {
      if (!job.has_started() || job.finish == kNever || job.finish <= worst.release || job.start >= worst.finish) {
        continue;
      }
      if (job.release >= worst.release || &job == &worst) late = std::max(late, job.seen - job.release);
      if (job.processor == kNever) continue;
      const Duration within = std::min(job.finish, worst.finish) - std::max(job.start, worst.release);
      lost += std::clamp<Duration>(job.on_worker - job.processor, 0, within);
      granted += charged.dispatch + charged.preempt + charged.timer;
      const Duration above = job.processor - refs_[job.task.value].task->wcet;
      if (above <= 0 || !check_.tasks[job.task.value].execution.is_exceeded) continue;
      wcet += above;
      if (above <= largest) continue;
      largest = above;
      culprit = job.task;
      used = job.processor;
    }
    const Duration release_excess = late - charged.lateness;
    const Duration platform_excess = lost - granted;
    const Duration most = std::max({wcet, release_excess, platform_excess});
    if (most > 0 && most == wcet) {
      response.broken = Broken::Wcet;
      response.task = culprit;
      response.amount = used;
    } else if (most > 0) {
      response.broken = most == release_excess ? Broken::Release : Broken::Platform;
      response.amount = most == release_excess ? late : lost;
    }
    response.is_alarm =
        response.broken == Broken::Wcet || response.worst > response.bound + check_.unalarming(response.worst);
  }

  std::vector<TaskRef> refs_;
  Duration workers_;
  std::optional<Overheads> calibrated_;
  std::span<const JobRecord> jobs_;
  std::vector<std::pair<Time, Duration>> late_;  // nominal release and lateness, ordered by release
  AssumptionCheck check_;
};

// True if `count` of `jobs` executions meet more noise than can be expected.
bool is_too_often(std::uint64_t count, std::uint64_t jobs, Duration excess, Duration wcet, const Loss &noise) {
  const auto expected = static_cast<double>(noise.in(wcet)-noise.longest);
  const double mean = static_cast<double>(jobs) * std::min(1.0, expected / static_cast<double>(excess));
  // Allows five standard deviations, plus four executions in any run.
  return static_cast<double>(count) > mean + 5 * std::sqrt(mean) + 4;
}

std::string plural(std::uint64_t count, const char *noun) {
  return fmt::format("{} {}{}", format_count(count), noun, count == 1 ? "" : "s");
}

std::string on_execution(const ExecutionCheck &execution, Duration wcet) {
  const std::string above = fmt::format("{} of {} exceeded its wcet of {}", format_count(execution.above),
                                        plural(execution.jobs, "execution"), humanize_duration(wcet));
  return execution.is_exceeded
             ? fmt::format("wcet exceeded: {} of processor time, {}", humanize_duration(execution.longest), above)
             : fmt::format("{}, with up to {} of processor time; stalls of the machine can explain this", above,
                           humanize_duration(execution.longest));
}

std::string why(const ResponseCheck &response, const AssumptionCheck &check, const Workload &workload) {
  const std::string amount = humanize_duration(response.amount);
  const auto charged = [&](Duration part) {
    return check.is_calibrated ? fmt::format("calibrated: {}", humanize_duration(part))
                               : std::string("none was charged");
  };
  switch (response.broken) {
    case Broken::Wcet:
      return fmt::format("wcet exceeded: {} used {} of processor time", trace::task_name(workload, response.task),
                         amount);
    case Broken::Release: return fmt::format("late release: by {} ({})", amount, charged(check.allowed.lateness));
    case Broken::Platform:
      return fmt::format("platform: jobs that held their workers received no processor for {} ({})", amount,
                         charged(check.allowed.stall.longest));
    case Broken::Nothing: break;
  }
  return "no assumption of the bound was seen to fail";
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

bool is_beyond_noise(std::vector<Duration> excess, std::uint64_t jobs, Duration wcet, const Loss &noise) {
  if (excess.empty()) return false;
  std::sort(excess.begin(), excess.end(), std::greater<>());
  if (excess.front() > most_noise(wcet, noise)) return true;
  for (std::size_t i = 0; i < excess.size(); ++i) {
    if (is_too_often(i + 1, jobs, excess[i], wcet, noise)) return true;
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

AssumptionCheck check_assumptions(const Workload &workload, std::uint32_t workers,
                                  const std::optional<Overheads> &calibrated, std::span<const JobRecord> jobs,
                                  const BoundOf &bound_of) {
  return Checker(workload, workers, calibrated, jobs).run(bound_of);
}

AssumptionCheck check_assumptions(const trace::RunInfo &run, std::span<const JobEvent> events,
                                  const BoundOf &bound_of) {
  std::vector<JobRecord> jobs = fold_jobs(run.workload, events);
  if (run.driver == trace::Driver::Simulator) {
    for (JobRecord &job : jobs) job.processor = job.on_worker;  // nothing else runs there
  }
  return check_assumptions(run.workload, run.config.workers, parse_overheads(run.overheads), jobs, bound_of);
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
  return "overheads of the platform are not charged; measure them with 'redag calibrate' and charge them with "
         "--overheads";
}

}  // namespace redag::metrics
