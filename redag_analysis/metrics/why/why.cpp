// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include <fmt/format.h>

#include "redag_analysis/metrics/miss.hpp"
#include "redag_analysis/metrics/why/why_links.hpp"
#include "redag_analysis/metrics/why/why_path.hpp"
#include "redag_analysis/metrics/why/why_waits.hpp"

namespace redag::metrics {
namespace {

std::uint64_t key_of(const JobId &job) { return (std::uint64_t{job.task.value} << 32U) | job.number; }

// When a job ended; the end of the run for a job in flight.
Time end_of(const JobRecord &job, Time run_end) {
  return job.outcome == JobOutcome::InFlight ? std::max(run_end, job.seen) : job.finish;
}

// Jobs to explain that have ended, until the jobs that their explanations can reach are complete as well.
class WaitingSubjects {
 public:
  explicit WaitingSubjects(std::span<const Subject> subjects) {
    for (std::size_t i = 0; i < subjects.size(); ++i) wanted_.emplace(key_of(subjects[i].job), i);
  }

  /// Takes the jobs that have ended, and passes those subjects on to take(JobHandle, index) that are complete.
  template <class IsComplete, class Take>
  void settle(JobLinks &links, IsComplete is_complete, Take take) {
    links.drain_ended([this](const JobHandle &job) {
      const auto wanted = wanted_.find(key_of(job->id()));
      if (wanted == wanted_.end()) return;
      waiting_.emplace_back(job, wanted->second);
      wanted_.erase(wanted);
    });
    std::erase_if(waiting_, [&](const auto &one) {
      const bool is_over = visit_reachable(one.first, is_complete);
      if (is_over) take(one.first, one.second);
      return is_over;
    });
  }

 private:
  std::unordered_map<std::uint64_t, std::size_t> wanted_;  // by job
  std::vector<std::pair<JobHandle, std::size_t>> waiting_;
};

using CulpritKey = std::pair<Cause, TaskId>;

CulpritKey culprit_key(const Part &part) {
  // What a predecessor's job did itself is charged to it.
  const bool is_own = part.cause == Cause::Execution || part.cause == Cause::Overrun || part.cause == Cause::Overhead ||
                      part.cause == Cause::OffProcessor || part.cause == Cause::OnWorker || part.cause == Cause::Wakeup;
  return {part.cause, is_own ? part.job.task : part.by.task};
}

// Why a job was lost; Unknown: nothing more than where its time went.
Cause cause_of_loss(const JobRecord &job) {
  if (!is_lost(job)) return Cause::Unknown;
  switch (job.reason) {
    case Reason::Exception: return Cause::Threw;
    case Reason::Budget: return Cause::BudgetUsed;
    case Reason::QueueFull: return Cause::QueueFull;
    case Reason::DagFull: return Cause::PendingFull;
    case Reason::Degraded: return Cause::Degraded;
    case Reason::Removed: return Cause::Removed;
    case Reason::None:
    case Reason::Overrun:
    case Reason::Precedence:
    case Reason::NoData: break;
  }
  return Cause::Unknown;
}

bool costs_more(const Culprit &a, const Culprit &b) {
  if (is_work(a.cause) != is_work(b.cause)) return is_work(b.cause);
  if (a.main != b.main) return a.main > b.main;
  return a.time > b.time;
}

std::vector<Culprit> sorted(std::map<CulpritKey, Culprit> found) {
  std::vector<Culprit> culprits;
  culprits.reserve(found.size());
  for (auto &[key, culprit] : found) culprits.push_back(std::move(culprit));
  std::stable_sort(culprits.begin(), culprits.end(), costs_more);
  return culprits;
}

}  // namespace

bool Investigation::is_worse(const Ranked &a, const Ranked &b) {
  return a.share != b.share ? a.share > b.share : a.sequence < b.sequence;
}

// Looks at all jobs once, and remembers the worst.
class Investigation::Surveyor {
 public:
  Surveyor(const Investigation &of, std::size_t most)
      : of_(of), info_(of.run()), folder_(info_.workload), late_(most), lost_(most) {
    survey_.tasks.resize(info_.workload.task_count());
  }

  void add(std::span<const JobEvent> events) {
    folder_.add(events);
    folder_.drain_ended([this](const JobRecord &job) { see(job); });
  }

  Survey finish() {
    for (const JobRecord &job : folder_.in_flight()) see(job);
    survey_.misses = late_.take();
    const std::vector<Subject> lost = lost_.take();
    const std::size_t room = late_.most() - survey_.misses.size();
    survey_.misses.insert(survey_.misses.end(), lost.begin(),
                          lost.begin() + static_cast<std::ptrdiff_t>(std::min(room, lost.size())));
    return std::move(survey_);
  }

 private:
  // The worst of any number. Keeps up to twice as many, so that it seldom has to choose.
  class Worst {
   public:
    explicit Worst(std::size_t most) : most_(most) {}

    [[nodiscard]] std::size_t most() const { return most_; }
    void add(const Ranked &one) {
      if (ranked_.size() / 2 >= std::max<std::size_t>(most_, 1)) cut();
      ranked_.push_back(one);
    }
    [[nodiscard]] std::vector<Subject> take() {
      cut();
      std::sort(ranked_.begin(), ranked_.end(), is_worse);
      std::vector<Subject> subjects;
      subjects.reserve(ranked_.size());
      for (const Ranked &one : ranked_) subjects.push_back(one.subject);
      return subjects;
    }

   private:
    void cut() {
      if (ranked_.size() <= most_) return;
      const auto end = ranked_.begin() + static_cast<std::ptrdiff_t>(most_);
      std::nth_element(ranked_.begin(), end, ranked_.end(), is_worse);
      ranked_.erase(end, ranked_.end());
    }

    std::size_t most_;
    std::vector<Ranked> ranked_;
  };

  void see(const JobRecord &job) {
    WorstOfTask &task = survey_.tasks[job.task.value];
    task.last_number = std::max(task.last_number, job.number);
    if (job.release < info_.start + info_.warm_up) return;
    ++survey_.counted;
    const Miss miss = of_.miss_of(job);
    const bool end_to_end = miss == Miss::EndToEnd;
    if (miss != Miss::None) ++(end_to_end ? survey_.late_end_to_end : survey_.missed);
    if (miss == Miss::Lost) {
      const Ranked one{0, job.sequence, {id_of(job), false}};
      lost_.add(one);
      keep_worst(task.lost, one);
    } else if (miss != Miss::None) {
      const Ranked one{closeness(job, end_to_end), job.sequence, {id_of(job), end_to_end}};
      late_.add(one);
      keep_worst(task.late, one);
    }
    if (job.outcome == JobOutcome::Finished) {
      keep_worst(task.closest, {closeness(job, false), job.sequence, {id_of(job), false}});
    }
  }

  static JobId id_of(const JobRecord &job) { return {job.task, job.number}; }

  static void keep_worst(std::optional<Ranked> &worst, const Ranked &one) {
    if (!worst || is_worse(one, *worst)) worst = one;
  }

  [[nodiscard]] double closeness(const JobRecord &job, bool end_to_end) const {
    const Time begin = end_to_end ? job.origin : job.release;
    const Duration deadline = end_to_end ? of_.end_to_end_[job.task.value] : job.deadline - job.release;
    return static_cast<double>(end_of(job, info_.end) - begin) / static_cast<double>(std::max<Duration>(1, deadline));
  }

  const Investigation &of_;
  const trace::RunInfo &info_;
  JobFolder folder_;
  Worst late_;
  Worst lost_;
  Survey survey_;
};

// Explains subjects: the first pass finds the jobs that their explanations can reach, the second one follows these.
class Investigation::Explainer {
 public:
  Explainer(const Investigation &of, std::span<const Subject> subjects, const Visit &visit)
      : of_(of), subjects_(subjects), visit_(visit) {}

  Result<void> run() {
    return choose().and_then([this] { return follow(); });
  }

 private:
  Result<void> choose() {
    WaitingSubjects waiting(subjects_);
    JobLinks links(of_.run());
    const auto settle = [&] {
      waiting.settle(
          links, [](const JobHandle &job) { return job->has_ended; },
          [this](const JobHandle &subject, std::size_t /*index*/) {
            visit_reachable(subject, [this](const JobHandle &job) {
              chosen_.insert(key_of(job->id()));
              return true;
            });
          });
    };
    Result<void> read = of_.run_.visit([&](std::span<const JobEvent> events) {
      for (const JobEvent &event : events) links.add(event);
      settle();
    });
    links.finish();
    settle();
    return read;
  }

  Result<void> follow() {
    WaitingSubjects waiting(subjects_);
    JobLinks links(of_.run());
    WaitWatch watch(of_.run(), [this](const JobId &job) { return chosen_.contains(key_of(job)); });
    const auto settle = [&] {
      waiting.settle(
          links, [](const JobHandle &job) { return job->has_ended && has_known_holders(*job); },
          [&](const JobHandle &subject, std::size_t index) {
            visit_reachable(subject, [](const JobHandle &job) {
              name_holders(*job);
              return true;
            });
            visit_(index, explain(*subject, subjects_[index].end_to_end, links));
          });
    };
    Result<void> read = of_.run_.visit([&](std::span<const JobEvent> events) {
      for (const JobEvent &event : events) watch.add(event, links);
      settle();
    });
    watch.finish(links);
    settle();
    return read;
  }

  [[nodiscard]] Explanation explain(const LinkedJob &job, bool end_to_end, const JobLinks &links) const {
    Explanation one;
    one.job = job.record;
    one.miss = of_.miss_of(job.record);
    one.end_to_end = end_to_end && job.record.origin != kNever;
    one.begin = one.end_to_end ? job.record.origin : job.record.release;
    one.end = std::max(one.begin, links.end_of(job));
    one.deadline = one.end_to_end ? of_.end_to_end_[job.record.task.value] : job.record.deadline - job.record.release;
    one.parts = WhyPath(of_.run(), links).parts_of(job, one.begin, one.end, one.end_to_end);
    return one;
  }

  const Investigation &of_;
  std::span<const Subject> subjects_;
  const Visit &visit_;
  std::unordered_set<std::uint64_t> chosen_;
};

Investigation::Investigation(const trace::Recording &run)
    : run_(run), end_to_end_(end_to_end_deadlines(run.info().workload)) {}

Result<Investigation> Investigation::of(const trace::Recording &run, std::size_t most) {
  Investigation made(run);
  Surveyor surveyor(made, most);
  const Result<void> read = run.visit([&](std::span<const JobEvent> events) { surveyor.add(events); });
  if (!read) return tl::unexpected<Diagnostics>(read.error());
  made.survey_ = surveyor.finish();
  return made;
}

Miss Investigation::miss_of(const JobRecord &job) const {
  return metrics::miss_of(job, run().end, end_to_end_[job.task.value]);
}

std::vector<Subject> Investigation::closest(std::size_t most) const {
  std::vector<Ranked> ranked;
  for (const WorstOfTask &task : survey_.tasks) {
    if (task.closest) ranked.push_back(*task.closest);
  }
  // Of equal ones that of the first task comes first.
  std::stable_sort(ranked.begin(), ranked.end(), [](const Ranked &a, const Ranked &b) { return a.share > b.share; });
  ranked.resize(std::min(ranked.size(), most));
  std::vector<Subject> subjects;
  subjects.reserve(ranked.size());
  for (const Ranked &one : ranked) subjects.push_back(one.subject);
  return subjects;
}

std::optional<Subject> Investigation::worst_of(TaskId task) const {
  const WorstOfTask &worst = survey_.tasks[task.value];
  for (const std::optional<Ranked> &one : {worst.late, worst.lost, worst.closest}) {
    if (one) return one->subject;
  }
  return std::nullopt;
}

Result<std::optional<Subject>> Investigation::find(const JobId &job) const {
  std::optional<Subject> found;
  const auto see = [&](const JobRecord &one) {
    if (!found && one.task == job.task && one.number == job.number) {
      found = Subject{job, miss_of(one) == Miss::EndToEnd};
    }
  };
  JobFolder folder(run().workload);
  const Result<void> read = run_.visit([&](std::span<const JobEvent> events) {
    folder.add(events);
    folder.drain_ended(see);
  });
  if (!read) return tl::unexpected<Diagnostics>(read.error());
  for (const JobRecord &one : folder.in_flight()) see(one);
  return found;
}

Result<void> Investigation::explain(std::span<const Subject> subjects, const Visit &visit) const {
  return Explainer(*this, subjects, visit).run();
}

Result<std::vector<Explanation>> Investigation::explain(std::span<const Subject> subjects) const {
  std::vector<Explanation> all(subjects.size());
  const Result<void> read = explain(subjects, [&](std::size_t index, Explanation one) { all[index] = std::move(one); });
  if (!read) return tl::unexpected<Diagnostics>(read.error());
  return all;
}

Duration PartRow::length() const {
  return std::accumulate(parts.begin(), parts.end(), Duration{0},
                         [](Duration sum, const Part &part) { return sum + part.length; });
}

bool PartRow::is_work() const {
  return std::all_of(parts.begin(), parts.end(), [](const Part &part) { return metrics::is_work(part.cause); });
}

std::vector<PartRow> rows_of(std::span<const Part> parts, std::size_t most) {
  // Between n parts that stand alone, before them and after them there are up to n + 1 rows of other parts.
  const std::size_t alone = parts.size() <= most ? parts.size() : (most - 1) / 2;
  std::vector<std::size_t> longest(parts.size());
  std::iota(longest.begin(), longest.end(), std::size_t{0});
  std::stable_sort(longest.begin(), longest.end(),
                   [&](std::size_t a, std::size_t b) { return parts[a].length > parts[b].length; });
  longest.resize(alone);
  std::sort(longest.begin(), longest.end());
  std::vector<PartRow> rows;
  std::size_t done = 0;
  for (const std::size_t i : longest) {
    if (done < i) rows.push_back({parts.subspan(done, i - done)});
    rows.push_back({parts.subspan(i, 1)});
    done = i + 1;
  }
  if (done < parts.size()) rows.push_back({parts.subspan(done)});
  return rows;
}

std::vector<Culprit> culprits_of(std::span<const Part> parts) {
  std::map<CulpritKey, Culprit> found;
  for (const Part &part : parts) {
    const CulpritKey key = culprit_key(part);
    Culprit &culprit = found[key];
    std::tie(culprit.cause, culprit.task) = key;
    culprit.jobs = 1;
    culprit.time += part.length;
  }
  std::vector<Culprit> culprits = sorted(std::move(found));
  if (!culprits.empty()) culprits.front().main = 1;
  return culprits;
}

std::vector<Culprit> culprits_of(const Explanation &explanation) {
  std::vector<Culprit> culprits = culprits_of(explanation.parts);
  for (Culprit &one : culprits) {
    one.longest = one.time;
    one.delayed = explanation.job.task;
  }
  const Cause loss = cause_of_loss(explanation.job);
  if (loss == Cause::Unknown) return culprits;
  if (!culprits.empty()) culprits.front().main = 0;
  Culprit lost;
  lost.cause = loss;
  lost.task = lost.delayed = explanation.job.task;
  lost.jobs = lost.main = 1;
  culprits.insert(culprits.begin(), std::move(lost));
  return culprits;
}

std::optional<MainCause> main_cause_of(std::span<const Culprit> culprits) {
  std::map<Cause, MainCause> kinds;
  for (const Culprit &one : culprits) {
    if (one.main == 0) continue;
    MainCause &kind = kinds[one.cause];
    kind.jobs += one.main;
    kind.culprits.push_back(one);
  }
  const auto most = std::max_element(kinds.begin(), kinds.end(),
                                     [](const auto &a, const auto &b) { return a.second.jobs < b.second.jobs; });
  if (most == kinds.end()) return std::nullopt;
  return std::move(most->second);
}

void CulpritCount::add(const Explanation &explanation) {
  for (const Culprit &one : culprits_of(explanation)) {
    Culprit &culprit = found_[{one.cause, one.task}];
    std::tie(culprit.cause, culprit.task) = std::tie(one.cause, one.task);
    culprit.jobs += one.jobs;
    culprit.main += one.main;
    culprit.time += one.time;
    if (one.longest > culprit.longest || !culprit.delayed.valid()) {
      culprit.longest = one.longest;
      culprit.delayed = one.delayed;
    }
  }
}

std::vector<Culprit> CulpritCount::sorted() const { return metrics::sorted(found_); }

}  // namespace redag::metrics
