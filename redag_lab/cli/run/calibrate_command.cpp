// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>
#include <string>

#include "redag/base/text.hpp"
#include "redag/loader/provenance.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
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
  std::string out = "overheads.yaml";
};

std::string describe(const Calibration &calibration) {
  std::string text;
  const auto charged = [&](const char *threads, const std::optional<Overheads> &overheads) {
    if (overheads) text += fmt::format("overheads charged on {} threads: {}\n", threads, to_string(*overheads));
  };
  charged("SCHED_FIFO", calibration.realtime);
  charged("ordinary", calibration.normal);
  return text + "note: a measured maximum is no proof; a longer calibration can find a larger one\n";
}

Result<Calibration> measure(const CalibrateOptions &options, Console &console) {
  Progress progress(console);
  progress.set_label("calibrate");
  lab::CalibrateOptions run;
  run.duration = options.duration;
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
  if (!ok(measured, console)) return kExitBad;
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
  console.say(describe(calibration));
  if (!ok(write_text(options.out, to_yaml(calibration)), console)) return kExitBad;
  console.say(fmt::format("wrote {}: charge these overheads with --overheads {}\n", options.out, options.out));
  return kExitOk;
}

}  // namespace

Action add_calibrate(CLI::App &app) {
  auto options = std::make_shared<CalibrateOptions>();
  add_duration(app, "--duration", options->duration, "Total time to measure")->default_str("30s");
  app.add_option("--out", options->out, "File for the measured overheads")->type_name("FILE")->capture_default_str();
  return [options](Console &console) { return calibrate(*options, console); };
}

}  // namespace redag::cli
