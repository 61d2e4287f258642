// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/compile.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag/loader/text_file.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/trace/run_info_json.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/metrics/files/jobs_csv.hpp"
#include "redag_analysis/metrics/perfetto/perfetto.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/run/recorded_runs.hpp"
#include "redag_lab/cli/run/run_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

enum class Format : std::uint8_t { Jsonl, Jobs, Perfetto };

struct EventsOptions {
  std::vector<std::string> places;
  bool check = false;
  bool json = false;
  Format format = Format::Jsonl;
  std::string output;
};

/// Writes the events of a run as JSON Lines, to a file or to standard output.
class LinesWriter {
 public:
  LinesWriter(const trace::EventsReader &reader, std::optional<trace::OutputFile> file, Console &console)
      : reader_(reader), file_(std::move(file)), console_(console) {
    write(trace::run_header_to_json("redag.events/1", reader.info()) + "\n");
  }

  void add(std::span<const JobEvent> events) {
    std::string text;
    for (const JobEvent &event : events) {
      const std::int64_t worker = event.worker == WorkerId::kNoneValue ? -1 : std::int64_t{event.worker};
      fmt::format_to(std::back_inserter(text), FMT_COMPILE("[{},\"{}\",{},{},{},{},\"{}\"]\n"), event.time,
                     to_string(event.kind), event.task.value, event.job, worker, event.value, to_string(event.reason));
    }
    write(text);
  }

  Result<void> commit() {
    const trace::RunInfo &run = reader_.info();
    write(fmt::format("{{\"events\":{},\"end_ns\":{},\"lost_events\":{}}}\n", reader_.events(), run.end,
                      run.lost_events));
    return file_ ? file_->commit() : Result<void>();
  }

 private:
  void write(std::string_view text) { file_ ? file_->write(text) : console_.print(text); }

  const trace::EventsReader &reader_;
  std::optional<trace::OutputFile> file_;
  Console &console_;
};

// An output that a complete file may replace.
Result<void> check_place(const EventsOptions &options) {
  namespace fs = std::filesystem;
  if (options.output.empty()) {
    if (options.format == Format::Jsonl) return {};
    return make_error("--format: jobs and perfetto are not printed", "name a file with -o");
  }
  std::error_code ignored;
  const fs::file_status status = fs::symlink_status(options.output, ignored);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    return file_error(options.output, 0, "cannot write: it is not a file", "without -o, the events are printed");
  }
  return check_output(options.output);
}

// Gives all events to `writer`, some at a time.
template <class Writer>
Result<void> write_events(trace::EventsReader &reader, Writer &writer, const Console &console) {
  std::vector<JobEvent> events;
  while (!console.is_broken()) {
    if (InterruptGuard::interrupted()) return make_error("interrupted: the events are not complete");
    const Result<bool> more = reader.next(events);
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (!*more) break;
    writer.add(events);
  }
  return {};
}

Result<void> convert(const EventsOptions &options, Console &console) {
  if (Result<void> place = check_place(options); !place) return place;
  const Result<ChosenRun> chosen = choose_run(options.places.front());
  if (!chosen) return tl::unexpected<Diagnostics>(chosen.error());
  console.note(chosen->note);
  Result<trace::EventsReader> reader = trace::EventsReader::open(chosen->file);
  if (!reader) return tl::unexpected<Diagnostics>(std::move(reader.error()));
  warn_of_remarks(reader->info(), console);
  const InterruptGuard guard;
  if (options.format == Format::Perfetto) {
    Result<metrics::PerfettoWriter> picture = metrics::PerfettoWriter::create(options.output, reader->info());
    if (!picture) return tl::unexpected<Diagnostics>(std::move(picture.error()));
    const Result<void> drawn = write_events(*reader, *picture, console);
    return drawn ? picture->commit(reader->info().end) : drawn;
  }
  if (options.format == Format::Jobs) {
    Result<metrics::JobsCsvWriter> jobs = metrics::JobsCsvWriter::create(options.output, reader->info().workload);
    if (!jobs) return tl::unexpected<Diagnostics>(std::move(jobs.error()));
    const Result<void> listed = write_events(*reader, *jobs, console);
    return listed ? jobs->commit() : listed;
  }
  std::optional<trace::OutputFile> file;
  if (!options.output.empty()) {
    Result<trace::OutputFile> created = trace::OutputFile::create(options.output);
    if (!created) return tl::unexpected<Diagnostics>(std::move(created.error()));
    file.emplace(*std::move(created));
  }
  LinesWriter lines(*reader, std::move(file), console);
  const Result<void> written = write_events(*reader, lines, console);
  return written ? lines.commit() : written;
}

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

/// Checks traces against the rules of the model.
class Checking {
 public:
  Checking(const EventsOptions &options, Console &console) : options_(options), console_(console) {}

  int run() {
    for (const std::string &place : options_.places) {
      const Result<std::vector<std::string>> files = find_traces(place);
      if (!files) {
        report_unreadable(place, files.error());
        continue;
      }
      for (const std::string &file : *files) check(file);
    }
    const bool all_ok = readable_ && lawful_;
    if (options_.json) {
      console_.print(to_text(Json{{"format", "redag.check-trace/1"}, {"ok", all_ok}, {"traces", traces_}}));
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

  const EventsOptions &options_;
  Console &console_;
  Json traces_ = Json::array();
  bool readable_ = true;
  bool lawful_ = true;
};

}  // namespace

Action add_events(CLI::App &app) {
  auto options = std::make_shared<EventsOptions>();
  app.add_option("RESULT", options->places,
                 "Folder of a recorded run (--out of run, simulate), or its events; several with --check")
      ->required();
  const Choices<Format> formats{{"jsonl", Format::Jsonl}, {"jobs", Format::Jobs}, {"perfetto", Format::Perfetto}};
  CLI::Option *format =
      add_choice(app, "--format", options->format, formats,
                 "Format of the output: JSON Lines, jobs.csv with a row for each job, or a picture for Perfetto");
  CLI::Option *output = app.add_option("-o,--output", options->output, "File to write; by default the text is printed")
                            ->type_name("FILE");
  CLI::Option *check = app.add_flag("--check", options->check,
                                    "Check all traces in the results, at any depth, against the rules of the model; "
                                    "exit with status 1 if one breaks a rule")
                           ->excludes(format)
                           ->excludes(output);
  app.add_flag("--json", options->json, "Write the verdicts as one JSON document")->needs(check);
  return [options](Console &console) {
    if (options->check) return Checking(*options, console).run();
    if (options->places.size() > 1) {
      console.error("the events of one result are printed, and several are given", "--check takes several");
      return kExitBad;
    }
    return ok(convert(*options, console), console) ? kExitOk : kExitBad;
  };
}

}  // namespace redag::cli
