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

#include "redag/trace/events_file.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/trace/run_info_json.hpp"
#include "redag_analysis/metrics/jobs_csv.hpp"
#include "redag_lab/cli/run/recorded_runs.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/run/picture.hpp"

namespace redag::cli {
namespace {

enum class Format : std::uint8_t { Jsonl, Csv, Jobs, Perfetto };

struct EventsOptions {
  std::string place;
  Format format = Format::Jsonl;
  std::string output;
};

/// Takes the events of a run one batch after another.
class Converter {
 public:
  virtual ~Converter() = default;
  virtual void add(std::span<const JobEvent> events) = 0;
  [[nodiscard]] virtual Result<void> commit() = 0;
};

/// Text, for a file or for standard output.
class TextConverter final : public Converter {
 public:
  TextConverter(Format format, const trace::EventsReader &reader, std::optional<trace::OutputFile> file,
                Console &console)
      : is_csv_(format == Format::Csv),
        reader_(reader),
        file_(std::move(file)),
        console_(console),
        names_(metrics::csv_task_names(reader.info().workload)) {
    write(is_csv_ ? "time_ns,kind,dag,task,job,worker,value_ns,reason\n"
                  : trace::run_header_to_json("redag.events/1", reader.info()) + "\n");
  }

  void add(std::span<const JobEvent> events) override {
    std::string text;
    for (const JobEvent &event : events) is_csv_ ? append_row(event, text) : append_line(event, text);
    write(text);
  }

  Result<void> commit() override {
    const trace::RunInfo &run = reader_.info();
    if (!is_csv_) {
      write(fmt::format("{{\"events\":{},\"end_ns\":{},\"lost_events\":{}}}\n", reader_.events(), run.end,
                        run.lost_events));
    }
    return file_ ? file_->commit() : Result<void>();
  }

 private:
  static void append_line(const JobEvent &event, std::string &text) {
    const std::int64_t worker = event.worker == WorkerId::kNoneValue ? -1 : std::int64_t{event.worker};
    fmt::format_to(std::back_inserter(text), FMT_COMPILE("[{},\"{}\",{},{},{},{},\"{}\"]\n"), event.time,
                   to_string(event.kind), event.task.value, event.job, worker, event.value, to_string(event.reason));
  }

  void append_row(const JobEvent &event, std::string &text) const {
    fmt::format_to(std::back_inserter(text), FMT_COMPILE("{},{},{},{},"), event.time, to_string(event.kind),
                   names_[event.task.value], event.job);
    if (event.worker != WorkerId::kNoneValue) fmt::format_to(std::back_inserter(text), "{}", event.worker);
    fmt::format_to(std::back_inserter(text), FMT_COMPILE(",{},{}\n"), event.value, to_string(event.reason));
  }

  void write(std::string_view text) { file_ ? file_->write(text) : console_.print(text); }

  bool is_csv_;
  const trace::EventsReader &reader_;
  std::optional<trace::OutputFile> file_;
  Console &console_;
  std::vector<std::string> names_;  // by TaskId
};

/// jobs.csv.
class JobsConverter final : public Converter {
 public:
  explicit JobsConverter(metrics::JobsCsvWriter writer) : writer_(std::move(writer)) {}
  void add(std::span<const JobEvent> events) override { writer_.add(events); }
  Result<void> commit() override { return writer_.commit(); }

 private:
  metrics::JobsCsvWriter writer_;
};

Result<std::unique_ptr<Converter>> converter_for(const EventsOptions &options, const trace::EventsReader &reader,
                                                 Console &console) {
  if (options.format == Format::Jobs) {
    Result<metrics::JobsCsvWriter> writer = metrics::JobsCsvWriter::create(options.output, reader.info().workload);
    if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
    return std::make_unique<JobsConverter>(*std::move(writer));
  }
  std::optional<trace::OutputFile> file;
  if (!options.output.empty()) {
    Result<trace::OutputFile> created = trace::OutputFile::create(options.output);
    if (!created) return tl::unexpected<Diagnostics>(std::move(created.error()));
    file.emplace(*std::move(created));
  }
  return std::make_unique<TextConverter>(options.format, reader, std::move(file), console);
}

// An output that a complete file may replace.
Result<void> check_place(const EventsOptions &options) {
  namespace fs = std::filesystem;
  if (options.output.empty()) {
    if (options.format == Format::Jsonl || options.format == Format::Csv) return {};
    return make_error("--format: jobs and perfetto are not printed", "name a file with -o");
  }
  std::error_code ignored;
  const fs::file_status status = fs::symlink_status(options.output, ignored);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    return trace::file_error(options.output, 0, "cannot write: it is not a file", "without -o, the events are printed");
  }
  return check_output(options.output);
}

Result<void> convert(const EventsOptions &options, Console &console) {
  if (Result<void> place = check_place(options); !place) return place;
  const Result<ChosenRun> chosen = choose_run(options.place);
  if (!chosen) return tl::unexpected<Diagnostics>(chosen.error());
  console.note(chosen->note);
  Result<trace::EventsReader> reader = trace::EventsReader::open(chosen->file);
  if (!reader) return tl::unexpected<Diagnostics>(std::move(reader.error()));
  warn_of_remarks(reader->info(), console);
  const InterruptGuard guard;
  if (options.format == Format::Perfetto) {
    return lab::draw_picture(*reader, options.output, InterruptGuard::interrupted);
  }
  const Result<std::unique_ptr<Converter>> converter = converter_for(options, *reader, console);
  if (!converter) return tl::unexpected<Diagnostics>(converter.error());
  std::vector<JobEvent> events;
  while (!console.is_broken()) {
    if (InterruptGuard::interrupted()) return make_error("interrupted: the events are not complete");
    const Result<bool> more = reader->next(events);
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (!*more) break;
    (*converter)->add(events);
  }
  return (*converter)->commit();
}

}  // namespace

Action add_events(CLI::App &app) {
  auto options = std::make_shared<EventsOptions>();
  app.add_option("RESULT", options->place, "Folder of a recorded run (--out of run, simulate), or its events")
      ->required();
  const Choices<Format> formats{
      {"jsonl", Format::Jsonl}, {"csv", Format::Csv}, {"jobs", Format::Jobs}, {"perfetto", Format::Perfetto}};
  add_choice(app, "--format", options->format, formats, "Format of the output (jobs: jobs.csv, a row for each job)");
  app.add_option("-o,--output", options->output, "File to write; by default the text is printed")->type_name("FILE");
  return [options](Console &console) {
    const Result<void> converted = convert(*options, console);
    if (!converted) console.note(converted.error());
    return converted ? kExitOk : kExitBad;
  };
}

}  // namespace redag::cli
