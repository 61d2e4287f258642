// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/doctor/measured_jobs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>

#include "redag/engine/preemption_point.hpp"
#include "redag/threads/clock.hpp"
#include "redag_lab/doctor/watch.hpp"

namespace redag::doctor {
namespace {

constexpr Duration kRegion = 200 * kMicrosecond;
constexpr const char *kLong = "long";

// Returns the processor-time clock of the thread of that name; nothing if there is no such thread.
std::optional<clockid_t> clock_of_thread(const std::string &name) {
  std::error_code ignored;
  for (const auto &entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    std::ifstream stream(entry.path() / "comm");
    std::string comm;
    if (!std::getline(stream, comm) || comm != name) continue;
    const auto tid = static_cast<unsigned>(std::stoul(entry.path().filename().string()));
    constexpr unsigned kPerThread = 4;  // bits of a clock id, as in the kernel's include/linux/posix-timers.h
    constexpr unsigned kSchedClock = 2;
    return static_cast<clockid_t>((~tid << 3U) | kPerThread | kSchedClock);
  }
  return std::nullopt;
}

}  // namespace

Workload measured_workload(std::uint32_t workers) {
  Workload workload;
  workload.name = "measurement";
  workload.platform.workers = workers;
  const auto timer = [](const char *name, Duration period, Duration wcet) {
    Task task;
    task.name = name;
    task.period = task.deadline = period;
    task.wcet = task.bcet = wcet;
    return task;
  };
  Dag pulse;
  pulse.name = "pulse";
  pulse.tasks = {timer("tick", kMillisecond, 20 * kMicrosecond), timer("tock", kMillisecond, 20 * kMicrosecond)};
  pulse.tasks[1].activation = Activation::Data;
  pulse.tasks[1].predecessors = {0};
  workload.dags.push_back(std::move(pulse));
  Dag beat;
  beat.name = "beat";
  beat.tasks = {timer("beat", 7 * kMillisecond, 300 * kMicrosecond)};
  workload.dags.push_back(std::move(beat));
  for (std::uint32_t w = 0; w < workers; ++w) {
    Dag dag;
    dag.name = fmt::format("worker{}", w);
    dag.tasks = {timer(kLong, 50 * kMillisecond, 20 * kMillisecond)};
    dag.tasks[0].region = kRegion;
    workload.dags.push_back(std::move(dag));
  }
  return workload;
}

std::vector<runtime::Body> AbsenceRecorder::replace(const Workload &workload, std::vector<runtime::Body> bodies,
                                                    const lab::Now &now) {
  for (const TaskRef &ref : flatten(workload)) {
    if (ref.task->name == kLong) bodies[ref.id.value] = body(*ref.task, ref.id, now);
  }
  return bodies;
}

runtime::Body AbsenceRecorder::body(const Task &task, TaskId id, const lab::Now &now) {
  std::vector<Absence> &absences = absences_[id.value];
  constexpr std::size_t kMost = std::size_t{1} << 15U;
  absences.reserve(kMost);
  return [&absences, now, demand = task.wcet](const runtime::Job & /*job*/) {
    Time last = now();
    Duration next_point = kRegion;
    for (Duration used = job_cpu_time(); used < demand; used = job_cpu_time()) {
      if (used >= next_point) {
        preemption_point();
        next_point = used + kRegion;
      }
      const Time until = now() + std::min(next_point, demand) - used;
      for (Time at = now(); at < until; at = now()) {
        if (at - last >= kShortestGap && absences.size() < kMost) absences.push_back({last, at});
        last = at;
      }
    }
    return sched::Outcome::Finished;
  };
}

TimerWatch::TimerWatch(const Workload &workload) {
  for (const TaskRef &ref : flatten(workload)) is_timer_.push_back(ref.task->activation == Activation::Timer);
}

void TimerWatch::look(std::span<const JobEvent> events) {
  if (!clock_) clock_ = clock_of_thread("redag-timer");
  if (!clock_) return;
  for (; seen_ < events.size(); ++seen_) {
    const JobEvent &event = events[seen_];
    if (event.kind == JobEventKind::Released && is_timer_[event.task.value]) ++releases_;
  }
  const Duration used = runtime::cpu_now(*clock_);
  constexpr std::uint64_t kEnough = 20;  // releases, for a meaningful mean
  if (last_used_ && releases_ >= kEnough) {
    means_.push_back((used - *last_used_) / static_cast<Duration>(releases_));
    releases_ = 0;
    last_used_ = used;
  } else if (!last_used_) {
    releases_ = 0;
    last_used_ = used;
  }
}

}  // namespace redag::doctor
