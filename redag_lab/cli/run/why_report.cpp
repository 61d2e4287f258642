// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/why_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "redag/base/text.hpp"
#include "redag_analysis/metrics/why/why_remedy.hpp"
#include "redag_analysis/metrics/why/why_text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/words.hpp"
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

// How late a job was, or why it was lost; of a job that met its deadline the slack.
std::string margin(const Explanation &one) {
  if (one.miss == metrics::Miss::Lost) return to_string(one.job.reason);
  return humanize_duration(one.miss == metrics::Miss::None ? -one.lateness() : one.lateness());
}

// Empty of a job in time.
std::string remedy_of(const Explanation &one, const trace::RunInfo &run) {
  const std::vector<Culprit> culprits = metrics::culprits_of(one);
  return one.miss == metrics::Miss::None || culprits.empty() ? "" : metrics::remedy(culprits.front(), run);
}

std::string what_to_change(const std::string &remedy, const StreamTraits &terminal) {
  return remedy.empty() ? std::string() : wrapped("What to change: " + remedy, 0, terminal.width);
}

// The first lines of a run with misses: the kind of cause that delayed most jobs most, and what to do about it.
std::string main_cause(const WhyOverview &overview, const trace::RunInfo &run, const StreamTraits &terminal) {
  if (overview.misses() == 0) return {};
  const std::optional<metrics::MainCause> main = metrics::main_cause_of(overview.causes);
  if (!main) return {};
  const std::string words = fmt::format("Main cause of {} of {}: {}", format_count(main->jobs),
                                        format_count(overview.explained), metrics::describe(*main, run.workload));
  return wrapped(words, 0, terminal.width) + what_to_change(metrics::remedy(*main, run), terminal);
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
  if (causes.size() > kMostCauses) text += fmt::format("(and {})\n", plural(causes.size() - kMostCauses, "other"));
  return text + "jobs: delayed by this cause; mainly: delayed by it more than by any other\n";
}

Json or_null(const std::string &text) { return text.empty() ? Json() : Json(text); }

std::string headline_of(const WhyOverview &overview) {
  if (overview.misses() == 0) return "no deadline was missed; the jobs that came closest:";
  std::string text =
      fmt::format("{} of {} missed their deadline", format_count(overview.missed), plural(overview.jobs, "job"));
  if (overview.late_end_to_end > 0) {
    text += fmt::format("; {} only the end-to-end deadline", format_count(overview.late_end_to_end));
  }
  return text;
}

std::vector<metrics::PartRow> rows_of(const Explanation &one, std::size_t most) {
  return metrics::rows_of(one.parts, most == 0 ? one.parts.size() : most);
}

Json json_of(const Culprit &cause, const trace::RunInfo &run) {
  const Workload &workload = run.workload;
  return Json{{"cause", to_string(cause.cause)},
              {"task", cause.task.valid() ? Json(trace::task_name(workload, cause.task)) : Json()},
              {"text", metrics::describe(cause, workload)},
              {"remedy", or_null(metrics::remedy(cause, run))},
              {"jobs", cause.jobs},
              {"main", cause.main},
              {"time_ns", cause.time}};
}

Json json_of(const std::optional<metrics::MainCause> &main, const trace::RunInfo &run) {
  if (!main) return {};
  return Json{{"cause", to_string(main->culprits.front().cause)},
              {"jobs", main->jobs},
              {"text", metrics::describe(*main, run.workload)},
              {"remedy", or_null(metrics::remedy(*main, run))}};
}

Json json_of(const Explanation &one, const trace::RunInfo &run, std::size_t most) {
  const auto name = [&](const JobId &job) { return job.valid() ? Json(metrics::job_name(run.workload, job)) : Json(); };
  Json parts = Json::array();
  for (const metrics::PartRow &row : rows_of(one, most)) {
    const Part &first = row.parts.front();
    const bool is_one = row.parts.size() == 1;
    parts.push_back(Json{{"cause", is_one ? Json(to_string(first.cause)) : Json()},
                         {"job", is_one ? name(first.job) : Json()},
                         {"by", is_one ? name(first.by) : Json()},
                         {"begin_ns", row.begin() == kNever ? Json() : Json(row.begin())},
                         {"length_ns", row.length()},
                         {"text", metrics::describe(row, run.workload, id_of(one))}});
  }
  return Json{{"job", name(id_of(one))},
              {"text", metrics::headline(one, run.workload)},
              {"remedy", or_null(remedy_of(one, run))},
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
  for (const metrics::PartRow &row : rows_of(one, most)) {
    text += line(row.begin() == kNever ? "" : humanize_duration(row.begin() - one.begin), row.length(), one.length(),
                 metrics::describe(row, run.workload, id_of(one)), terminal);
  }
  const char *whole = one.job.outcome != metrics::JobOutcome::Finished ? "until it ended, or the run did"
                      : one.end_to_end                                 ? "end to end"
                                                                       : "response time";
  text += line("", one.length(), one.length(), whole, terminal);
  const std::vector<Culprit> culprits = metrics::culprits_of(one);
  if (!culprits.empty() && (one.miss != metrics::Miss::None || !metrics::is_work(culprits.front().cause))) {
    const Culprit &main = culprits.front();
    std::string words = "Main cause: " + metrics::describe(main, run.workload);
    if (main.time > 0) {
      words += fmt::format(" ({} of {})", humanize_duration(main.time), humanize_duration(one.length()));
    }
    text += "\n" + wrapped(words, 0, terminal.width);
    text += what_to_change(remedy_of(one, run), terminal);
  }
  if (most > 0 && one.parts.size() > most) text += "(the longest parts; --all shows all)\n";
  return text;
}

std::string describe(const WhyOverview &overview, const trace::RunInfo &run, const StreamTraits &terminal) {
  const std::size_t count = overview.explained;
  const std::string headline = headline_of(overview);
  std::string text = tinted(headline, overview.misses() == 0 ? Tint::Good : Tint::Bad, terminal.colour) + "\n";
  if (overview.misses() > count) text += fmt::format("(explained: the worst {})\n", format_count(count));
  if (count == 0) return text;
  text += main_cause(overview, run, terminal);
  text += "\n" + causes_table(overview.causes, run, terminal) + "\n";
  Table table({{"job", false, 9},
               {overview.misses() == 0 ? "slack" : "late or lost", true, 8},
               {.title = "main cause", .importance = 7, .prose = true},
               {"share", true, 6}});
  for (const Explanation &one : overview.explanations) {
    const std::vector<Culprit> culprits = metrics::culprits_of(one);
    table.add({{metrics::job_name(run.workload, id_of(one))},
               {margin(one), tint_of(one)},
               {culprits.empty() ? "lost at its release" : metrics::describe(culprits.front(), run.workload)},
               {culprits.empty() ? "-" : format_percent(share_of(culprits.front().time, one.length()))}});
  }
  text += table.render(terminal.width, terminal.colour);
  const std::size_t shown = overview.explanations.size();
  if (shown < count) text += fmt::format("(the worst {} of {}; --all shows all)\n", shown, format_count(count));
  return text;
}

Json to_json(const WhyOverview &overview, const trace::RunInfo &run, std::size_t most) {
  Json causes = Json::array();
  for (const Culprit &cause : overview.causes) causes.push_back(json_of(cause, run));
  Json jobs = Json::array();
  for (const Explanation &one : overview.explanations) jobs.push_back(json_of(one, run, most));
  return Json{{"format", "redag.why/1"},
              {"workload", run.workload.name},
              {"executor", run.executor},
              {"released", overview.jobs},
              {"misses", overview.misses()},
              {"missed", overview.missed},
              {"late_end_to_end", overview.late_end_to_end},
              {"main_cause", overview.misses() == 0 ? Json() : json_of(metrics::main_cause_of(overview.causes), run)},
              {"causes", std::move(causes)},
              {"jobs", std::move(jobs)}};
}

}  // namespace redag::cli
