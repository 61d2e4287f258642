// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/why_report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag/base/text.hpp"
#include "redag_analysis/metrics/why_text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/wrap.hpp"

namespace redag::cli {
namespace {

using metrics::Culprit;
using metrics::Explanation;
using metrics::JobId;
using metrics::Part;

constexpr std::size_t kMostCauses = 12;

JobId id_of(const Explanation &one) { return {one.job.task, one.job.number}; }

double share_of(Duration part, Duration whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

std::string line(const std::string &since, Duration length, Duration whole, const std::string &words,
                 const StreamTraits &terminal) {
  const std::string begin =
      fmt::format("{:>10}  {:>15}  {:>7}  ", since, format_count(static_cast<std::uint64_t>(length)),
                  format_percent(share_of(length, whole)));
  return begin + wrapped(words, begin.size(), terminal.width);
}

Tint tint_of(const Explanation &one) { return one.miss == metrics::Miss::None ? Tint::Good : Tint::Bad; }

// How late a job was, or that it was lost.
std::string lateness(const Explanation &one) {
  if (one.miss == metrics::Miss::Lost) return to_string(one.job.reason);
  const Duration late = one.lateness();
  return (late < 0 ? "-" : "") + humanize_duration(late < 0 ? -late : late);
}

std::string causes_table(const std::vector<Culprit> &causes, const trace::RunInfo &run, const StreamTraits &terminal) {
  Table table(
      {{.title = "cause", .importance = 9, .prose = true}, {"jobs", true, 5}, {"mainly", true, 8}, {"time", true, 7}});
  std::size_t shown = 0;
  for (const Culprit &cause : causes) {
    if (shown++ == kMostCauses) break;
    table.add({{metrics::describe(cause, run.workload)},
               {format_count(cause.jobs)},
               {format_count(cause.main), cause.main > 0 ? Tint::Strong : Tint::Faint},
               {humanize_duration(cause.time)}});
  }
  std::string text = table.render(terminal.width, terminal.colour);
  if (causes.size() > kMostCauses) text += fmt::format("(and {} others)\n", format_count(causes.size() - kMostCauses));
  return text + "jobs: delayed by this cause; mainly: delayed by it more than by any other\n";
}

Json to_json(const Culprit &cause, const Workload &workload) {
  Json row{{"cause", to_string(cause.cause)},
           {"task", cause.task.valid() ? Json(trace::task_name(workload, cause.task)) : Json()},
           {"program", cause.program.empty() ? Json() : Json(cause.program)},
           {"text", metrics::describe(cause, workload)},
           {"jobs", cause.jobs},
           {"main", cause.main},
           {"time_ns", cause.time}};
  return row;
}

Json to_json(const Explanation &one, const trace::RunInfo &run) {
  const auto name = [&](const JobId &job) { return job.valid() ? Json(metrics::job_name(run.workload, job)) : Json(); };
  Json parts = Json::array();
  for (const Part &part : one.parts) {
    parts.push_back(Json{{"cause", to_string(part.cause)},
                         {"job", name(part.job)},
                         {"by", name(part.by)},
                         {"program", part.program.empty() ? Json() : Json(part.program)},
                         {"begin_ns", part.begin == kNever ? Json() : Json(part.begin)},
                         {"length_ns", part.length},
                         {"text", metrics::describe(part, run.workload, id_of(one))}});
  }
  return Json{{"job", name(id_of(one))},
              {"text", metrics::headline(one, run.workload)},
              {"outcome", to_string(one.job.outcome)},
              {"missed", one.miss != metrics::Miss::None},
              {"end_to_end", one.end_to_end},
              {"begin_ns", one.begin},
              {"length_ns", one.length()},
              {"parts", std::move(parts)}};
}

}  // namespace

std::string describe(const Explanation &one, const trace::RunInfo &run, const StreamTraits &terminal,
                     std::size_t most) {
  std::string text = tinted(metrics::headline(one, run.workload), tint_of(one), terminal.colour) + "\n\n";
  text += fmt::format("{:>10}  {:>15}  {:>7}  what happened\n", one.end_to_end ? "origin +" : "release +",
                      "nanoseconds", "share");
  for (const metrics::PartRow &row : metrics::rows_of(one.parts, most == 0 ? one.parts.size() : most)) {
    text += line(row.begin() == kNever ? "" : humanize_duration(row.begin() - one.begin), row.length(), one.length(),
                 metrics::describe(row, run.workload, id_of(one)), terminal);
  }
  const char *whole = one.job.outcome != metrics::JobOutcome::Finished ? "until it ended, or the run did"
                      : one.end_to_end                                 ? "end to end"
                                                                       : "response time";
  text += line("", one.length(), one.length(), whole, terminal);
  const std::vector<Culprit> culprits = metrics::culprits_of(one.parts);
  if (!culprits.empty() && !metrics::is_work(culprits.front().cause)) {
    text += "\n" + wrapped(fmt::format("Main cause: {} ({} of {})", metrics::describe(culprits.front(), run.workload),
                                       humanize_duration(culprits.front().time), humanize_duration(one.length())),
                           0, terminal.width);
  }
  if (most > 0 && one.parts.size() > most) text += "(the longest parts; --all shows all)\n";
  return text;
}

std::string describe(const WhyOverview &overview, const trace::RunInfo &run, const StreamTraits &terminal) {
  const std::size_t count = overview.explained;
  const std::string headline =
      overview.misses == 0
          ? std::string("no deadline was missed; the jobs that came closest:")
          : fmt::format("{} of {} jobs missed a deadline", format_count(overview.misses), format_count(overview.jobs));
  std::string text = tinted(headline, overview.misses == 0 ? Tint::Good : Tint::Bad, terminal.colour) + "\n";
  if (overview.misses > count) text += fmt::format("(explained: the worst {})\n", format_count(count));
  if (count == 0) return text;
  text += "\n" + causes_table(overview.causes, run, terminal) + "\n";
  Table table({{"job", false, 9},
               {"late or lost", true, 8},
               {.title = "main cause", .importance = 7, .prose = true},
               {"share", true, 6}});
  for (const Explanation &one : overview.explanations) {
    const std::vector<Culprit> culprits = metrics::culprits_of(one.parts);
    table.add({{metrics::job_name(run.workload, id_of(one))},
               {lateness(one), tint_of(one)},
               {culprits.empty() ? "lost at its release" : metrics::describe(culprits.front(), run.workload)},
               {culprits.empty() ? "-" : format_percent(share_of(culprits.front().time, one.length()))}});
  }
  text += table.render(terminal.width, terminal.colour);
  const std::size_t shown = overview.explanations.size();
  if (shown < count) text += fmt::format("(the worst {} of {}; --all shows all)\n", shown, format_count(count));
  return text;
}

Json to_json(const WhyOverview &overview, const trace::RunInfo &run) {
  Json causes = Json::array();
  for (const Culprit &cause : overview.causes) causes.push_back(to_json(cause, run.workload));
  Json jobs = Json::array();
  for (const Explanation &one : overview.explanations) jobs.push_back(to_json(one, run));
  return Json{{"format", "redag.why/1"},   {"workload", run.workload.name}, {"executor", run.executor},
              {"released", overview.jobs}, {"misses", overview.misses},     {"causes", std::move(causes)},
              {"jobs", std::move(jobs)}};
}

}  // namespace redag::cli
