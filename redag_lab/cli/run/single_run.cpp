// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/single_run.hpp"

#include <fmt/format.h>

#include "redag_analysis/metrics/verdict.hpp"
#include "redag_lab/cli/run/run_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/signals.hpp"

namespace redag::cli {
namespace {

constexpr Duration kSingleRunDuration = 10 * kSecond;

Result<lab::Session> run_interruptibly(const Workload &workload, const lab::Variant &variant,
                                       lab::SessionOptions options, Console &console) {
  options.stop = &InterruptGuard::flag();
  Progress progress(console);
  progress.set_label(variant.name);
  options.on_overdue = [&](const std::string &text) {
    progress.clear();
    console.warn(text);
  };
  return lab::run_session(workload, variant, options, progress_hook(progress, workload, options.duration));
}

}  // namespace

int run_once(const RunArguments &arguments, const std::string &executor, trace::Driver driver, Console &console) {
  const Result<lab::Variant> variant = lab::parse_variant(executor);
  if (!ok(variant, console)) return kExitBad;
  const bool simulated = driver == trace::Driver::Simulator;
  if (simulated && variant->realtime_threads) {
    console.error(fmt::format("the simulator has no threads to make real-time: use '{}'", variant->executor));
    return kExitBad;
  }
  const std::optional<Workload> workload = load_configured(arguments, console, {.waits = variant->is_redag()});
  if (!workload) return kExitBad;
  if (!takes_arguments({*variant}, arguments, console)) return kExitBad;
  if (!ok(lab::configure(*workload, *variant), console)) return kExitBad;
  const Duration usual = simulated ? lab::sensible_duration(*workload) : kSingleRunDuration;
  std::optional<lab::SessionOptions> options = session_options(arguments, driver, usual, console);
  if (!options) return kExitBad;
  options->files.folder = arguments.folder;
  options->keep_trace = false;

  if (const auto busy = simulated ? std::nullopt : lab::busy_machine_warning()) console.warn(*busy);
  const InterruptGuard guard;  // covers writing the results too
  Result<lab::Session> session = run_interruptibly(*workload, *variant, *options, console);
  if (!ok(session, console)) return kExitBad;
  for (const std::string &warning : session->warnings) console.warn(warning);
  if (arguments.json) {
    console.print(to_text(to_json(*session)));
  } else {
    console.say(describe(*session, console.out_traits(), ReportOptions{arguments.all_tasks}));
  }
  bool written = true;
  if (!arguments.folder.empty()) {
    WrittenFiles files = write_session(*session, options->files);
    console.note(files.problems);
    written = files.problems.empty();
    std::string message = fmt::format("wrote {}/: {}\n", arguments.folder, files.names) + files.no_picture;
    if (files.has_picture) message += "(open trace.pftrace in https://ui.perfetto.dev)\n";
    if (written && arguments.json) console.note(message);
    if (written && !arguments.json) console.say(message);
  }
  if (!written) return kExitBad;
  const bool no =
      !session->check.ok() || (arguments.check && metrics::has_misses(session->summary.total, session->summary.dags));
  return no ? kExitNo : kExitOk;
}

}  // namespace redag::cli
