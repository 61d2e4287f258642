// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "redag/base/text.hpp"
#include "redag/trace/flight_recorder.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/run/run_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"

namespace redag::cli {
namespace {

struct RecoverOptions {
  std::string place;
  std::string folder;
  bool force = false;
  bool keep = false;
  bool json = false;
};

// Returns the flight record at `place`: the record itself, or the one in this result folder.
std::string record_in(const std::string &place) {
  const std::string below = flight_folder(place);
  std::error_code ignored;
  return std::filesystem::is_directory(below, ignored) ? below : place;
}

Diagnostics warnings_of(const trace::Recovered &recovered) {
  Diagnostics warnings;
  const auto warn = [&](std::string text) {
    warnings.push_back(Diagnostic{Severity::Warning, {}, 0, 0, std::move(text), {}});
  };
  if (recovered.overwritten > 0) {
    warn(fmt::format("the record was full: its first {} events were replaced by newer ones", recovered.overwritten));
  }
  if (recovered.damaged > 0) {
    warn(fmt::format(
        "the record is damaged: {} of its blocks were not written completely, and the events after them are left out",
        recovered.damaged));
  }
  return warnings;
}

int recover(const RecoverOptions &options, Console &console) {
  const std::string record = record_in(options.place);
  Result<trace::Recovered> recovered = trace::recover(record);
  if (!recovered) {
    console.note(recovered.error());
    return kExitBad;
  }
  if (options.folder.empty() && record == options.place) {
    console.error(fmt::format("'{}' is a record of events, not a folder of results", record),
                  "name a folder for the results with --out");
    return kExitBad;
  }
  const std::string &folder = options.folder.empty() ? options.place : options.folder;
  if (const Result<void> made = prepare_folder(folder, options.force); !made) {
    console.note(made.error());
    return kExitBad;
  }
  console.note(warnings_of(*recovered));
  lab::Session session = lab::session_of(std::move(recovered->trace));
  if (options.json) {
    console.print(to_text(to_json(session)));
  } else {
    console.say(describe(session, console.out_traits()));
  }
  const WrittenFiles written = write_session(session, {.folder = folder});
  Diagnostics problems = written.problems;
  if (problems.empty() && !options.keep) {
    if (const Result<void> removed = trace::remove_flight_record(record); !removed) problems = removed.error();
  }
  console.note(problems);
  if (!problems.empty()) return kExitBad;
  const std::string message = fmt::format("recovered {} events into {}/: {}\n{}", format_count(session.events), folder,
                                          written.names, written.no_picture);
  options.json ? console.note(message) : console.say(message);
  return kExitOk;
}

}  // namespace

Action add_recover(CLI::App &app) {
  auto options = std::make_shared<RecoverOptions>();
  app.add_option("DIR", options->place, "The --out folder of a killed run, or its record (then with --out)")
      ->type_name("DIR")
      ->required();
  app.add_option("--out", options->folder, "Folder for the results, instead of DIR; created if missing")
      ->type_name("DIR");
  app.add_flag("--force", options->force, "Write into a folder that holds other files");
  app.add_flag("--keep", options->keep, "Keep the record after its results are written");
  app.add_flag("--json", options->json, "Write one JSON document, and nothing else, to standard output");
  return [options](Console &console) { return recover(*options, console); };
}

}  // namespace redag::cli
