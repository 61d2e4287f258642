// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "redag/base/nearest.hpp"
#include "redag/base/provenance.hpp"
#include "redag/base/text.hpp"
#include "redag/runtime/threads.hpp"
#include "redag_lab/cli/robot/arrange_report.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/cli/terminal/workload_input.hpp"
#include "redag_lab/robot/arrangement.hpp"

namespace redag::cli {
namespace {

constexpr Duration kUsualInterval = kSecond;

struct ArrangeOptions {
  std::string file;
  bool apply = false;
  bool undo = false;
  bool watch = false;
  bool check = false;
  bool json = false;
  Duration interval = kUsualInterval;
  std::uint32_t rtprio = 0;  // 0: what this process may use
  std::string state;
  std::string levels;  // name of a process

  [[nodiscard]] bool changes_something() const { return apply || watch; }
};

std::optional<robot::Robot> load_robot(const std::string &file, Console &console) {
  Result<robot::Input> input = load_workload_or_robot(file, {.wcet_optional = true});
  if (!input) {
    console.note(input.error());
    return std::nullopt;
  }
  console.note(input->warnings);
  if (!input->robot) {
    console.error(fmt::format("{}: this is a workload, and not a robot", file),
                  "a robot file begins with 'robot: NAME' and lists 'processes:', see docs/robot.md");
    return std::nullopt;
  }
  if (input->robot->by_bounds && !input->robot->assigned) {
    console.note(input->workload.error());
    return std::nullopt;
  }
  return std::move(input->robot);
}

std::optional<std::size_t> process_of_levels(const ArrangeOptions &options, const robot::Robot &robot,
                                             Console &console) {
  std::vector<std::string> names;
  for (std::size_t p = 0; p < robot.processes.size(); ++p) {
    if (robot.processes[p].name == options.levels) return p;
    names.push_back(robot.processes[p].name);
  }
  console.error(fmt::format("--levels: there is no process {}", in_quotes(options.levels)),
                suggestion(options.levels, names));
  return std::nullopt;
}

// Returns the priorities to plan with. A plan alone needs no right to use them.
std::optional<runtime::PriorityBand> band_for(const ArrangeOptions &options, Console &console) {
  const int available = runtime::available_fifo_priority(runtime::kHighestPriority);
  if (options.rtprio > 0) return runtime::band_up_to(static_cast<int>(options.rtprio));
  if (available > 0) return runtime::band_up_to(available);
  if (options.changes_something()) {
    console.error("this process may not use SCHED_FIFO", runtime::realtime_hint());
    return std::nullopt;
  }
  console.warn(fmt::format("this process may not use SCHED_FIFO; the plan is that of one that may, up to {}",
                           runtime::kHighestPriority));
  return runtime::band_up_to(runtime::kHighestPriority);
}

std::optional<std::string> state_file(const ArrangeOptions &options, const robot::Robot &robot, Console &console) {
  if (!options.state.empty()) return options.state;
  const char *const own = std::getenv("XDG_RUNTIME_DIR");
  const std::string folder = geteuid() == 0 ? "/run" : own != nullptr ? own : "";
  if (folder.empty()) {
    console.error("there is no folder for the state that --undo needs",
                  "set XDG_RUNTIME_DIR, or name a file by --state");
    return std::nullopt;
  }
  std::string name = robot.name;
  const auto is_odd = [](char c) {
    return !((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_');
  };
  std::replace_if(name.begin(), name.end(), is_odd, '_');
  return fmt::format("{}/redag-arrange-{}.json", folder, name);
}

int print_levels(const ArrangeOptions &options, const robot::Robot &robot, const robot::Plan &plan, Console &console) {
  const std::optional<std::size_t> process = process_of_levels(options, robot, console);
  if (!process) return kExitBad;
  if (plan.of_executor[*process].empty()) {
    console.error(fmt::format("--levels: process '{}' has no executor of ReDAG-RT", options.levels),
                  "only a process with a 'workload' that no threads execute has levels of its own");
    return kExitBad;
  }
  console.print(robot::levels_text(plan.of_executor[*process]) + "\n");
  return kExitOk;
}

robot::Changes changes_now(const robot::Robot &robot, const robot::Plan &plan, const robot::System &system) {
  robot::Changes changes = changes_of(robot, plan, system.read());
  const std::vector<std::string> more = remarks_on_executors(robot, plan, changes, system);
  changes.remarks.insert(changes.remarks.end(), more.begin(), more.end());
  return changes;
}

void show(const ArrangeOptions &options, const robot::Robot &robot, const robot::Plan &plan,
          const robot::Changes &changes, Console &console) {
  if (options.json) {
    console.print(to_text(to_json(robot, plan, changes)));
    return;
  }
  console.say(describe(robot, plan, console.out_traits()));
  console.say(describe(changes, console.out_traits()));
  for (const std::string &remark : changes.remarks) console.note("note: " + remark + "\n");
}

int undo(robot::Arrangement &arrangement, Console &console) {
  const Result<robot::Arrangement::Undone> undone = arrangement.undo();
  if (!undone) {
    console.note(undone.error());
    return kExitBad;
  }
  for (const std::string &remark : undone->remarks) console.note("note: " + remark + "\n");
  console.note(fmt::format("changes undone: {}\n", undone->restored));
  return kExitOk;
}

bool is_interrupted() { return InterruptGuard::interrupted(); }

int apply_once(const robot::Changes &changes, robot::Arrangement &arrangement, Console &console) {
  const Result<bool> applied = arrangement.apply(changes, is_interrupted);
  if (!applied) {
    console.note(applied.error());
    console.error("nothing is changed");
    return kExitBad;
  }
  if (!*applied) {
    console.error("interrupted: nothing is changed");
    return kExitNo;
  }
  if (changes.is_empty()) {
    console.note("there is nothing to change\n");
  } else {
    console.note(fmt::format("changes applied: {}; 'redag arrange --undo' takes them back\n",
                             changes.threads.size() + changes.interrupts.size()));
  }
  return kExitOk;
}

// A terminal that closes ends the watch as Ctrl-C does.
void end_by_hangup(int /*signal*/) { static_cast<void>(::raise(SIGTERM)); }

// `shown`: the remarks that the user has seen.
int watch(const ArrangeOptions &options, const robot::Robot &robot, const robot::Plan &plan,
          const robot::System &system, std::set<std::string> shown, robot::Arrangement &arrangement, Console &console) {
  std::signal(SIGHUP, end_by_hangup);
  int status = kExitOk;
  while (!is_interrupted()) {
    const robot::Changes changes = changes_now(robot, plan, system);
    const Result<bool> applied = arrangement.apply(changes, is_interrupted);
    if (!applied) {
      console.note(applied.error());
      status = kExitBad;
      break;
    }
    for (const robot::ThreadChange &change : changes.threads) {
      console.note(fmt::format("{}: thread '{}' ({} of {}) is {} now\n", change.entry, printable(change.name),
                               change.thread.tid, printable(change.program), to_string(change.after.scheduling)));
    }
    for (const std::string &remark : changes.remarks) {
      if (shown.insert(remark).second) console.note("note: " + remark + "\n");
    }
    const auto until = std::chrono::steady_clock::now() + std::chrono::nanoseconds(options.interval);
    while (!is_interrupted() && std::chrono::steady_clock::now() < until) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  return std::max(undo(arrangement, console), status);
}

int arrange(const ArrangeOptions &options, Console &console) {
  const std::optional<robot::Robot> loaded = load_robot(options.file, console);
  if (!loaded) return kExitBad;
  const robot::Robot &robot = *loaded;
  const robot::System system;
  std::optional<robot::Arrangement> arrangement;
  if (options.changes_something() || options.undo) {
    const std::optional<std::string> path = state_file(options, robot, console);
    if (!path) return kExitBad;
    Result<robot::Arrangement> opened = robot::Arrangement::open(system, *path);
    if (!opened) {
      console.note(opened.error());
      return kExitBad;
    }
    arrangement.emplace(*std::move(opened));
  }
  if (options.undo) return undo(*arrangement, console);
  const std::optional<runtime::PriorityBand> band = band_for(options, console);
  if (!band) return kExitBad;
  const Result<robot::Plan> plan = robot::plan_of(robot, *band);
  if (!plan) {
    console.note(plan.error());
    return kExitBad;
  }
  if (!options.levels.empty()) return print_levels(options, robot, *plan, console);
  const InterruptGuard guard;
  const robot::Changes changes = changes_now(robot, *plan, system);
  show(options, robot, *plan, changes, console);
  if (options.watch) {
    if (!console.flush()) return kExitBad;
    return watch(options, robot, *plan, system, {changes.remarks.begin(), changes.remarks.end()}, *arrangement,
                 console);
  }
  if (options.apply) return apply_once(changes, *arrangement, console);
  return options.check && !changes.is_empty() ? kExitNo : kExitOk;
}

}  // namespace

Action add_arrange(CLI::App &app) {
  auto options = std::make_shared<ArrangeOptions>();
  app.add_option("FILE", options->file, "Robot file (YAML); - reads standard input")->type_name("ROBOT")->required();
  CLI::Option *const dry =
      app.add_flag("--dry-run")->description("Show the plan, and what of it is not so yet (default)");
  CLI::Option *const apply = app.add_flag("--apply", options->apply, "Change the threads and interrupts that run now");
  CLI::Option *const watch =
      app.add_flag("--watch", options->watch,
                   "The same, again for each process that comes; takes everything back at the end (Ctrl-C)");
  CLI::Option *const undo = app.add_flag("--undo", options->undo, "Take back what --apply has changed");
  CLI::Option *const levels =
      app.add_option("--levels", options->levels, "Print REDAG_LEVELS for the executor of one process")
          ->type_name("PROCESS");
  const std::vector<CLI::Option *> modes = {dry, apply, watch, undo, levels};
  for (CLI::Option *const mode : modes) {
    for (CLI::Option *const other : modes) {
      if (mode != other) mode->excludes(other);
    }
  }
  CLI::Option *const check =
      app.add_flag("--check", options->check, "Exit with status 1 if something is not as planned");
  for (CLI::Option *const mode : {apply, watch, undo, levels}) check->excludes(mode);
  add_duration(app, "--interval", options->interval, "Time between two looks at what runs")->needs(watch);
  add_count(app, "--rtprio", options->rtprio, {0, 99},
            "Highest SCHED_FIFO priority of the plan; 0: what this process may use");
  app.add_option("--state", options->state, "File that remembers how everything was, for --undo")->type_name("FILE");
  app.add_flag("--json", options->json, "Write the plan and the differences as one JSON document");
  return [options](Console &console) { return arrange(*options, console); };
}

}  // namespace redag::cli
