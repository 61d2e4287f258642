// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "redag/base/nearest.hpp"
#include "redag/base/text.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_lab/cli/run/why_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"

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
    const std::optional<trace::Trace> trace = read();
    if (!trace) return kExitBad;
    if (trace->info.lost_events > 0) {
      console_.warn(fmt::format("{} events of this run were lost: explanations can be wrong",
                                format_count(trace->info.lost_events)));
    }
    if (kernel_ && kernel_->lost > 0) {
      console_.warn(fmt::format("the kernel dropped {} of its events: other programs can be missing",
                                format_count(kernel_->lost)));
    }
    const metrics::Investigation investigation(*trace, kernel_ ? &*kernel_ : nullptr);
    return options_.job.empty() ? explain_run(investigation) : explain_job(investigation);
  }

 private:
  std::optional<trace::Trace> read() {
    const Result<std::string> file = find_trace(options_.place);
    if (!file) {
      console_.note(file.error());
      return std::nullopt;
    }
    Result<trace::Trace> trace = trace::read_trace(*file);
    if (!trace) {
      console_.note(trace.error());
      return std::nullopt;
    }
    Result<std::optional<metrics::KernelRecord>> kernel = metrics::read_kernel_record_of(*file, trace->info);
    if (!kernel) {
      console_.note(kernel.error());
      return std::nullopt;
    }
    kernel_ = *std::move(kernel);
    return *std::move(trace);
  }

  int explain_run(const metrics::Investigation &investigation) {
    std::vector<metrics::Subject> subjects = investigation.misses();
    WhyOverview overview;
    overview.misses = subjects.size();
    overview.jobs = investigation.counted();
    if (subjects.empty()) subjects = investigation.closest(kClosest);
    subjects.resize(std::min(subjects.size(), kMostExplained));
    overview.explanations = investigation.explain(subjects);
    if (options_.json) {
      console_.print(to_text(to_json(overview, investigation.run())));
      return kExitOk;
    }
    console_.say(describe(overview, investigation.run(), console_.out_traits(), options_.all ? 0 : kRows));
    if (overview.explanations.empty()) return kExitOk;
    const metrics::JobRecord &worst = overview.explanations.front().job;
    console_.say(fmt::format("'redag why {} {}#{}' explains one job\n", options_.place,
                             trace::task_name(investigation.run().workload, worst.task), worst.number));
    return kExitOk;
  }

  int explain_job(const metrics::Investigation &investigation) {
    std::optional<metrics::Subject> subject = find(investigation);
    if (!subject) return kExitBad;
    if (options_.end_to_end) subject->end_to_end = true;
    WhyOverview overview;
    overview.explanations = investigation.explain(std::vector{*subject});
    const metrics::Explanation &one = overview.explanations.front();
    overview.misses = one.miss == metrics::Miss::None ? 0 : 1;
    overview.jobs = 1;
    if (options_.json) {
      console_.print(to_text(to_json(overview, investigation.run())));
    } else {
      console_.say(describe(one, investigation.run(), console_.out_traits(), options_.all ? 0 : kParts));
    }
    return kExitOk;
  }

  // Returns the job that the user names: "dag.task#12", or "dag.task" for the worst one of the task.
  std::optional<metrics::Subject> find(const metrics::Investigation &investigation) {
    const std::size_t mark = options_.job.rfind('#');
    const std::string name = options_.job.substr(0, mark);
    std::vector<std::string> names;
    const std::size_t count = investigation.run().workload.task_count();
    for (std::size_t t = 0; t < count; ++t) names.push_back(trace::task_name(investigation.run().workload, TaskId(t)));
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) {
      console_.error(fmt::format("there is no task {} in this run", in_quotes(name)), suggestion(name, names));
      return std::nullopt;
    }
    const TaskId task(static_cast<std::size_t>(found - names.begin()));
    const auto is_of_task = [&](const metrics::Subject &one) { return investigation.jobs()[one.job].task == task; };
    if (mark == std::string::npos) {
      for (const auto &subjects : {investigation.misses(), investigation.closest(count)}) {
        const auto worst = std::find_if(subjects.begin(), subjects.end(), is_of_task);
        if (worst != subjects.end()) return *worst;
      }
      console_.error(fmt::format("no job of {} has ended in this run", name));
      return std::nullopt;
    }
    const std::string number = options_.job.substr(mark + 1);
    for (std::size_t i = 0; i < investigation.jobs().size(); ++i) {
      if (!is_of_task({i, false}) || std::to_string(investigation.jobs()[i].number) != number) continue;
      return metrics::Subject{i, investigation.miss(i) == metrics::Miss::EndToEnd};
    }
    console_.error(
        fmt::format("{} has no job {} in this run", name, in_quotes(number)),
        fmt::format("its jobs are 0 to {}; '{}' alone is its worst one", last_of(investigation, task), name));
    return std::nullopt;
  }

  static std::uint32_t last_of(const metrics::Investigation &investigation, TaskId task) {
    std::uint32_t last = 0;
    for (const metrics::JobRecord &job : investigation.jobs()) {
      if (job.task == task) last = std::max(last, job.number);
    }
    return last;
  }

  const WhyOptions &options_;
  Console &console_;
  std::optional<metrics::KernelRecord> kernel_;
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
