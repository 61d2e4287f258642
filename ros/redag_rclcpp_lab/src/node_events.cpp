// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "node_events.hpp"

#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>

namespace redag_rclcpp::lab {

using redag::Activation;
using redag::Dag;
using redag::JobEvent;
using redag::JobEventKind;
using redag::kNever;
using redag::Reason;
using redag::Task;
using redag::TaskId;
using redag::Time;

namespace {

// A time in which a body had no processor.
struct Absence {
  Time from = 0;
  Time to = kNever;
};

// A body, put together from its events.
struct Body {
  std::uint32_t job = 0;
  std::uint32_t worker = 0;
  Time trigger = 0;
  Time start = 0;
  Time end = kNever;
  bool aborted = false;
  Reason reason = Reason::None;
  std::vector<Absence> absences{};
};

struct Job {
  Time release = 0;
  Time ready = kNever;
  Time origin = 0;
  const Body *body = nullptr;
};

struct TaskJobs {
  const Task *task = nullptr;
  std::vector<Body> bodies;  // ordered by start
  std::vector<Job> jobs;     // ordered by release
};

// The completion of a predecessor's job.
struct Completion {
  Time time = 0;
  Time release = 0;
  Time origin = 0;
  std::size_t input = 0;
};

// Order of events of the same time. Dispatched precedes a release that the executor overlooked meanwhile.
int phase_of(JobEventKind kind) {
  switch (kind) {
    case JobEventKind::Finished:
    case JobEventKind::Aborted: return 0;
    case JobEventKind::Resumed: return 1;
    case JobEventKind::Released: return 2;
    case JobEventKind::Skipped: return 3;
    case JobEventKind::Ready: return 4;
    case JobEventKind::Preempted: return 5;
    case JobEventKind::Deferred:
    case JobEventKind::Dispatched: return 6;
    case JobEventKind::Started: return 7;
    case JobEventKind::Exceeded:
    case JobEventKind::HighMode:
    case JobEventKind::LowMode:
    case JobEventKind::Executed:
    case JobEventKind::Waits:
    case JobEventKind::Served:
    case JobEventKind::Woken: break;  // nodes do not record these
  }
  return 8;
}

class Assembly {
 public:
  Assembly(const redag::Workload &workload, const NodeEventsOptions &options) : options_(options) {
    for (const Dag &dag : workload.dags) {
      for (const Task &task : dag.tasks) tasks_.push_back(TaskJobs{&task, {}, {}});
    }
  }

  void collect(std::span<const JobEvent> events) {
    std::vector<JobEvent> sorted(events.begin(), events.end());
    std::stable_sort(sorted.begin(), sorted.end(), [](const JobEvent &a, const JobEvent &b) {
      // Bodies of one task do not overlap: its Started and Finished events alternate.
      return std::pair(a.time, a.kind == JobEventKind::Started) < std::pair(b.time, b.kind == JobEventKind::Started);
    });
    for (const JobEvent &event : sorted) {
      std::vector<Body> &bodies = tasks_[event.task.value].bodies;
      if (event.kind == JobEventKind::Started) {
        bodies.push_back({.job = event.job, .worker = event.worker, .trigger = event.value, .start = event.time});
      } else if (bodies.empty()) {
        continue;
      } else if (event.kind == JobEventKind::Preempted) {
        bodies.back().absences.push_back(Absence{event.time});
      } else if (event.kind == JobEventKind::Resumed) {
        if (!bodies.back().absences.empty()) bodies.back().absences.back().to = event.time;
      } else {
        bodies.back().end = event.time;
        bodies.back().aborted = event.kind == JobEventKind::Aborted;
        bodies.back().reason = event.reason;
      }
    }
  }

  // Derives the jobs in topological order: a task's releases follow from its predecessors' completions.
  void derive(const Dag &dag, std::size_t first) {
    const std::vector<std::uint32_t> ranks = redag::topological_ranks(dag);
    std::vector<std::size_t> order(dag.tasks.size());
    for (std::size_t i = 0; i < ranks.size(); ++i) order[ranks[i]] = i;
    for (const std::size_t i : order) {
      TaskJobs &task = tasks_[first + i];
      const std::vector<Completion> data = completions(dag.tasks[i], first);
      if (task.task->activation == Activation::Data) {
        release_by_data(task, data);
      } else {
        release_by_timer(task);
        if (!task.task->predecessors.empty()) find_ready(task, data, aligned_inputs(dag, dag.tasks[i]));
      }
    }
  }

  std::vector<JobEvent> emit() {
    for (std::size_t t = 0; t < tasks_.size(); ++t) emit(tasks_[t], TaskId(t));
    sort();
    add_preemptions();
    sort();
    const auto after =
        std::find_if(events_.begin(), events_.end(), [&](const JobEvent &event) { return event.time >= options_.end; });
    events_.erase(after, events_.end());
    return std::move(events_);
  }

 private:
  [[nodiscard]] std::vector<Completion> completions(const Task &task, std::size_t first) const {
    std::vector<Completion> all;
    for (std::size_t input = 0; input < task.predecessors.size(); ++input) {
      for (const Job &job : tasks_[first + task.predecessors[input]].jobs) {
        if (job.body == nullptr || job.body->aborted || job.body->end == kNever) continue;
        all.push_back(Completion{job.body->end, job.release, job.origin, input});
      }
    }
    std::stable_sort(all.begin(), all.end(), [](const auto &a, const auto &b) { return a.time < b.time; });
    return all;
  }

  static std::vector<bool> aligned_inputs(const Dag &dag, const Task &task) {
    std::vector<bool> aligned;
    for (const std::uint32_t p : task.predecessors) {
      const Task &from = dag.tasks[p];
      aligned.push_back(from.activation == Activation::Timer && from.period == task.period &&
                        from.offset == task.offset);
    }
    return aligned;
  }

  void release_by_data(TaskJobs &task, const std::vector<Completion> &data) const {
    const std::size_t inputs = task.task->predecessors.size();
    std::vector<Completion> latest(inputs);
    std::vector<bool> fresh(inputs, false);
    for (const Completion &completion : data) {
      fresh[completion.input] = true;
      latest[completion.input] = completion;
      if (std::find(fresh.begin(), fresh.end(), false) != fresh.end()) continue;
      fresh.assign(inputs, false);
      Job job{completion.time, completion.time, kNever, nullptr};
      for (const Completion &input : latest) job.origin = std::min(job.origin, input.origin);
      task.jobs.push_back(job);
    }
    // Assigns a body to the latest release up to its data. Between the data of two bodies of a join every predecessor
    // completed a job. Two bodies therefore find different releases.
    for (const Body &body : task.bodies) {
      const auto next = std::upper_bound(task.jobs.begin(), task.jobs.end(), body.trigger,
                                         [](Time trigger, const Job &job) { return trigger < job.release; });
      if (next != task.jobs.begin() && std::prev(next)->body == nullptr) std::prev(next)->body = &body;
    }
  }

  void release_by_timer(TaskJobs &task) const {
    for (Time release = task.task->offset; release < options_.end; release += task.task->period) {
      task.jobs.push_back(Job{release, release, release, nullptr});
    }
    for (Body &body : task.bodies) {
      if (body.job >= task.jobs.size()) continue;
      Job &job = task.jobs[body.job];
      job.body = &body;
      if (body.start < job.release && body.start >= job.release - options_.phase_error) body.start = job.release;
      body.end = std::max(body.end, body.start);
    }
  }

  // Finds when jobs of timer tasks with predecessors become ready: docs/model.md, "Readiness".
  static void find_ready(TaskJobs &task, const std::vector<Completion> &data, const std::vector<bool> &aligned) {
    std::vector<Completion> latest(aligned.size());
    std::vector<bool> fresh(aligned.size(), false);
    auto completion = data.begin();
    const auto take = [&] {
      fresh[completion->input] = true;
      latest[completion->input] = *completion;
      ++completion;
    };
    for (std::size_t k = 0; k < task.jobs.size(); ++k) {
      Job &job = task.jobs[k];
      job.ready = kNever;
      const auto become_ready = [&](Time time) {
        job.ready = time;
        for (const Completion &input : latest) job.origin = std::min(job.origin, input.origin);
        fresh.assign(fresh.size(), false);
      };
      const auto complete = [&] {
        for (std::size_t i = 0; i < fresh.size(); ++i) {
          if (!fresh[i] || (aligned[i] && latest[i].release < job.release)) return false;
        }
        return true;
      };
      while (completion != data.end() && completion->time <= job.release) take();
      if (complete()) become_ready(job.release);
      const Time until = k + 1 < task.jobs.size() ? task.jobs[k + 1].release : kNever;
      while (completion != data.end() && completion->time <= until) {
        const Time time = completion->time;
        take();
        if (job.ready == kNever && complete()) become_ready(time);
      }
      // The body ran earlier than the model predicts, on newer data.
      if (job.body != nullptr && (job.ready == kNever || job.ready > job.body->start)) job.ready = job.body->start;
      if (job.body == nullptr && job.ready != kNever) fresh.assign(fresh.size(), true);  // no body used its data
    }
  }

  void emit(const TaskJobs &task, TaskId id) {
    std::size_t last_run = 0;  // one past the last job that ran
    for (std::size_t k = 0; k < task.jobs.size(); ++k) {
      if (task.jobs[k].body != nullptr) last_run = k + 1;
    }
    Time not_before = 0;  // one past the start of the previous job and the releases overlooked before it
    for (std::size_t k = 0; k < task.jobs.size(); ++k) {
      const Job &job = task.jobs[k];
      const auto number = static_cast<std::uint32_t>(k);
      const auto add = [&](Time time, JobEventKind kind, redag::Time value, std::uint32_t worker, Reason reason) {
        events_.push_back(JobEvent{time, value, id, number, worker, kind, reason});
      };
      constexpr std::uint32_t kNobody = redag::WorkerId::kNoneValue;
      const Time released = std::max(job.release, not_before);
      add(released, JobEventKind::Released, job.release, kNobody, Reason::None);
      // Overlooked releases get different times: each one ends the job before it, and equal times would end all of them
      // at once.
      if (released > job.release) not_before = released + 1;
      const Time next = k + 1 < task.jobs.size() ? std::max(task.jobs[k + 1].release, not_before) : kNever;
      if (job.ready != kNever && (job.body != nullptr || job.ready < next)) {
        add(std::max(job.ready, released), JobEventKind::Ready, job.origin, kNobody, Reason::None);
      }
      if (job.body != nullptr) {
        const Body &body = *job.body;
        add(body.start, JobEventKind::Dispatched, job.release + task.task->deadline, body.worker, Reason::None);
        add(body.start, JobEventKind::Started, body.start, body.worker, Reason::None);
        for (const Absence &absence : body.absences) {
          // Keeps the absence strictly within the body: at equal times, the sort would place its events before Started
          // or after Finished.
          const Time from = std::max(absence.from, body.start + 1);
          const Time to = std::min(absence.to, body.end - 1);
          if (from >= to) continue;
          add(from, JobEventKind::Preempted, 0, body.worker, Reason::None);
          add(to, JobEventKind::Resumed, 0, body.worker, Reason::None);
        }
        if (body.end != kNever) {
          add(body.end, body.aborted ? JobEventKind::Aborted : JobEventKind::Finished, body.end, body.worker,
              body.reason);
        }
        not_before = std::max(not_before, body.start + 1);
      } else if (next != kNever && (k < last_run || !options_.timers_queue)) {
        const bool was_ready = job.ready != kNever && job.ready < next;
        add(std::max(next, released), JobEventKind::Skipped, 0, kNobody,
            was_ready ? Reason::Overrun : Reason::Precedence);
      }
    }
  }

  // Adds preemptions by bodies that begin on a thread inside another body (cooperative preemption).
  void add_preemptions() {
    std::map<std::uint32_t, std::vector<JobEvent>> stacks;  // indexed by worker
    std::vector<JobEvent> more;
    const auto note = [&](JobEvent event, Time time, JobEventKind kind) {
      event.time = time;
      event.kind = kind;
      event.value = 0;
      event.reason = Reason::None;
      more.push_back(event);
    };
    for (const JobEvent &event : events_) {
      if (event.kind == JobEventKind::Dispatched) {
        std::vector<JobEvent> &stack = stacks[event.worker];
        if (!stack.empty()) note(stack.back(), event.time, JobEventKind::Preempted);
        stack.push_back(event);
      } else if (event.kind == JobEventKind::Finished || event.kind == JobEventKind::Aborted) {
        std::vector<JobEvent> &stack = stacks[event.worker];
        if (!stack.empty()) stack.pop_back();
        if (!stack.empty()) note(stack.back(), event.time, JobEventKind::Resumed);
      }
    }
    events_.insert(events_.end(), more.begin(), more.end());
  }

  void sort() {
    std::stable_sort(events_.begin(), events_.end(), [](const JobEvent &a, const JobEvent &b) {
      return std::pair(a.time, phase_of(a.kind)) < std::pair(b.time, phase_of(b.kind));
    });
  }

  const NodeEventsOptions &options_;
  std::vector<TaskJobs> tasks_;  // indexed by TaskId
  std::vector<JobEvent> events_;
};

}  // namespace

std::vector<JobEvent> node_events(const redag::Workload &workload, std::span<const JobEvent> bodies,
                                  const NodeEventsOptions &options) {
  Assembly assembly(workload, options);
  assembly.collect(bodies);
  std::size_t first = 0;
  for (const Dag &dag : workload.dags) {
    assembly.derive(dag, first);
    first += dag.tasks.size();
  }
  return assembly.emit();
}

}  // namespace redag_rclcpp::lab
