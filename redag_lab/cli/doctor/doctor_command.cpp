// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/loader/provenance.hpp"
#include "redag_lab/cli/doctor/doctor_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/files.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/doctor/diagnosis.hpp"
#include "redag_lab/doctor/machine.hpp"
#include "redag_lab/doctor/measure.hpp"
#include "redag_lab/run/session.hpp"

namespace redag::cli {
namespace {

struct DoctorArguments {
  std::string attach;
  std::optional<Duration> measure;
  std::string out = "overheads.yaml";
  bool json = false;
};

Result<doctor::Measurement> measure(Duration duration, Console &console) {
  Progress progress(console);
  progress.set_label("measure");
  doctor::MeasureOptions options;
  options.duration = duration;
  options.stop = &InterruptGuard::flag();
  options.progress = [&](double done, const char *next) {
    const Duration left = std::max<Duration>(0, duration - progress.elapsed());
    progress.draw(done, fmt::format("{:.0f} s left: {}", static_cast<double>(left) * 1e-9, next));
  };
  return doctor::measure(options).map([](doctor::Measurement &&measured) {
    const Provenance now = current_provenance();
    measured.calibration.date = now.created;
    measured.calibration.host = now.host;
    measured.calibration.kernel = now.kernel;
    measured.calibration.version = now.version;
    return std::move(measured);
  });
}

int examine(const DoctorArguments &arguments, Console &console) {
  constexpr Duration kLongest = kSecond * 3600 * 24;
  if (arguments.measure > kLongest) {
    console.error(fmt::format("--measure: {} is longer than a day", format_duration(*arguments.measure)));
    return kExitBad;
  }
  std::optional<std::int64_t> pid;
  if (!arguments.attach.empty()) {
    pid = doctor::number_in(arguments.attach);
    if (!pid || *pid <= 0) {
      console.error(fmt::format("--attach: {} is not the number of a process", in_quotes(arguments.attach)));
      return kExitBad;
    }
  }
  Result<doctor::Diagnosis> diagnosis = doctor::diagnose(doctor::Machine(), pid);
  if (!ok(diagnosis, console)) return kExitBad;
  std::optional<doctor::Measurement> measured;
  if (arguments.measure) {
    if (const auto busy = lab::busy_machine_warning()) console.warn(*busy);
    const InterruptGuard guard;  // covers writing the file too
    Result<doctor::Measurement> result = measure(*arguments.measure, console);
    if (!ok(result, console)) return kExitBad;
    measured = *std::move(result);
    if (!measured->calibration.realtime) {
      console.warn(
          "this process may not use SCHED_FIFO: only ordinary threads were measured, as preemption 'cooperative' and "
          "'none' use them");
    }
    if (!ok(write_text(arguments.out, to_yaml(measured->calibration)), console)) return kExitBad;
    diagnosis->lines.push_back(doctor::judge(measured->wake_ups));
  }
  if (arguments.json) {
    console.print(to_text(to_json(*diagnosis, measured ? &*measured : nullptr)));
  } else {
    const StreamTraits &out = console.out_traits();
    console.print(describe(*diagnosis, out.width, out.colour));
    if (measured) {
      console.print("\n" + describe(*measured, out.width, out.colour));
      console.say(fmt::format("wrote {}: charge these overheads with --overheads {}\n", arguments.out, arguments.out));
    }
  }
  return diagnosis->count(doctor::Verdict::Red) > 0 ? kExitNo : kExitOk;
}

}  // namespace

Action add_doctor(CLI::App &app) {
  auto arguments = std::make_shared<DoctorArguments>();
  app.add_option("--attach", arguments->attach, "Also examine this running process, or the container that it is in")
      ->type_name("PID");
  CLI::Option *measure =
      add_duration(app, "--measure", arguments->measure, "Also measure wake-ups and overheads, for that long")
          ->type_name("[DURATION]")
          ->expected(0, 1)
          ->default_str("10s");  // without a value
  app.add_option("--out", arguments->out, "File for the measured overheads")
      ->type_name("FILE")
      ->capture_default_str()
      ->needs(measure);
  app.add_flag("--json", arguments->json, "Print one JSON document");
  return [arguments](Console &console) { return examine(*arguments, console); };
}

}  // namespace redag::cli
