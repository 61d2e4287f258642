// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <vector>

#include "redag/base/check.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/jobs_csv.hpp"
#include "redag_analysis/metrics/perfetto.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/metrics/summary_json.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_analysis/metrics/why.hpp"
#include "redag_lab/report/document.hpp"
#include "redag_lab/report/page.hpp"
#include "redag_lab/report/verdict.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void trace_target(std::string_view input) {
  const Result<trace::Trace> trace = trace::parse_trace(input, "events.jsonl");
  if (!trace) {
    REDAG_CHECK(!trace.error().empty(), "a refusal says why");
    return;
  }
  (void)metrics::check_trace(*trace, metrics::rules_for(trace->info));
  (void)metrics::check_trace(*trace);
  (void)metrics::summary_to_json(metrics::summarize(*trace), trace->info);
  const metrics::Investigation investigation = metrics::Investigation::of(*trace).value();
  const std::vector<metrics::Explanation> explanations = investigation.explain(investigation.misses()).value();
  for (const metrics::Explanation &one : explanations) {
    Duration sum = 0;
    for (const metrics::Part &part : one.parts) sum += part.length;
    REDAG_CHECK(sum == one.length(), "parts sum to the whole");
  }
  const std::string &folder = scratch_folder();
  const auto jobs = metrics::fold_jobs(trace->info.workload, trace->events);
  REDAG_CHECK(metrics::write_jobs_csv(folder + "/jobs.csv", trace->info.workload, jobs).has_value(), "jobs.csv");
  REDAG_CHECK(metrics::write_perfetto(folder + "/trace.pftrace", *trace).has_value(), "trace.pftrace");
  std::vector<report::Group> groups;
  groups.emplace_back("fuzz", report::digest_options(1));
  REDAG_CHECK(groups.back().add(folder, *trace).has_value(), "a trace in memory can be read");
  if (groups.back().fits(trace->info)) REDAG_CHECK(groups.back().add(folder, *trace).has_value(), "and again");
  groups.back().finish();
  (void)report::page(report::to_json(groups), report::title_of(groups));
  (void)report::verdict_of(groups.front());
  REDAG_CHECK(trace::write_trace(folder + "/events.jsonl", *trace).has_value(), "events.jsonl");
  const Result<trace::Trace> again = trace::read_trace(folder + "/events.jsonl");
  REDAG_CHECK(again.has_value() && again->events.size() == trace->events.size(), "what was written can be read");
}

}  // namespace redag::fuzz
