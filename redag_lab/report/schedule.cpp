// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/schedule.hpp"

#include <algorithm>
#include <functional>
#include <limits>
#include <optional>
#include <queue>
#include <span>

namespace redag::report {
namespace {

using metrics::JobOutcome;
using metrics::JobRecord;

// The `most` values that come first in an order: the smallest of all for std::less.
template <class Value, class Before>
class FirstFew {
 public:
  FirstFew(std::size_t most, Before before) : most_(most), few_(before) {}

  void add(const Value &value) {
    few_.push(value);
    if (few_.size() > most_) few_.pop();
  }
  [[nodiscard]] bool empty() const { return few_.empty(); }
  [[nodiscard]] std::size_t size() const { return few_.size(); }
  /// The one of them that comes last. Requires that there is one.
  [[nodiscard]] const Value &last() const { return few_.top(); }
  /// All of them, in their order.
  [[nodiscard]] std::vector<Value> take() {
    std::vector<Value> all;
    for (; !few_.empty(); few_.pop()) all.push_back(few_.top());
    std::reverse(all.begin(), all.end());
    return all;
  }

 private:
  std::size_t most_;
  std::priority_queue<Value, std::vector<Value>, Before> few_;
};

using Earliest = FirstFew<Time, std::less<>>;
using Latest = FirstFew<Time, std::greater<>>;

// The first pass: how much there is, the job of the first view, and the job of each other DAG with the largest
// lateness, as a share of its deadline.
class Survey {
 public:
  Survey(const trace::RunInfo &run, const std::optional<metrics::JobId> &first)
      : refs_(flatten(run.workload)),
        first_(first),
        end_(run.end),
        slices_of_run_(run),
        folder_(run.workload),
        worst_(run.workload.dags.size()) {}

  void add(std::span<const JobEvent> events) {
    slices_of_run_.add(events);
    count_slices();
    folder_.add(events);
    folder_.drain_ended([this](const JobRecord &job) { see(job); });
  }

  void finish() {
    slices_of_run_.finish();
    count_slices();
    for (const JobRecord &job : folder_.in_flight()) see(job);
  }

  [[nodiscard]] std::vector<JobRecord> worst(std::size_t most) const {
    std::vector<Worst> found;
    for (const std::optional<Worst> &dag : worst_) {
      if (dag) found.push_back(*dag);
    }
    std::stable_sort(found.begin(), found.end(), [](const Worst &a, const Worst &b) { return a.share > b.share; });
    found.resize(std::min(found.size(), most));
    std::vector<JobRecord> jobs;
    jobs.reserve(found.size());
    for (const Worst &dag : found) jobs.push_back(dag.job);
    return jobs;
  }
  [[nodiscard]] std::uint64_t slices() const { return slices_; }
  [[nodiscard]] std::uint64_t jobs() const { return jobs_; }
  /// Of the run, or of its last slice if that is later.
  [[nodiscard]] Time end() const { return end_; }

 private:
  struct Worst {
    JobRecord job;
    double share = 0;
  };

  void count_slices() {
    slices_of_run_.drain([this](const Slice &slice) {
      ++slices_;
      end_ = std::max(end_, slice.end);
    });
  }

  void see(const JobRecord &job) {
    ++jobs_;
    std::optional<Worst> &dag = worst_[refs_[job.task.value].dag.value];
    if (first_ && job.task == first_->task && job.number == first_->number) {
      dag = Worst{job, std::numeric_limits<double>::infinity()};
    }
    if (job.outcome != JobOutcome::Finished) return;
    const Duration relative = std::max<Duration>(1, job.deadline - job.release);
    const double share = static_cast<double>(job.lateness()) / static_cast<double>(relative);
    const bool is_worse = !dag || share > dag->share || (share == dag->share && job.sequence < dag->job.sequence);
    if (is_worse) dag = Worst{job, share};
  }

  std::vector<TaskRef> refs_;
  std::optional<metrics::JobId> first_;
  Time end_;
  SliceFolder slices_of_run_;
  metrics::JobFolder folder_;
  std::vector<std::optional<Worst>> worst_;  // by DagId
  std::uint64_t slices_ = 0;
  std::uint64_t jobs_ = 0;
};

// Finds where the window begins and ends that has `share` slices (at least 2), three quarters of them before a job's
// finish.
class Placement {
 public:
  Placement(Time finish, std::size_t share)
      : finish_(finish),
        share_(share),
        before_(share * 3 / 4, std::greater<>()),
        after_(share - share * 3 / 4, std::less<>()) {}

  void add(Time begin) {
    if (begin < finish_) {
      ++earlier_;
      before_.add(begin);
    } else {
      after_.add(begin);
    }
  }

  /// `first` are the begins of the first slices of the run, of which there are `slices`. [begin, end) is the run.
  [[nodiscard]] Window window(const Earliest &first, std::uint64_t slices, Time begin, Time end) const {
    const std::uint64_t wanted = share_ * 3 / 4;
    if (slices == 0) return {begin, end, {}, {}, {}};
    if (earlier_ <= wanted) return {begin, slices <= share_ ? end : first.last(), {}, {}, {}};
    return {before_.last(), earlier_ - wanted + share_ >= slices ? end : after_.last(), {}, {}, {}};
  }

 private:
  Time finish_;
  std::size_t share_;
  Latest before_;
  Earliest after_;
  std::uint64_t earlier_ = 0;  // slices that begin before the finish
};

// The last pass: takes what lies within a window. It is cut short if there is more than a share.
class Filler {
 public:
  Filler(Window &window, std::size_t share, Time run_end)
      : window_(window), most_jobs_(2 * share), run_end_(run_end), jobs_(most_jobs_ + 1, &Filler::is_earlier) {}

  void add(const JobRecord &job) {
    const Time end = job.finish == kNever ? run_end_ : job.finish;
    if (job.release < window_.end && end >= window_.begin) jobs_.add(job);
  }
  void add(const Slice &slice) {
    if (is_within(slice)) window_.slices.push_back(slice);
  }
  void add(const Service &service) {
    if (is_within(service)) window_.services.push_back(service);
  }

  void finish() {
    window_.jobs = jobs_.take();
    if (window_.jobs.size() > most_jobs_) {
      window_.end = window_.jobs.back().release;
      window_.jobs.pop_back();
    }
    const auto settle = [this](auto &all) {
      std::erase_if(all, [this](const auto &one) { return one.begin > window_.end; });
      std::stable_sort(all.begin(), all.end(), [](const auto &a, const auto &b) { return a.begin < b.begin; });
    };
    settle(window_.slices);
    settle(window_.services);
  }

 private:
  static bool is_earlier(const JobRecord &a, const JobRecord &b) { return a.sequence < b.sequence; }
  template <class Stretch>
  [[nodiscard]] bool is_within(const Stretch &one) const {
    return one.begin <= window_.end && one.end >= window_.begin;
  }

  Window &window_;
  std::size_t most_jobs_;
  Time run_end_;
  FirstFew<JobRecord, bool (*)(const JobRecord &, const JobRecord &)> jobs_;
};

// The second pass: a window at the beginning, and one around each of the worst jobs.
Result<std::vector<Window>> place_windows(const trace::Recording &run, const Survey &survey,
                                          const std::vector<JobRecord> &worst, std::size_t share) {
  Earliest first(share, std::less<>());
  std::vector<Placement> placements;
  placements.reserve(worst.size());
  for (const JobRecord &job : worst) placements.emplace_back(std::min(job.finish, run.info().end), share);
  SliceFolder folder(run.info());
  const auto take = [&](const Slice &slice) {
    first.add(slice.begin);
    for (Placement &placement : placements) placement.add(slice.begin);
  };
  const Result<void> read = run.visit([&](std::span<const JobEvent> events) {
    folder.add(events);
    folder.drain(take);
  });
  if (!read) return tl::unexpected<Diagnostics>(read.error());
  folder.finish();
  folder.drain(take);
  const Time begin = run.info().start;
  std::vector<Window> windows;
  const bool is_whole = survey.slices() <= share;
  windows.push_back({begin, is_whole ? survey.end() : first.last(), {}, {}, {}});
  for (const Placement &placement : placements) {
    windows.push_back(placement.window(first, survey.slices(), begin, survey.end()));
  }
  return windows;
}

Result<void> fill_windows(const trace::Recording &run, std::vector<Window> &windows, std::size_t share, Time run_end) {
  std::vector<Filler> fillers;
  fillers.reserve(windows.size());
  for (Window &window : windows) fillers.emplace_back(window, share, run_end);
  const auto take = [&](const auto &one) {
    for (Filler &filler : fillers) filler.add(one);
  };
  metrics::JobFolder jobs(run.info().workload);
  SliceFolder slices(run.info());
  ServiceFolder services(run.info());
  Result<void> read = run.visit([&](std::span<const JobEvent> events) {
    jobs.add(events);
    jobs.drain_ended(take);
    slices.add(events);
    slices.drain(take);
    services.add(events);
    services.drain(take);
  });
  if (!read) return read;
  for (const JobRecord &job : jobs.in_flight()) take(job);
  slices.finish();
  slices.drain(take);
  services.finish();
  services.drain(take);
  for (Filler &filler : fillers) filler.finish();
  return {};
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

Result<Schedule> schedule_of(const trace::Recording &run, std::size_t most, std::size_t most_views,
                             const std::optional<metrics::JobId> &first) {
  most = std::max<std::size_t>(most, 1);
  Survey survey(run.info(), first);
  Result<void> read = run.visit([&](std::span<const JobEvent> events) { survey.add(events); });
  if (!read) return tl::unexpected<Diagnostics>(std::move(read.error()));
  survey.finish();
  const std::vector<JobRecord> worst = survey.worst(most_views);
  const bool is_whole = survey.slices() <= most && survey.jobs() <= 2 * most;
  // The first window is the beginning; each worst job gets an equal share.
  const std::size_t share = is_whole ? most : std::max<std::size_t>(2, most / (worst.size() + 1));
  Schedule schedule;
  schedule.slices_in_all = survey.slices();
  if (is_whole) {
    schedule.windows.push_back({run.info().start, survey.end(), {}, {}, {}});
  } else {
    Result<std::vector<Window>> placed = place_windows(run, survey, worst, share);
    if (!placed) return tl::unexpected<Diagnostics>(std::move(placed.error()));
    schedule.windows = *std::move(placed);
  }
  read = fill_windows(run, schedule.windows, share, survey.end());
  if (!read) return tl::unexpected<Diagnostics>(std::move(read.error()));
  for (std::size_t i = 0; i < worst.size(); ++i) {
    const std::size_t window = is_whole ? 0 : i + 1;
    schedule.views.push_back(view_of(worst[i], window, schedule.windows[window]));
  }
  const Window &beginning = schedule.windows.front();
  schedule.views.push_back({.window = 0, .begin = beginning.begin, .end = beginning.end, .job = std::nullopt});
  for (const Window &window : schedule.windows) schedule.slices_shown += window.slices.size();
  return schedule;
}

}  // namespace redag::report
