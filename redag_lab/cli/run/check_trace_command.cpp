// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>

#include "redag/base/text.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/run/run_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"

namespace redag::cli {
namespace {

struct Options {
  std::vector<std::string> places;
  bool json = false;
};

Json describe_run(const trace::Trace &trace) {
  return Json{{"workload", trace.info.workload.name},
              {"executor", trace.info.executor},
              {"preemption", trace.info.preemption},
              {"driver", trace::to_string(trace.info.driver)},
              {"end_ns", trace.info.end},
              {"events", trace.events.size()}};
}

class Checking {
 public:
  Checking(const Options &options, Console &console) : options_(options), console_(console) {}

  int run() {
    for (const std::string &place : options_.places) {
      const Result<std::vector<std::string>> files = find_traces(place);
      if (!files) {
        report_unreadable(place, files.error());
        continue;
      }
      for (const std::string &file : *files) check(file);
    }
    const bool ok = readable_ && lawful_;
    if (options_.json) {
      console_.print(to_text(Json{{"format", "redag.check-trace/1"}, {"ok", ok}, {"traces", traces_}}));
    }
    if (!readable_) return kExitBad;
    return lawful_ ? kExitOk : kExitNo;
  }

 private:
  void report_unreadable(const std::string &file, const Diagnostics &errors) {
    readable_ = false;
    console_.note(errors);
    if (options_.json)
      traces_.push_back(Json{{"file", file}, {"ok", false}, {"diagnostics", diagnostics_json(errors)}});
  }

  void check(const std::string &file) {
    const Result<trace::Trace> trace = trace::read_trace(file);
    if (!trace) {
      report_unreadable(file, trace.error());
      return;
    }
    const metrics::CheckReport report = metrics::check_trace(*trace, metrics::rules_for(trace->info));
    lawful_ = lawful_ && report.ok();
    if (options_.json) {
      traces_.push_back(
          Json{{"file", file}, {"ok", report.ok()}, {"run", describe_run(*trace)}, {"check", to_json(report)}});
      return;
    }
    console_.print(fmt::format("{}: {}, {}, {}, {} events\n  {}", file, trace->info.executor, trace->info.preemption,
                               humanize_duration(trace->info.end - trace->info.start),
                               format_count(trace->events.size()), describe_check(report, console_.out_traits())));
  }

  const Options &options_;
  Console &console_;
  Json traces_ = Json::array();
  bool readable_ = true;
  bool lawful_ = true;
};

}  // namespace

Action add_check_trace(CLI::App &app) {
  auto options = std::make_shared<Options>();
  app.add_option("PLACE", options->places, "Traces (events.jsonl), or folders that hold traces at any depth")
      ->required();
  app.add_flag("--json", options->json, "Write the verdicts as one JSON document");
  return [options](Console &console) { return Checking(*options, console).run(); };
}

}  // namespace redag::cli
