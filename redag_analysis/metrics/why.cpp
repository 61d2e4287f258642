// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "redag_analysis/metrics/miss.hpp"
#include "redag_analysis/metrics/why_path.hpp"

namespace redag::metrics {
namespace {

// The jobs that an explanation of `subjects` can reach.
std::vector<bool> reachable(const JobLinks &links, std::span<const Subject> subjects) {
  std::vector<bool> chosen(links.jobs().size(), false);
  std::vector<std::size_t> next;
  for (const Subject &subject : subjects) next.push_back(subject.job);
  while (!next.empty()) {
    const std::size_t job = next.back();
    next.pop_back();
    if (job == JobLinks::kNone || chosen[job]) continue;
    chosen[job] = true;
    next.push_back(links.last(job));
    next.push_back(links.oldest(job));
  }
  return chosen;
}

struct Ranked {
  double share = 0;  // of the deadline
  Subject subject;
};

std::vector<Subject> in_order(std::vector<Ranked> ranked) {
  std::stable_sort(ranked.begin(), ranked.end(), [](const Ranked &a, const Ranked &b) { return a.share > b.share; });
  std::vector<Subject> subjects;
  subjects.reserve(ranked.size());
  for (const Ranked &one : ranked) subjects.push_back(one.subject);
  return subjects;
}

using CulpritKey = std::tuple<Cause, TaskId, std::string>;

CulpritKey culprit_key(const Part &part) {
  // What a predecessor's job did itself is charged to it.
  const bool is_own = part.cause == Cause::Execution || part.cause == Cause::Overrun || part.cause == Cause::Overhead ||
                      part.cause == Cause::OffProcessor || part.cause == Cause::OnWorker ||
                      part.cause == Cause::Slept || part.cause == Cause::Wakeup;
  return {part.cause, is_own ? part.job.task : part.by.task, part.program};
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

Investigation::Investigation(const trace::Trace &trace, const KernelRecord *kernel)
    : trace_(trace), links_(trace), end_to_end_(end_to_end_deadlines(trace.info.workload)) {
  if (kernel != nullptr) kernel_.emplace(*kernel);
}

Miss Investigation::miss(std::size_t job) const {
  return miss_of(jobs()[job], trace_.info.end, end_to_end_[jobs()[job].task.value]);
}

std::optional<std::size_t> Investigation::find(const JobId &job) const {
  const std::size_t index = links_.find(job);
  return index == JobLinks::kNone ? std::nullopt : std::optional(index);
}

bool Investigation::counts(std::size_t job) const {
  return jobs()[job].release >= trace_.info.start + trace_.info.warm_up;
}

std::size_t Investigation::counted() const {
  std::size_t count = 0;
  for (std::size_t i = 0; i < jobs().size(); ++i) count += counts(i) ? 1U : 0U;
  return count;
}

Subject Investigation::subject_of(std::size_t job) const { return {job, miss(job) == Miss::EndToEnd}; }

double Investigation::closeness(const Subject &subject) const {
  const JobRecord &job = jobs()[subject.job];
  const Time begin = subject.end_to_end ? job.origin : job.release;
  const Duration deadline = std::max<Duration>(1, deadline_of(subject));
  return static_cast<double>(links_.end_of(subject.job) - begin) / static_cast<double>(deadline);
}

Duration Investigation::deadline_of(const Subject &subject) const {
  const JobRecord &job = jobs()[subject.job];
  return subject.end_to_end ? end_to_end_[job.task.value] : job.deadline - job.release;
}

std::vector<Subject> Investigation::misses() const {
  std::vector<Ranked> late;
  std::vector<Subject> lost;
  for (std::size_t i = 0; i < jobs().size(); ++i) {
    if (!counts(i)) continue;
    const Miss kind = miss(i);
    if (kind == Miss::Lost) lost.push_back({i, false});
    if (kind == Miss::Deadline || kind == Miss::EndToEnd) late.push_back({closeness(subject_of(i)), subject_of(i)});
  }
  std::vector<Subject> all = in_order(std::move(late));
  all.insert(all.end(), lost.begin(), lost.end());
  return all;
}

std::vector<Subject> Investigation::closest(std::size_t most) const {
  std::map<TaskId, Ranked> worst;
  for (std::size_t i = 0; i < jobs().size(); ++i) {
    const JobRecord &job = jobs()[i];
    if (job.outcome != JobOutcome::Finished || !counts(i)) continue;
    const Ranked one{closeness({i, false}), {i, false}};
    const auto [of_task, is_new] = worst.try_emplace(job.task, one);
    if (!is_new && one.share > of_task->second.share) of_task->second = one;
  }
  std::vector<Ranked> ranked;
  for (const auto &[task, one] : worst) ranked.push_back(one);
  std::vector<Subject> all = in_order(std::move(ranked));
  all.resize(std::min(all.size(), most));
  return all;
}

std::vector<Explanation> Investigation::explain(std::span<const Subject> subjects) const {
  const std::vector<std::vector<Wait>> waits = waits_of(trace_, links_, reachable(links_, subjects));
  std::vector<Explanation> explanations;
  explanations.reserve(subjects.size());
  for (const Subject &subject : subjects) {
    Explanation one;
    one.job = jobs()[subject.job];
    one.miss = miss(subject.job);
    one.end_to_end = subject.end_to_end && one.job.origin != kNever;
    one.begin = one.end_to_end ? one.job.origin : one.job.release;
    one.end = std::max(one.begin, links_.end_of(subject.job));
    one.deadline = deadline_of({subject.job, one.end_to_end});
    one.parts = WhyPath(trace_.info, links_, waits, kernel_ ? &*kernel_ : nullptr)
                    .parts_of(subject.job, one.begin, one.end, one.end_to_end);
    explanations.push_back(std::move(one));
  }
  return explanations;
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
    std::tie(culprit.cause, culprit.task, culprit.program) = key;
    culprit.jobs = 1;
    culprit.time += part.length;
  }
  std::vector<Culprit> culprits = sorted(std::move(found));
  if (!culprits.empty()) culprits.front().main = 1;
  return culprits;
}

std::vector<Culprit> culprits_of(std::span<const Explanation> explanations) {
  std::map<CulpritKey, Culprit> found;
  for (const Explanation &explanation : explanations) {
    for (const Culprit &one : culprits_of(explanation.parts)) {
      Culprit &culprit = found[{one.cause, one.task, one.program}];
      std::tie(culprit.cause, culprit.task, culprit.program) = std::tie(one.cause, one.task, one.program);
      culprit.jobs += one.jobs;
      culprit.main += one.main;
      culprit.time += one.time;
    }
  }
  return sorted(std::move(found));
}

}  // namespace redag::metrics
