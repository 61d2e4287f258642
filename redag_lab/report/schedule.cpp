// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/schedule.hpp"

#include <algorithm>
#include <optional>

namespace redag::report {
namespace {

using metrics::JobOutcome;
using metrics::JobRecord;

// Folds the events of a trace into slices: jobs on workers.
class SliceFolder {
 public:
  explicit SliceFolder(const trace::Trace &trace) : open_(trace.info.workload.task_count()) {
    for (const JobEvent &event : trace.events) {
      last_ = std::max(last_, event.time);
      if (event.task.value < open_.size()) add(event);
    }
    last_ = std::max(last_, trace.info.end);
    for (const std::vector<Slice> &task : open_) {
      for (Slice slice : task) {
        slice.end = last_;
        slices_.push_back(slice);
      }
    }
    std::stable_sort(slices_.begin(), slices_.end(), [](const Slice &a, const Slice &b) { return a.begin < b.begin; });
  }

  std::vector<Slice> take() { return std::move(slices_); }

 private:
  void add(const JobEvent &event) {
    switch (event.kind) {
      case JobEventKind::Dispatched:
      case JobEventKind::Started:
      case JobEventKind::Resumed: begin(event); break;
      case JobEventKind::Waits: end(event, event.time, Slice::End::Waits); break;
      case JobEventKind::Preempted: end(event, event.time, Slice::End::Preempted); break;
      case JobEventKind::Finished: end(event, event.value, Slice::End::Finished); break;
      case JobEventKind::Aborted: end(event, event.time, Slice::End::Aborted); break;
      default: break;
    }
  }

  void begin(const JobEvent &event) {
    std::vector<Slice> &task = open_[event.task.value];
    const auto same = [&](const Slice &slice) { return slice.job == event.job; };
    // Dispatched is followed by Started; the decision and the body form one slice.
    if (std::any_of(task.begin(), task.end(), same)) return;
    task.push_back(Slice{event.time, event.time, event.task, event.job, event.worker, Slice::End::Open});
  }

  void end(const JobEvent &event, Time time, Slice::End how) {
    std::vector<Slice> &task = open_[event.task.value];
    const auto slice = std::find_if(task.begin(), task.end(), [&](const Slice &s) { return s.job == event.job; });
    if (slice == task.end()) return;
    slice->end = std::max(slice->begin, time);
    slice->how = how;
    slices_.push_back(*slice);
    task.erase(slice);
  }

  std::vector<std::vector<Slice>> open_;  // by task
  std::vector<Slice> slices_;
  Time last_ = 0;
};

Time end_of(const JobRecord &job, Time run_end) { return job.finish == kNever ? run_end : job.finish; }

class Chooser {
 public:
  Chooser(const trace::Trace &trace, std::span<const JobRecord> jobs, std::size_t most)
      : trace_(trace),
        jobs_(jobs),
        most_(std::max<std::size_t>(most, 1)),
        slices_(slices_of(trace)),
        services_(services_of(trace)) {
    begin_ = trace.info.start;
    end_ = trace.info.end;
    for (const Slice &slice : slices_) end_ = std::max(end_, slice.end);
  }

  Schedule choose(std::size_t most_views) {
    Schedule schedule;
    schedule.slices_in_all = slices_.size();
    const std::vector<const JobRecord *> worst = worst_of_each_dag(most_views);
    const bool whole = slices_.size() <= most_ && jobs_.size() <= 2 * most_;
    // The first window is the beginning; each worst job gets an equal share.
    const std::size_t share = std::max<std::size_t>(1, most_ / (worst.size() + 1));
    schedule.windows.push_back(whole ? window(begin_, end_, most_) : window_at(0, share, share));
    const Window &first = schedule.windows.front();
    schedule.views.push_back(View{0, first.begin, first.end, {}, 0, 0});
    for (const JobRecord *job : worst) {
      View view{0, begin_, end_, job->task, job->number, job->lateness()};
      if (!whole) {
        view.window = schedule.windows.size();
        schedule.windows.push_back(window_around(*job, share));
      }
      const Window &seen = schedule.windows[view.window];
      // The view adds the job's length before and after the job.
      const Duration length = std::max<Duration>(job->finish - job->release, job->deadline - job->release);
      view.begin = std::max(seen.begin, job->release - length);
      view.end = std::min(seen.end, std::max(job->finish, job->deadline) + length);
      schedule.views.push_back(view);
    }
    for (const Window &each : schedule.windows) schedule.slices_shown += each.slices.size();
    return schedule;
  }

 private:
  // Returns the finished job of each DAG with the largest lateness, as a share of the relative deadline.
  std::vector<const JobRecord *> worst_of_each_dag(std::size_t most_views) const {
    struct Worst {
      const JobRecord *job = nullptr;
      double share = 0;
    };
    const std::vector<TaskRef> refs = flatten(trace_.info.workload);
    std::vector<Worst> worst(trace_.info.workload.dags.size());
    for (const JobRecord &job : jobs_) {
      if (job.outcome != JobOutcome::Finished) continue;
      const Duration relative = std::max<Duration>(1, job.deadline - job.release);
      const double share = static_cast<double>(job.lateness()) / static_cast<double>(relative);
      Worst &dag = worst[refs[job.task.value].dag.value];
      if (dag.job == nullptr || share > dag.share) dag = {&job, share};
    }
    std::erase_if(worst, [](const Worst &dag) { return dag.job == nullptr; });
    std::stable_sort(worst.begin(), worst.end(), [](const Worst &a, const Worst &b) { return a.share > b.share; });
    worst.resize(std::min(worst.size(), most_views));
    std::vector<const JobRecord *> jobs;
    jobs.reserve(worst.size());
    for (const Worst &dag : worst) jobs.push_back(dag.job);
    return jobs;
  }

  // Returns the window of `count` slices from slice `first` on.
  Window window_at(std::size_t first, std::size_t count, std::size_t share) const {
    if (slices_.empty()) return window(begin_, end_, share);
    first = std::min(first, slices_.size() - 1);
    const std::size_t last = std::min(first + count, slices_.size()) - 1;
    return window(first == 0 ? begin_ : slices_[first].begin, last + 1 == slices_.size() ? end_ : slices_[last].begin,
                  share);
  }

  Window window_around(const JobRecord &job, std::size_t share) const {
    const auto at = std::lower_bound(slices_.begin(), slices_.end(), job.finish,
                                     [](const Slice &slice, Time time) { return slice.begin < time; });
    const auto index = static_cast<std::size_t>(at - slices_.begin());
    const std::size_t before = share * 3 / 4;
    return window_at(index > before ? index - before : 0, share, share);
  }

  // Returns the jobs and slices in [begin, end]. The window is cut short if they exceed a share.
  Window window(Time begin, Time end, std::size_t share) const {
    Window window{begin, end, {}, {}, {}};
    for (const JobRecord &job : jobs_) {
      if (job.release >= window.end || end_of(job, end_) < begin) continue;
      if (window.jobs.size() == 2 * share) {
        window.end = job.release;
        break;
      }
      window.jobs.push_back(job);
    }
    for (const Slice &slice : slices_) {
      if (slice.begin > window.end) break;
      if (slice.end >= begin) window.slices.push_back(slice);
    }
    for (const Service &service : services_) {
      if (service.begin > window.end) break;
      if (service.end >= begin) window.services.push_back(service);
    }
    return window;
  }

  const trace::Trace &trace_;
  std::span<const JobRecord> jobs_;
  std::size_t most_;
  std::vector<Slice> slices_;
  std::vector<Service> services_;
  Time begin_ = 0;
  Time end_ = 0;
};

}  // namespace

std::vector<Slice> slices_of(const trace::Trace &trace) { return SliceFolder(trace).take(); }

Schedule schedule_of(const trace::Trace &trace, std::span<const JobRecord> jobs, std::size_t most,
                     std::size_t most_views) {
  return Chooser(trace, jobs, most).choose(most_views);
}

}  // namespace redag::report
