// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/why.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "redag_analysis/metrics/why_remedy.hpp"
#include "redag_analysis/metrics/why_text.hpp"

namespace redag::report {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostListed = 1'000;
constexpr std::size_t kWorst = 100;      // misses whose parts are shown
constexpr std::size_t kMostShown = 400;  // with those in the schedule
constexpr std::size_t kClosest = 20;     // jobs that are shown without a miss
constexpr std::size_t kMostCauses = 40;
constexpr std::size_t kMostRows = 40;  // of parts of a job

// What to change against a miss; null of a job in time.
Json remedy_of(const metrics::Explanation &one, const trace::RunInfo &run) {
  const std::vector<metrics::Culprit> culprits = metrics::culprits_of(one);
  if (one.miss == metrics::Miss::None || culprits.empty()) return {};
  return metrics::remedy(culprits.front(), run);
}

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
  return {{"task", id.task.value},         {"number", id.number},       {"missed", one.miss != metrics::Miss::None},
          {"end_to_end", one.end_to_end},  {"length_ns", one.length()}, {"text", metrics::headline(one, workload)},
          {"remedy", remedy_of(one, run)}, {"parts", std::move(parts)}};
}

WorstJob row_of(const metrics::Explanation &one, const trace::RunInfo &run) {
  WorstJob row{.job = one.job, .since = one.job.release - run.start, .lateness = {}, .main_cause = {}};
  if (one.miss != metrics::Miss::Lost) row.lateness = one.lateness();
  const std::vector<metrics::Culprit> culprits = metrics::culprits_of(one);
  if (!culprits.empty()) row.main_cause = culprits.front();
  return row;
}

// By column, with times in ns.
Json to_json(const std::vector<WorstJob> &worst, const Workload &workload) {
  Json rows = Json::object();
  for (const char *name : {"task", "number", "since", "lateness", "outcome", "reason", "main", "main_ns"})
    rows[name] = Json::array();
  for (const WorstJob &row : worst) {
    rows["task"].push_back(row.job.task.value);
    rows["number"].push_back(row.job.number);
    rows["since"].push_back(row.since);
    rows["lateness"].push_back(row.lateness ? Json(*row.lateness) : Json());
    rows["outcome"].push_back(static_cast<int>(row.job.outcome));
    rows["reason"].push_back(static_cast<int>(row.job.reason));
    rows["main"].push_back(row.main_cause ? Json(metrics::describe(*row.main_cause, workload)) : Json());
    rows["main_ns"].push_back(row.main_cause ? Json(row.main_cause->time) : Json());
  }
  return rows;
}

// Null if no deadline was missed.
Json to_json(const std::optional<metrics::MainCause> &main, const trace::RunInfo &run) {
  if (!main) return {};
  return {{"cause", to_string(main->culprits.front().cause)},
          {"jobs", main->jobs},
          {"text", metrics::describe(*main, run.workload)},
          {"remedy", metrics::remedy(*main, run)}};
}

}  // namespace

Result<WhyDigest> why_of(const metrics::Investigation &investigation, const Schedule &schedule) {
  std::vector<metrics::Subject> subjects = investigation.misses();
  if (subjects.empty()) subjects = investigation.closest(kClosest);
  std::set<metrics::JobId> seen;
  for (const Window &window : schedule.windows) {
    for (const metrics::JobRecord &job : window.jobs) seen.insert({job.task, job.number});
  }
  WhyDigest why;
  why.missed = investigation.missed();
  why.misses = investigation.misses_in_all();
  why.explained = subjects.size();
  why.worst.resize(std::min(kMostListed, subjects.size()));
  metrics::CulpritCount causes;
  std::map<std::size_t, metrics::Explanation> shown;  // by rank
  const auto take = [&](std::size_t rank, metrics::Explanation one) {
    causes.add(one);
    if (rank < why.worst.size()) why.worst[rank] = row_of(one, investigation.run());
    if (rank >= kWorst && !seen.contains({one.job.task, one.job.number})) return;
    shown.emplace(rank, std::move(one));
    if (shown.size() > kMostShown) shown.erase(std::prev(shown.end()));
  };
  const Result<std::uint64_t> explained = investigation.explain(subjects, take);
  if (!explained) return tl::unexpected<Diagnostics>(explained.error());
  why.causes = causes.sorted();
  for (auto &[rank, one] : shown) why.jobs.push_back(std::move(one));
  return why;
}

std::string to_json(const WhyDigest &why, const trace::RunInfo &run) {
  const Workload &workload = run.workload;
  Json causes = Json::array();
  for (std::size_t i = 0; i < std::min(kMostCauses, why.causes.size()); ++i) {
    const metrics::Culprit &cause = why.causes[i];
    causes.push_back({{"text", metrics::describe(cause, workload)},
                      {"remedy", metrics::remedy(cause, run)},
                      {"jobs", cause.jobs},
                      {"main", cause.main},
                      {"time_ns", cause.time}});
  }
  Json jobs = Json::array();
  for (const metrics::Explanation &one : why.jobs) jobs.push_back(to_json(one, run));
  const Json document{{"misses", why.misses},
                      {"missed", why.missed},
                      {"late_end_to_end", why.misses - why.missed},
                      {"explained", why.explained},
                      {"main_cause", to_json(why.misses == 0 ? std::nullopt : metrics::main_cause_of(why.causes), run)},
                      {"causes", std::move(causes)},
                      {"worst", to_json(why.worst, workload)},
                      {"jobs", std::move(jobs)}};
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace redag::report
