// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>
#include <string>

#include "redag/base/text.hpp"
#include "redag/loader/provenance.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/run/calibrate.hpp"
#include "redag_lab/run/session.hpp"

namespace redag::cli {
namespace {

constexpr Duration kLongest = kSecond * 3600 * 24;

struct CalibrateOptions {
  Duration duration = 30 * kSecond;
  bool loaded = false;
  bool json = false;
  std::string out = "overheads.yaml";
};

Json overheads_json(const std::optional<Overheads> &overheads) {
  if (!overheads) return nullptr;
  Overheads copy = *overheads;
  Json parts = Json::object();
  for (const std::string_view name : overhead_names()) {
    parts[std::string(name) + "_ns"] = *overhead_named(copy, name);
  }
  return parts;
}

Json calibration_json(const Calibration &calibration) {
  Json rows = Json::array();
  for (const Measured &row : calibration.measured) {
    rows.push_back(Json{{"what", row.what},
                        {"threads", row.threads},
                        {"load", row.load},
                        {"samples", row.samples},
                        {"p50_ns", row.p50},
                        {"p99_ns", row.p99},
                        {"p999_ns", row.p999},
                        {"max_ns", row.max}});
  }
  return Json{{"format", "redag.calibration/1"},
              {"complete", calibration.complete},
              {"duration_ns", calibration.duration},
              {"load", calibration.load},
              {"rights", calibration.rights},
              {"processors", calibration.processors},
              {"overheads",
               {{"realtime", overheads_json(calibration.realtime)}, {"normal", overheads_json(calibration.normal)}}},
              {"measured", std::move(rows)}};
}

std::string describe(const Calibration &calibration, const StreamTraits &terminal) {
  Table table({{"measured", false, 9},
               {"threads", false, 8},
               {"load", false, 7},
               {"samples", true, 6},
               {"p50", true, 3},
               {"p99", true, 4},
               {"p99.9", true, 2},
               {"max", true, 9}});
  for (const Measured &row : calibration.measured) {
    table.add({{row.what},
               {row.threads},
               {row.load},
               {format_count(row.samples)},
               {humanize_duration(row.p50)},
               {humanize_duration(row.p99)},
               {humanize_duration(row.p999)},
               {humanize_duration(row.max)}});
  }
  std::string text = table.render(terminal.width, terminal.colour) + "\n";
  const auto charged = [&](const char *threads, const std::optional<Overheads> &overheads) {
    if (overheads) text += fmt::format("overheads charged on {} threads: {}\n", threads, to_string(*overheads));
  };
  charged("SCHED_FIFO", calibration.realtime);
  charged("ordinary", calibration.normal);
  if (!calibration.complete) text += "incomplete: the calibration ended early\n";
  return text + "note: a measured maximum is no proof; a longer calibration can find a larger one\n";
}

Result<Calibration> measure(const CalibrateOptions &options, Console &console) {
  Progress progress(console);
  progress.set_label("calibrate");
  lab::CalibrateOptions run;
  run.duration = options.duration;
  run.loaded = options.loaded;
  run.stop = &InterruptGuard::flag();
  run.progress = [&](double done, const char *next) {
    const Duration left = std::max<Duration>(0, options.duration - progress.elapsed());
    progress.draw(done, fmt::format("{:.0f} s left: {}", static_cast<double>(left) * 1e-9, next));
  };
  return lab::calibrate(run);
}

int calibrate(const CalibrateOptions &options, Console &console) {
  if (options.duration > kLongest) {
    console.error(fmt::format("--duration: {} is longer than a day", format_duration(options.duration)));
    return kExitBad;
  }
  if (const auto busy = lab::busy_machine_warning()) console.warn(*busy);
  const InterruptGuard guard;  // covers writing the file too
  Result<Calibration> measured = measure(options, console);
  if (!measured) {
    console.note(measured.error());
    return kExitBad;
  }
  Calibration &calibration = *measured;
  const Provenance now = current_provenance();
  calibration.date = now.created;
  calibration.host = now.host;
  calibration.kernel = now.kernel;
  calibration.version = now.version;
  if (!calibration.realtime) {
    console.warn(
        "this process may not use SCHED_FIFO: only ordinary threads were measured, as preemption 'cooperative' and "
        "'none' use them");
  }
  if (options.json) {
    console.print(to_text(calibration_json(calibration)));
  } else {
    console.say(describe(calibration, console.out_traits()));
  }
  if (!calibration.complete) {
    console.error(
        fmt::format("interrupted: {} is not written, as longer measurements can find larger values", options.out),
        "let it finish, or choose a shorter --duration");
    return kExitBad;
  }
  if (const Result<void> written = write_text(options.out, to_yaml(calibration)); !written) {
    console.note(written.error());
    return kExitBad;
  }
  const std::string message =
      fmt::format("wrote {}: charge these overheads with --overheads {}\n", options.out, options.out);
  if (options.json) {
    console.note(message);
  } else {
    console.say(message);
  }
  return kExitOk;
}

}  // namespace

Action add_calibrate(CLI::App &app) {
  auto options = std::make_shared<CalibrateOptions>();
  add_duration(app, "--duration", options->duration, "Total time to measure")->default_str("30s");
  app.add_flag("--loaded", options->loaded, "Keep the machine busy with other threads for half of the time");
  app.add_option("--out", options->out, "File for the measured overheads")->type_name("FILE")->capture_default_str();
  app.add_flag("--json", options->json, "Write one JSON document, and nothing else, to standard output");
  return [options](Console &console) { return calibrate(*options, console); };
}

}  // namespace redag::cli
