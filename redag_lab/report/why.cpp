// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/why.hpp"

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>

#include "redag_analysis/metrics/why/why_remedy.hpp"
#include "redag_analysis/metrics/why/why_text.hpp"

namespace redag::report {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostShown = 400;
constexpr std::ptrdiff_t kClosest = 20;  // jobs that are shown without a miss
constexpr std::size_t kMostCauses = 40;
constexpr std::size_t kMostRows = 40;  // of parts of a job

Json to_json(const metrics::Explanation &one, const trace::RunInfo &run) {
  const Workload &workload = run.workload;
  const metrics::JobId id{one.job.task, one.job.number};
  Json parts{
      {"begin_ns", Json::array()}, {"length_ns", Json::array()}, {"work", Json::array()}, {"text", Json::array()}};
  for (const metrics::PartRow &row : metrics::rows_of(one.parts, kMostRows)) {
    parts["begin_ns"].push_back(row.begin() == kNever ? Json() : Json(row.begin() - one.begin));
    parts["length_ns"].push_back(row.length());
    parts["work"].push_back(row.is_work() ? 1 : 0);
    parts["text"].push_back(metrics::describe(row, workload, id));
  }
  const bool is_missed = one.miss != metrics::Miss::None;
  const std::vector<metrics::Culprit> culprits = metrics::culprits_of(one);  // none of a job lost at its release
  return {{"task", id.task.value},
          {"number", id.number},
          {"missed", is_missed},
          {"end_to_end", one.end_to_end},
          {"since_ns", one.job.release - run.start},
          {"lateness_ns", one.miss == metrics::Miss::Lost ? Json() : Json(one.lateness())},
          {"outcome", to_string(one.job.outcome)},
          {"reason", to_string(one.job.reason)},
          {"length_ns", one.length()},
          {"text", metrics::headline(one, workload)},
          {"cause", culprits.empty() ? Json() : Json(metrics::describe(culprits.front(), workload))},
          {"cause_ns", culprits.empty() ? Json() : Json(culprits.front().time)},
          {"remedy", is_missed && !culprits.empty() ? Json(metrics::remedy(culprits.front(), run)) : Json()},
          {"parts", std::move(parts)}};
}

// Returns the first subject of each DAG, of those that come first.
std::vector<metrics::Subject> first_of_dags(const std::vector<metrics::Subject> &misses,
                                            const std::vector<metrics::Subject> &closest, const Workload &workload,
                                            std::size_t most) {
  const std::vector<TaskRef> refs = flatten(workload);
  std::set<DagId> seen;
  std::vector<metrics::Subject> first;
  for (const std::vector<metrics::Subject> *subjects : {&misses, &closest}) {
    for (const metrics::Subject &subject : *subjects) {
      if (first.size() < most && seen.insert(refs[subject.job.task.value].dag).second) first.push_back(subject);
    }
  }
  return first;
}

}  // namespace

Result<WhyDigest> why_of(const metrics::Investigation &investigation, std::size_t most_dags) {
  const Workload &workload = investigation.run().workload;
  const std::vector<metrics::Subject> closest = investigation.closest(workload.task_count());
  std::vector<metrics::Subject> subjects = investigation.misses();
  if (subjects.empty()) subjects.assign(closest.begin(), closest.begin() + std::min(kClosest, std::ssize(closest)));
  WhyDigest why;
  why.missed = investigation.missed();
  why.misses = investigation.misses_in_all();
  why.explained = subjects.size();
  why.worst.resize(std::min(kMostShown, subjects.size()));
  metrics::CulpritCount causes;
  const auto take = [&](std::size_t rank, metrics::Explanation one) {
    causes.add(one);
    if (rank < why.worst.size()) why.worst[rank] = std::move(one);
  };
  const Result<void> explained = investigation.explain(subjects, take);
  if (!explained) return tl::unexpected<Diagnostics>(explained.error());
  why.causes = causes.sorted();
  const Result<std::vector<metrics::Explanation>> firsts =
      investigation.explain(first_of_dags(investigation.misses(), closest, workload, most_dags));
  if (!firsts) return tl::unexpected<Diagnostics>(firsts.error());
  for (const metrics::Explanation &first : *firsts) why.worst_of_dag.push_back(first.job);
  return why;
}

Json to_json(const WhyDigest &why, const trace::RunInfo &run) {
  const Workload &workload = run.workload;
  Json causes = Json::array();
  for (std::size_t i = 0; i < std::min(kMostCauses, why.causes.size()); ++i) {
    const metrics::Culprit &cause = why.causes[i];
    causes.push_back({{"text", metrics::describe(cause, workload)},
                      {"jobs", cause.jobs},
                      {"main", cause.main},
                      {"time_ns", cause.time}});
  }
  Json jobs = Json::array();
  for (const metrics::Explanation &one : why.worst) jobs.push_back(to_json(one, run));
  return {{"misses", why.misses},       {"missed", why.missed},        {"late_end_to_end", why.misses - why.missed},
          {"explained", why.explained}, {"causes", std::move(causes)}, {"jobs", std::move(jobs)}};
}

}  // namespace redag::report
