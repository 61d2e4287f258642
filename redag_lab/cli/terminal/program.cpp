// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/program.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <exception>
#include <filesystem>
#include <new>
#include <system_error>

#include "redag/base/text.hpp"
#include "redag/loader/provenance.hpp"
#include "redag/version.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/help.hpp"
#include "redag_lab/cli/terminal/options.hpp"

namespace redag::cli {
namespace {

struct Entry {
  const char *name;
  const char *summary;
  Action (*add)(CLI::App &);
  const char *examples;
};

constexpr std::array kCommands = {
    Entry{"validate", "Check workload files and report every mistake with its line", add_validate,
          "  redag validate workloads/robot.yaml\n"
          "  redag validate --strict workloads/*.yaml\n"
          "  redag validate examples/robot/cart.yaml\n"},
    Entry{"generate", "Generate a random workload from a seed", add_generate,
          "  redag generate --dags 4 --utilization 1.6 --seed 7 -o random.yaml\n"
          "  redag generate --periods robot --shape chain | redag validate -\n"},
    Entry{"import", "Make a workload of a recording of a ROS 2 robot by ros2_tracing", add_import,
          "  redag import workloads/traces/jazzy_mte -o robot.yaml\n"
          "  redag import workloads/traces/jazzy_mte robot --check || echo 'differs'\n"},
    Entry{"simulate", "Simulate a workload in virtual time; results depend on the seed alone", add_simulate,
          "  redag simulate workloads/robot.yaml\n"
          "  redag simulate workloads/robot.yaml --executor mte --duration 60s --json\n"
          "  redag simulate workloads/robot.yaml --preemption none --out results/none\n"},
    Entry{"run", "Run a workload on threads with synthetic callbacks", add_run,
          "  redag run workloads/robot.yaml --duration 10s\n"
          "  sudo redag run workloads/robot.yaml --preemption os --out results/os\n"
          "  redag run workloads/robot.yaml --executor ste --check || echo 'missed'\n"},
    Entry{"doctor", "Say whether this machine keeps real-time promises; measure what it adds", add_doctor,
          "  redag doctor\n"
          "  redag doctor --attach 1234\n"
          "  sudo redag doctor --measure 5min --out overheads.yaml\n"},
    Entry{"compare", "Compare several executors on the same jobs, or two recorded results", add_compare,
          "  redag compare workloads/robot.yaml\n"
          "  redag compare workloads/robot.yaml --executors redag,mte --out results/cmp\n"
          "  redag compare results/before results/after\n"
          "  redag compare results/main results/branch --check || echo 'worse'\n"},
    Entry{"analyze", "Bound every response time and show which deadlines are guaranteed", add_analyze,
          "  redag analyze workloads/robot.yaml\n"
          "  redag analyze workloads/robot.yaml --explain control.controller\n"
          "  redag analyze workloads/robot.yaml --chain lidar.scan,lidar.planner\n"
          "  redag analyze workloads/robot.yaml --executor ste\n"
          "  redag analyze workloads/robot.yaml --sensitivity\n"
          "  redag analyze --methods\n"},
    Entry{"tune", "Find better priorities, max_active and workers", add_tune,
          "  redag tune workloads/robot.yaml\n"
          "  redag tune workloads/robot.yaml --judge bounds -o tuned.yaml\n"
          "  redag tune workloads/robot.yaml --vary max_active --caps 2-5 --all-trials\n"},
    Entry{"experiment", "Run experiments over many workloads: seeded, parallel, resumable", add_experiment,
          "  redag experiment evaluation/experiments/acceptance_tasks.yaml --out tasks\n"
          "  redag experiment evaluation/experiments/paper/factorial.yaml --out factorial\n"},
    Entry{"events", "Print the events of a recorded run for other tools, or check them", add_events,
          "  redag events results/demo | head\n"
          "  redag events results/demo --check\n"
          "  redag events results/demo --format perfetto -o results/demo/trace.pftrace\n"},
    Entry{"why", "Explain why deadlines of a recorded run were missed", add_why,
          "  redag why results/demo\n"
          "  redag why results/demo control.controller\n"
          "  redag why results/demo control.controller#12 --json\n"},
    Entry{"report", "Write one HTML page about recorded runs", add_report,
          "  redag report results/demo\n"
          "  redag report results/none results/os -o report.html\n"},
    Entry{"top", "Watch a running executor: rates, response times, misses, queues", add_top,
          "  redag top\n"
          "  redag top --list\n"
          "  redag top 1234 --interval 500ms --sort misses\n"
          "  redag top 1234 --once --json\n"},
    Entry{"serve", "Show the running executors in a browser, or to Prometheus", add_serve,
          "  redag serve\n"
          "  redag serve --port 0 --interval 500ms\n"},
};

std::vector<std::string> command_names() {
  std::vector<std::string> names;
  names.reserve(kCommands.size());
  for (const Entry &entry : kCommands) names.emplace_back(entry.name);
  return names;
}

// Returns the message for an unknown argument, with the nearest known option.
std::string unknown_argument(const CLI::App &command) {
  const std::vector<std::string> rest = command.remaining();
  if (rest.empty()) return "too many arguments are given";
  const std::string given = rest.front().substr(0, rest.front().find('='));
  if (given.empty() || given.front() != '-') return fmt::format("unexpected argument {}", in_quotes(rest.front()));
  std::vector<std::string> names;
  for (const CLI::Option *option : command.get_options()) {
    for (const std::string &name : option->get_lnames()) names.push_back("--" + name);
  }
  const std::string hint = suggestion(given, names);
  const bool is_near = hint.compare(0, 3, "did") == 0;  // otherwise it lists all options
  return fmt::format("unknown option {}{}", in_quotes(given), is_near ? " (" + hint + ")" : "");
}

// Returns the message for an option that was given twice, or with a value that it does not take.
std::string mismatch(const CLI::ArgumentMismatch &error) {
  std::string said = error.what();
  if (const std::size_t at = said.find(": At Most 1 required"); at != std::string::npos) {
    return said.substr(0, at) + " is given more than once";
  }
  if (const std::size_t at = said.find(" was given a disallowed flag override"); at != std::string::npos) {
    return "--" + said.substr(0, at) + " takes no value";
  }
  return said;
}

// Returns the name of an option with an empty value, which usually comes from an unset variable in a script. No option
// accepts one.
std::string find_empty(const CLI::App &command) {
  for (const CLI::Option *option : command.get_options()) {
    const auto &values = option->results();
    if (std::find(values.begin(), values.end(), "") != values.end()) return option->get_name();
  }
  return {};
}

// Returns what is missing, and which option has taken a file that exists for its value: "--explain robot.yaml".
std::string missing(const CLI::RequiredError &error, const CLI::App &command) {
  for (const CLI::Option *option : command.get_options([](const CLI::Option *one) { return !one->get_positional(); })) {
    for (const std::string &value : option->results()) {
      std::error_code ignored;
      if (!std::filesystem::is_regular_file(value, ignored)) continue;
      return fmt::format("{}, and {} has taken {} as its value", error.what(), option->get_name(), in_quotes(value));
    }
  }
  return error.what();
}

// Returns the command on the command line, or the program itself.
const CLI::App &chosen(const CLI::App &app) {
  const auto parsed = app.get_subcommands();
  return parsed.empty() ? app : *parsed.front();
}

int usage_error(Console &console, const std::string &message, const CLI::App &command) {
  const bool is_program = command.get_parent() == nullptr;
  console.error(message);
  console.note(fmt::format("run 'redag {}--help' for the usage\n", is_program ? "" : command.get_name() + " "));
  return kExitBad;
}

// Returns the arguments with "help COMMAND" as "COMMAND --help", and "version" as "--version".
std::vector<std::string> as_options(std::vector<std::string> arguments) {
  if (arguments.empty()) return arguments;
  if (arguments.front() == "version") arguments.front() = "--version";
  if (arguments.front() != "help") return arguments;
  arguments.erase(arguments.begin());
  arguments.emplace_back("--help");
  return arguments;
}

int parse_and_run(const std::vector<std::string> &given, Console &console) {
  const std::vector<std::string> arguments = as_options(given);
  CLI::App app(
      "ReDAG-RT schedules many DAGs of callbacks by priority in one process. This program validates, simulates, runs, "
      "compares and analyses workloads.",
      "redag");
  app.set_version_flag("-V,--version", fmt::format("redag {} (revision {})", kVersion, build_revision()));
  app.require_subcommand(0, 1);
  app.option_defaults()->disable_flag_override();
  app.formatter(std::make_shared<HelpFormatter>(console.out_traits().width));
  app.footer(
      "Run 'redag help COMMAND' for the options of a command, with examples.\n\n"
      "Exit status: 0 success; 1 negative result, such as a missed deadline with --check; 2 bad input or usage.");
  std::vector<std::pair<CLI::App *, Action>> actions;
  for (const Entry &entry : kCommands) {
    CLI::App *command = app.add_subcommand(entry.name, entry.summary);
    command->footer(std::string("Examples:\n") + entry.examples);
    actions.emplace_back(command, entry.add(*command));
  }

  if (!ok(source_date_epoch(), console)) return kExitBad;
  if (arguments.empty()) {
    console.note(app.help());
    return kExitBad;
  }
  const std::vector<std::string> names = command_names();
  const std::string &first = arguments.front();
  if (first.empty() || (first.front() != '-' && std::find(names.begin(), names.end(), first) == names.end())) {
    return usage_error(console, fmt::format("unknown command {} ({})", in_quotes(first), suggestion(first, names)),
                       app);
  }

  for (const std::string &argument : arguments) {  // CLI11 takes it for an option without a value
    if (argument.size() > 3 && argument.compare(0, 2, "--") == 0 && argument.find('=') == argument.size() - 1) {
      return usage_error(console, argument.substr(0, argument.size() - 1) + ": the value is empty",
                         first.front() == '-' ? app : *app.get_subcommand(first));
    }
  }
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));  // CLI11 expects the last argument first
  } catch (const CLI::CallForHelp &) {
    console.print(&chosen(app) == &app ? app.help() : chosen(app).help("redag"));
    return kExitOk;
  } catch (const CLI::CallForVersion &version) {
    console.print(std::string(version.what()) + "\n");
    return kExitOk;
  } catch (const CLI::ExtrasError &) {
    return usage_error(console, unknown_argument(chosen(app)), chosen(app));
  } catch (const CLI::ArgumentMismatch &error) {
    return usage_error(console, mismatch(error), chosen(app));
  } catch (const CLI::RequiredError &error) {
    return usage_error(console, missing(error, chosen(app)), chosen(app));
  } catch (const CLI::ParseError &error) {
    return usage_error(console, error.what(), chosen(app));
  }
  if (const std::string option = find_empty(chosen(app)); !option.empty()) {
    return usage_error(console, option + ": the value is empty", chosen(app));
  }
  for (const auto &[command, action] : actions) {
    if (command == &chosen(app)) return action(console);
  }
  return usage_error(console, "no command is given", app);
}

}  // namespace

int run_program(const std::vector<std::string> &arguments, Console &console) {
  int status = kExitBad;
  try {
    status = parse_and_run(arguments, console);
  } catch (const std::bad_alloc &) {
    console.error("out of memory");
  } catch (const std::exception &error) {  // from a library, for example about a folder that vanished
    console.error(error.what());
  }
  if (!console.flush()) return kExitBad;
  return status;
}

}  // namespace redag::cli
