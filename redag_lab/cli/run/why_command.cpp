// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "redag/base/nearest.hpp"
#include "redag/base/text.hpp"
#include "redag/trace/recording.hpp"
#include "redag_lab/cli/run/recorded_runs.hpp"
#include "redag_lab/cli/run/why_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"

namespace redag::cli {
namespace {

constexpr std::size_t kMostExplained = 100'000;
constexpr std::size_t kRows = 20;
constexpr std::size_t kParts = 40;
constexpr std::size_t kClosest = 5;  // explained where no deadline was missed

struct WhyOptions {
  std::string place;
  std::string job;
  bool end_to_end = false;
  bool all = false;
  bool json = false;
};

class Explaining {
 public:
  Explaining(const WhyOptions &options, Console &console) : options_(options), console_(console) {}

  int run() {
    const Result<int> explained = explain();
    return ok(explained, console_) ? *explained : kExitBad;
  }

 private:
  Result<int> explain() {
    const Result<ChosenRun> chosen = choose_run(options_.place);
    if (!chosen) return tl::unexpected<Diagnostics>(chosen.error());
    console_.note(chosen->note);
    const std::string &file = chosen->file;
    const Result<trace::Recording> trace = trace::Recording::open(file);
    if (!trace) return tl::unexpected<Diagnostics>(trace.error());
    warn_of_remarks(trace->info(), console_);
    if (trace->info().lost_events > 0) {
      console_.warn(fmt::format("{} events of this run were lost: explanations can be wrong",
                                format_count(trace->info().lost_events)));
    }
    const Result<metrics::Investigation> investigation = metrics::Investigation::of(*trace, kMostExplained);
    if (!investigation) return tl::unexpected<Diagnostics>(investigation.error());
    return options_.job.empty() ? explain_run(*investigation) : explain_job(*investigation);
  }

  Result<int> explain_run(const metrics::Investigation &investigation) {
    const std::vector<metrics::Subject> subjects =
        investigation.misses().empty() ? investigation.closest(kClosest) : investigation.misses();
    WhyOverview overview{.missed = investigation.missed(),
                         .late_end_to_end = investigation.late_end_to_end(),
                         .jobs = investigation.counted()};
    const Result<void> explained = explain(investigation, subjects, overview);
    if (!explained) return tl::unexpected<Diagnostics>(explained.error());
    if (options_.json) return print(overview, investigation);
    console_.say(describe(overview, investigation.run(), console_.out_traits()));
    if (overview.explanations.empty()) return kExitOk;
    const metrics::JobRecord &worst = overview.explanations.front().job;
    console_.say(fmt::format("'redag why {} {}#{}' explains one job\n", options_.place,
                             trace::task_name(investigation.run().workload, worst.task), worst.number));
    return kExitOk;
  }

  Result<int> explain_job(const metrics::Investigation &investigation) {
    const Result<std::optional<metrics::Subject>> found = find(investigation);
    if (!found) return tl::unexpected<Diagnostics>(found.error());
    if (!*found) return kExitBad;
    metrics::Subject subject = **found;
    if (options_.end_to_end) subject.end_to_end = true;
    WhyOverview overview{.jobs = 1};
    const Result<void> explained = explain(investigation, {&subject, 1}, overview);
    if (!explained) return tl::unexpected<Diagnostics>(explained.error());
    const metrics::Explanation &one = overview.explanations.front();
    overview.late_end_to_end = one.miss == metrics::Miss::EndToEnd ? 1 : 0;
    overview.missed = one.miss == metrics::Miss::None ? 0 : 1 - overview.late_end_to_end;
    if (options_.json) return print(overview, investigation);
    console_.say(describe(one, investigation.run(), console_.out_traits(), most_parts_));
    return kExitOk;
  }

  // Counts the causes of all these jobs, and keeps the explanations of those to be shown.
  Result<void> explain(const metrics::Investigation &investigation, std::span<const metrics::Subject> subjects,
                       WhyOverview &overview) {
    overview.explained = subjects.size();
    overview.explanations.resize(options_.all ? subjects.size() : std::min(kRows, subjects.size()));
    metrics::CulpritCount causes;
    Result<void> explained = investigation.explain(subjects, [&](std::size_t rank, metrics::Explanation one) {
      causes.add(one);
      if (rank < overview.explanations.size()) overview.explanations[rank] = std::move(one);
    });
    overview.causes = causes.sorted();
    return explained;
  }

  int print(const WhyOverview &overview, const metrics::Investigation &investigation) {
    console_.print(to_text(to_json(overview, investigation.run(), most_parts_)));
    return kExitOk;
  }

  // Returns the job that the user names: "dag.task#12", or "dag.task" for the worst one of the task. Without one, says
  // why.
  Result<std::optional<metrics::Subject>> find(const metrics::Investigation &investigation) {
    const std::size_t mark = options_.job.rfind('#');
    const std::string name = options_.job.substr(0, mark);
    std::vector<std::string> names;
    const std::size_t count = investigation.run().workload.task_count();
    for (std::size_t t = 0; t < count; ++t) names.push_back(trace::task_name(investigation.run().workload, TaskId(t)));
    const auto known = std::find(names.begin(), names.end(), name);
    if (known == names.end()) {
      console_.error(fmt::format("there is no task {} in this run", in_quotes(name)), suggestion(name, names));
      return std::nullopt;
    }
    const TaskId task(static_cast<std::size_t>(known - names.begin()));
    if (mark == std::string::npos) {
      const std::optional<metrics::Subject> worst = investigation.worst_of(task);
      if (!worst) console_.error(fmt::format("no job of {} has ended in this run", name));
      return worst;
    }
    const std::string text = options_.job.substr(mark + 1);
    std::uint32_t number = 0;
    const auto [end, mistake] = std::from_chars(text.data(), text.data() + text.size(), number);
    const bool is_number = mistake == std::errc() && std::to_string(number) == text;
    Result<std::optional<metrics::Subject>> found =
        is_number ? investigation.find({task, number}) : Result<std::optional<metrics::Subject>>(std::nullopt);
    if (found && !*found) {
      console_.error(
          fmt::format("{} has no job {} in this run", name, in_quotes(text)),
          fmt::format("its jobs are 0 to {}; '{}' alone is its worst one", investigation.last_number(task), name));
    }
    return found;
  }

  const WhyOptions &options_;
  Console &console_;
  const std::size_t most_parts_ = options_.all ? 0 : kParts;
};

}  // namespace

Action add_why(CLI::App &app) {
  auto options = std::make_shared<WhyOptions>();
  app.add_option("RESULT", options->place, "Folder of a recorded run (--out of run, simulate), or its events.redag")
      ->type_name("RESULT")
      ->required();
  CLI::Option *job = app.add_option("JOB", options->job,
                                    "Job to explain: dag.task#12, or dag.task for its worst job (default: all misses)");
  app.add_flag("--end-to-end", options->end_to_end,
               "Explain the time since the release of the source whose data the job carries")
      ->needs(job);
  app.add_flag("--all", options->all, "Show every miss, or every part of JOB, however many there are");
  app.add_flag("--json", options->json, "Write one JSON document, and nothing else, to standard output");
  return [options](Console &console) { return Explaining(*options, console).run(); };
}

}  // namespace redag::cli
