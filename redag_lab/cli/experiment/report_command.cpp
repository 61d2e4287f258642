// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <system_error>

#include "redag/base/text.hpp"
#include "redag/loader/text_file.hpp"
#include "redag/trace/recording.hpp"
#include "redag_lab/cli/run/recorded_runs.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/report/document.hpp"
#include "redag_lab/report/page.hpp"
#include "redag_lab/report/verdict.hpp"

namespace redag::cli {
namespace {

namespace fs = std::filesystem;

struct ReportArguments {
  std::vector<std::string> places;
  std::string output;
  bool json = false;
};

// "results/report.html: 8 KB, opens in any browser without a network".
std::string page_text(const std::string &path, const std::string &html) {
  constexpr std::size_t kMega = 1'000'000;
  const auto size = static_cast<double>(html.size());
  return fmt::format("{}: {}, opens in any browser without a network\n", path,
                     html.size() < kMega ? fmt::format("{:.0f} KB", size / 1e3) : fmt::format("{:.1f} MB", size / 1e6));
}

class Reporting {
 public:
  Reporting(const ReportArguments &options, Console &console)
      : options_(options), console_(console), progress_(console) {}

  int run() {
    Result<RecordedPlaces> found = find_recorded_runs(options_.places);
    if (!ok(found, console_)) return kExitBad;
    notes_ = std::move(found->notes);
    const bool writes = !options_.json || !options_.output.empty();
    if (writes && !ok(check_output(output()), console_)) return kExitBad;
    const InterruptGuard guard;
    if (!read(*found)) return kExitBad;
    progress_.clear();
    if (groups_.empty()) {
      console_.error("interrupted before a run was read: there is nothing to report");
      return kExitBad;
    }
    return write();
  }

 private:
  // Reads the runs. Returns false after printing an error. When interrupted, stops early and keeps the runs read.
  bool read(const RecordedPlaces &found) {
    const report::DigestOptions sizes = report::digest_options(found.runs.size());
    const std::size_t count = found.traces();
    std::size_t done = 0;
    for (const RecordedRuns &runs : found.runs) {
      report::GroupReader group(runs.label, sizes);
      bool any = false;
      for (const std::string &file : runs.traces) {
        if (InterruptGuard::interrupted()) break;
        progress_.draw(static_cast<double>(done) / static_cast<double>(count), file);
        const Result<trace::Recording> trace = trace::Recording::open(file);
        if (!trace) return fail(trace.error());
        if (!group.fits(trace->info())) {
          progress_.clear();
          console_.error(
              fmt::format("{} is not a repetition of the runs beside it: its executor, preemption mode or tasks differ",
                          file),
              "name folders that hold one kind of run each");
          return false;
        }
        const Result<void> added = group.add(fs::path(file).parent_path().string(), *trace);
        if (!added) return fail(added.error());
        any = true;
        ++done;
      }
      if (!any) continue;
      groups_.push_back(group.finish());
    }
    // A single group is labelled by its executor instead of its path.
    if (groups_.size() == 1) groups_.front().label = groups_.front().info().executor;
    if (done < count) {
      notes_.push_back(fmt::format("interrupted: only {} of {} runs were read", done, count));
      console_.warn(notes_.back());
    }
    return true;
  }

  bool fail(const Diagnostics &errors) {
    progress_.clear();
    console_.note(errors);
    return false;
  }

  int write() {
    report::DocumentOptions options;
    options.notes = notes_;
    options.provenance = current_provenance();
    const std::string document = report::to_json(groups_, options);
    if (options_.json) {
      console_.print(document + "\n");
      if (options_.output.empty()) return kExitOk;
    }
    const std::string path = output();
    const std::string html = report::page(document);
    const Result<void> written = write_text(path, html);
    if (!ok(written, console_)) return kExitBad;
    std::string text;
    for (const report::Group &group : groups_) {
      text += (groups_.size() > 1 ? group.label + ": " : "") + report::verdict_of(group).front().text + "\n";
    }
    text += page_text(path, html);
    if (options_.json) {
      console_.note(text);
    } else {
      console_.say(text);
    }
    return kExitOk;
  }

  [[nodiscard]] std::string output() const {
    if (!options_.output.empty()) return options_.output;
    std::error_code ignored;
    const fs::path first(options_.places.front());
    return ((fs::is_directory(first, ignored) ? first : first.parent_path()) / "report.html").string();
  }

  const ReportArguments &options_;
  Console &console_;
  Progress progress_;
  std::vector<report::Group> groups_;
  std::vector<std::string> notes_;
};

// Writes the page of an experiment.
int report_experiment(const ReportArguments &options, const std::string &file, Console &console) {
  const Result<std::string> text = read_file(file);
  if (!ok(text, console)) return kExitBad;
  const Json document = Json::parse(*text, nullptr, false);
  if (!document.is_object() || document.value("format", "") != "redag.experiment/1") {
    console.error(fmt::format("{}: is not a redag.experiment/1 document", file),
                  "'redag experiment PLAN --out DIR' writes one");
    return kExitBad;
  }
  if (options.json) {
    console.print(*text);
    if (options.output.empty()) return kExitOk;
  }
  const std::string name = document.value("name", "");
  const std::string html = report::page(*text, report::PageKind::Experiment);
  const std::string path =
      options.output.empty() ? (fs::path(file).parent_path() / "report.html").string() : options.output;
  if (!ok(write_text(path, html), console)) return kExitBad;
  const std::string words =
      fmt::format("{}: {} of {} {}\n{}", name, document.value("done", std::uint64_t{0}),
                  document.value("units", std::uint64_t{0}), document.value("units_are", ""), page_text(path, html));
  options.json ? console.note(words) : console.say(words);
  return kExitOk;
}

int make_report(const ReportArguments &options, Console &console) {
  for (const std::string &place : options.places) {
    std::error_code ignored;
    const std::string file = (fs::path(place) / "results.json").string();
    if (!fs::exists(file, ignored)) continue;
    if (options.places.size() == 1) return report_experiment(options, file, console);
    console.error(fmt::format("{}: an experiment has a page of its own", place), "name this folder alone");
    return kExitBad;
  }
  return Reporting(options, console).run();
}

}  // namespace

Action add_report(CLI::App &app) {
  auto options = std::make_shared<ReportArguments>();
  app.add_option("DIR", options->places,
                 "Folders of recorded runs (--out of run, simulate, compare), at any depth; or one folder of 'redag "
                 "experiment'")
      ->type_name("RESULT")
      ->required();
  app.add_option("-o,--output", options->output, "File for the page (default: report.html in the first DIR)")
      ->type_name("FILE");
  app.add_flag("--json", options->json, "Write the data of the report to standard output; write a page only with -o");
  return [options](Console &console) { return make_report(*options, console); };
}

}  // namespace redag::cli
