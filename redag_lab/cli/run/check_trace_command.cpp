// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>

#include "redag/base/text.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/run/recorded_runs.hpp"
#include "redag_lab/cli/run/run_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"

namespace redag::cli {
namespace {

struct CheckTraceOptions {
  std::vector<std::string> places;
  bool json = false;
};

Json describe_run(const trace::RunInfo &run, std::uint64_t events) {
  return Json{{"workload", run.workload.name},          {"executor", run.executor}, {"preemption", run.preemption},
              {"driver", trace::to_string(run.driver)}, {"end_ns", run.end},        {"events", events}};
}

// Reads a file once, some events at a time.
Result<metrics::CheckReport> check_events(trace::EventsReader &reader) {
  const trace::RunInfo &run = reader.info();
  metrics::TraceChecker checker(run, metrics::rules_for(run));
  const Result<void> read = reader.visit([&](std::span<const JobEvent> events) {
    if (run.lost_events == 0) checker.add(events);
  });
  if (!read) return tl::unexpected<Diagnostics>(read.error());
  return checker.finish(run.end, run.lost_events);
}

class Checking {
 public:
  Checking(const CheckTraceOptions &options, Console &console) : options_(options), console_(console) {}

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
    Result<trace::EventsReader> reader = trace::EventsReader::open(file);
    if (!reader) {
      report_unreadable(file, reader.error());
      return;
    }
    warn_of_remarks(reader->info(), console_);
    const Result<metrics::CheckReport> report = check_events(*reader);
    if (!report) {
      report_unreadable(file, report.error());
      return;
    }
    lawful_ = lawful_ && report->ok();
    const trace::RunInfo &run = reader->info();
    if (options_.json) {
      traces_.push_back(Json{{"file", file},
                             {"ok", report->ok()},
                             {"run", describe_run(run, reader->events())},
                             {"check", to_json(*report)}});
      return;
    }
    console_.say(fmt::format("{}: {}, {}, {}, {} events\n  {}", file, run.executor, run.preemption,
                             humanize_duration(run.end - run.start), format_count(reader->events()),
                             describe_check(*report, console_.out_traits())));
  }

  const CheckTraceOptions &options_;
  Console &console_;
  Json traces_ = Json::array();
  bool readable_ = true;
  bool lawful_ = true;
};

}  // namespace

Action add_check_trace(CLI::App &app) {
  auto options = std::make_shared<CheckTraceOptions>();
  app.add_option("PLACE", options->places, "Traces (events.redag), or folders that hold traces at any depth")
      ->type_name("RESULT")
      ->required();
  app.add_flag("--json", options->json, "Write the verdicts as one JSON document");
  return [options](Console &console) { return Checking(*options, console).run(); };
}

}  // namespace redag::cli
