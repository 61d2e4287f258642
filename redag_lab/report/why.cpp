// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/why.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "redag_analysis/metrics/why_text.hpp"

namespace redag::report {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostExplained = 20'000;
constexpr std::size_t kWorst = 100;      // misses that are shown
constexpr std::size_t kMostShown = 400;  // with those in the schedule
constexpr std::size_t kClosest = 20;     // jobs that are shown without a miss
constexpr std::size_t kMostCauses = 40;

Json to_json(const metrics::Explanation &one, const Workload &workload) {
  const metrics::JobId id{one.job.task, one.job.number};
  Json parts{
      {"begin_ns", Json::array()}, {"length_ns", Json::array()}, {"work", Json::array()}, {"text", Json::array()}};
  for (const metrics::Part &part : one.parts) {
    parts["begin_ns"].push_back(part.begin == kNever ? Json() : Json(part.begin - one.begin));
    parts["length_ns"].push_back(part.length);
    parts["work"].push_back(metrics::is_work(part.cause) ? 1 : 0);
    parts["text"].push_back(metrics::describe(part, workload, id));
  }
  const std::vector<metrics::Culprit> culprits = metrics::culprits_of(one);
  return {{"task", id.task.value},
          {"number", id.number},
          {"missed", one.miss != metrics::Miss::None},
          {"end_to_end", one.end_to_end},
          {"length_ns", one.length()},
          {"text", metrics::headline(one, workload)},
          {"main", culprits.empty() ? "" : metrics::describe(culprits.front(), workload)},
          {"parts", std::move(parts)}};
}

}  // namespace

WhyDigest why_of(const trace::Trace &trace, const metrics::KernelRecord *kernel, const Schedule &schedule) {
  const metrics::Investigation investigation(trace, kernel);
  std::vector<metrics::Subject> subjects = investigation.misses();
  WhyDigest why;
  why.misses = subjects.size();
  if (subjects.empty()) subjects = investigation.closest(kClosest);
  subjects.resize(std::min(subjects.size(), kMostExplained));
  std::vector<metrics::Explanation> all = investigation.explain(subjects);
  why.explained = all.size();
  why.causes = metrics::culprits_of(all);
  std::set<metrics::JobId> seen;
  for (const Window &window : schedule.windows) {
    for (const metrics::JobRecord &job : window.jobs) seen.insert({job.task, job.number});
  }
  for (std::size_t i = 0; i < all.size() && why.jobs.size() < kMostShown; ++i) {
    const bool is_seen = seen.contains({all[i].job.task, all[i].job.number});
    if (i < kWorst || is_seen) why.jobs.push_back(std::move(all[i]));
  }
  return why;
}

std::string to_json(const WhyDigest &why, const Workload &workload) {
  Json causes = Json::array();
  for (std::size_t i = 0; i < std::min(kMostCauses, why.causes.size()); ++i) {
    const metrics::Culprit &cause = why.causes[i];
    causes.push_back({{"text", metrics::describe(cause, workload)},
                      {"jobs", cause.jobs},
                      {"main", cause.main},
                      {"time_ns", cause.time}});
  }
  Json jobs = Json::array();
  for (const metrics::Explanation &one : why.jobs) jobs.push_back(to_json(one, workload));
  const Json document{
      {"misses", why.misses}, {"explained", why.explained}, {"causes", std::move(causes)}, {"jobs", std::move(jobs)}};
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace redag::report
