// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/schedule.hpp"

#include <algorithm>
#include <deque>
#include <queue>
#include <tuple>

namespace redag::report {
namespace {

using metrics::JobRecord;

// Keeps what is nearest to an instant, of stretches of time that come in order of their end.
template <class What>
class Nearest {
 public:
  Nearest(Time instant, std::size_t most_before, std::size_t most_after)
      : instant_(instant), most_before_(most_before), most_after_(most_after) {}

  void add(const What &what, Time begin, Time end) {
    if (begin < instant_) {
      before_.push_back({what, begin, end});
      if (before_.size() <= most_before_) return;
      begin_ = std::max(begin_, before_.front().end + 1);
      before_.pop_front();
    } else {
      after_.push({what, begin, end});
      if (after_.size() <= most_after_) return;
      end_ = std::min(end_, after_.top().begin);
      after_.pop();
    }
  }

  /// Narrows [begin, end) to where nothing was left out.
  void narrow(Window &window) const {
    window.begin = std::max(window.begin, begin_);
    window.end = std::min(window.end, end_);
  }

  /// Moves out what is in the window.
  [[nodiscard]] std::vector<What> take(const Window &window) {
    std::vector<What> found;
    const auto add = [&](const Stretch &one) {
      if (one.begin < window.end && one.end >= window.begin) found.push_back(one.what);
    };
    for (const Stretch &one : before_) add(one);
    for (; !after_.empty(); after_.pop()) add(after_.top());
    return found;
  }

 private:
  struct Stretch {
    What what;
    Time begin = 0;
    Time end = 0;

    friend bool operator<(const Stretch &a, const Stretch &b) { return a.begin < b.begin; }
  };

  Time instant_;
  std::size_t most_before_;
  std::size_t most_after_;
  Time begin_ = -kNever;
  Time end_ = kNever;
  std::deque<Stretch> before_;
  std::priority_queue<Stretch> after_;
};

// Fills a window around an instant, with room for so many slices that begin before and after it.
class Filler {
 public:
  Filler(Time instant, std::size_t before, std::size_t after, Time run_end)
      : slices_(instant, before, after), jobs_(instant, 2 * before, 2 * after), run_end_(run_end) {}

  void add(const Slice &slice) {
    slices_.add(slice, slice.begin, slice.end);
    run_end_ = std::max(run_end_, slice.end);  // a job in progress at the end may have gone on
  }
  void add(const JobRecord &job) { jobs_.add(job, job.release, job.finish == kNever ? run_end_ : job.finish); }

  [[nodiscard]] Window take(Time begin) {
    Window window{.begin = begin, .end = run_end_ + 1, .slices = {}, .jobs = {}};
    slices_.narrow(window);
    jobs_.narrow(window);
    window.slices = slices_.take(window);
    window.jobs = jobs_.take(window);
    window.end = std::min(window.end, run_end_);
    std::sort(window.slices.begin(), window.slices.end(), [](const Slice &a, const Slice &b) {
      return std::tie(a.begin, a.end, a.task, a.device) < std::tie(b.begin, b.end, b.task, b.device);
    });
    std::sort(window.jobs.begin(), window.jobs.end(),
              [](const JobRecord &a, const JobRecord &b) { return a.sequence < b.sequence; });
    return window;
  }

 private:
  Nearest<Slice> slices_;
  Nearest<JobRecord> jobs_;
  Time run_end_;
};

// Cuts a window after its first `most` slices.
void shorten(Window &window, std::size_t most) {
  if (window.slices.size() <= most) return;
  window.end = window.slices[most].begin;
  std::erase_if(window.slices, [&](const Slice &slice) { return slice.begin >= window.end; });
  std::erase_if(window.jobs, [&](const JobRecord &job) { return job.release >= window.end; });
}

// The view adds the job's length before and after the job.
View view_of(const JobRecord &job, std::size_t window, const Window &seen) {
  const Time end = std::max(std::min(job.finish, seen.end), job.deadline);
  const Duration length = end - job.release;
  return {.window = window,
          .begin = std::max(seen.begin, job.release - length),
          .end = std::min(seen.end, end + length),
          .job = job};
}

}  // namespace

Result<Schedule> schedule_of(const trace::Recording &run, std::span<const JobRecord> jobs, std::size_t most) {
  const trace::RunInfo &info = run.info();
  const std::size_t share = std::max<std::size_t>(most / (jobs.size() + 1), 4);
  std::vector<Filler> fillers;
  fillers.reserve(jobs.size() + 1);
  fillers.emplace_back(-kNever, 0, std::max(most, share), info.end);
  for (const JobRecord &job : jobs) {
    fillers.emplace_back(std::min(job.finish, info.end), share * 3 / 4, share / 4, info.end);
  }
  const auto take = [&](const auto &one) {
    for (Filler &filler : fillers) filler.add(one);
  };
  metrics::JobFolder folder(info.workload);
  SliceFolder slices(info);
  const Result<void> read = run.visit([&](std::span<const JobEvent> events) {
    folder.add(events);
    folder.drain_ended(take);
    slices.add(events);
    slices.drain(take);
  });
  if (!read) return tl::unexpected<Diagnostics>(read.error());
  slices.finish();
  slices.drain(take);
  for (const JobRecord &job : folder.in_flight()) take(job);

  Schedule schedule;
  schedule.windows.push_back(fillers.front().take(info.start));
  Window &beginning = schedule.windows.front();
  schedule.is_whole = beginning.end >= info.end;
  if (!schedule.is_whole) shorten(beginning, share);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    if (!schedule.is_whole) schedule.windows.push_back(fillers[i + 1].take(info.start));
    const std::size_t window = schedule.is_whole ? 0 : i + 1;
    schedule.views.push_back(view_of(jobs[i], window, schedule.windows[window]));
  }
  const Window &first = schedule.windows.front();
  schedule.views.push_back({.window = 0, .begin = first.begin, .end = first.end, .job = std::nullopt});
  return schedule;
}

}  // namespace redag::report
