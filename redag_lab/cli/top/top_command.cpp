// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <memory>
#include <optional>

#include "redag/base/text.hpp"
#include "redag/live/writer.hpp"
#include "redag/runtime/clock.hpp"
#include "redag_lab/cli/run/live_text.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/top/top_screen.hpp"

namespace redag::cli {
namespace {

struct Options {
  std::string target;
  std::string folder = live::kFolder;
  Duration interval = kSecond;
  bool list = false;
  bool once = false;
  bool json = false;
  bool dags_only = false;
  bool since_start = false;
};

constexpr const char *kHowTo =
    "'redag run' publishes one by default; programs set ExecutorOptions::live, and ROS 2 nodes the parameter 'live'";

std::optional<LiveTarget> parse_target(const std::string &text) {
  LiveTarget target;
  const char *const end = text.data() + text.size();
  const auto pid = std::from_chars(text.data(), end, target.pid);
  if (pid.ec != std::errc() || target.pid <= 0) return std::nullopt;
  if (pid.ptr == end) return target;
  std::uint32_t number = 0;
  const auto rest = std::from_chars(pid.ptr + 1, end, number);
  if (*pid.ptr != '.' || rest.ec != std::errc() || rest.ptr != end) return std::nullopt;
  target.number = number;
  return target;
}

int list(const Options &options, Console &console) {
  const std::vector<live::Listed> pages = live::list_pages(options.folder);
  const Time now = runtime::monotonic_now();
  if (options.json) {
    console.print(to_text(to_json(pages, now)));
  } else if (!pages.empty()) {
    console.print(describe(pages, console.out_traits(), now));
  }
  if (!pages.empty()) return kExitOk;
  console.note("no running executor publishes a live page\n");
  return kExitNo;
}

int show_once(const Options &options, const std::optional<LiveTarget> &target, Console &console) {
  std::vector<live::Listed> pages = live::list_pages(options.folder);
  std::erase_if(pages, [&](const live::Listed &listed) { return target && !target->names(listed); });
  const Time now = runtime::monotonic_now();
  if (pages.empty()) {
    if (target) {
      console.error(fmt::format("process {} publishes no live page", options.target), kHowTo);
    } else {
      console.error("no running executor publishes a live page", kHowTo);
    }
    return kExitNo;
  }
  if (!target) {
    // Unreadable pages are no choice, unless all are unreadable.
    const auto readable = std::count_if(pages.begin(), pages.end(), [](const auto &l) { return l.page.has_value(); });
    if (readable > 0) std::erase_if(pages, [](const live::Listed &listed) { return !listed.page; });
  }
  if (pages.size() > 1) {
    console.note(describe(pages, console.err_traits(), now));
    console.error("several executors are running: name one", fmt::format("redag top {}", pages.front().pid));
    return kExitBad;
  }
  const live::Listed &listed = pages.front();
  if (!listed.page) {
    console.note(listed.page.error());
    return kExitBad;
  }
  if (options.json) {
    console.print(to_text(to_json(listed, *listed.page, now)));
    return kExitOk;
  }
  LiveView view;
  view.dags_only = options.dags_only;
  view.since_start = options.since_start;
  const LiveText text = describe(listed, *listed.page, view, console.out_traits(), now);
  for (const std::string &line : text.head) console.print(line + "\n");
  console.print(text.titles + "\n");
  for (const std::string &line : text.rows) console.print(line + "\n");
  return kExitOk;
}

int top(const Options &options, Console &console) {
  std::optional<LiveTarget> target;
  if (!options.target.empty()) {
    target = parse_target(options.target);
    if (!target) {
      console.error(fmt::format("{} is not a process", in_quotes(options.target)),
                    "give a process ID, or PID.N as 'redag top --list' shows it");
      return kExitBad;
    }
  }
  if (options.list) return list(options, console);
  if (options.once || options.json) return show_once(options, target, console);
  if (!Screen::is_possible()) {
    console.note("the output is not a terminal: one frame is printed, as with --once\n");
    return show_once(options, target, console);
  }
  TopOptions screen;
  screen.folder = options.folder;
  screen.interval = options.interval;
  screen.target = target;
  screen.view.dags_only = options.dags_only;
  screen.view.since_start = options.since_start;
  screen.colour = console.out_traits().colour;
  return run_top(screen);
}

}  // namespace

Action add_top(CLI::App &app) {
  auto options = std::make_shared<Options>();
  CLI::Option *target = app.add_option("PID", options->target,
                                       "Process ID; by default the only running executor, or a list to choose from");
  CLI::Option *list = app.add_flag("--list", options->list, "List the running executors")->excludes(target);
  app.add_flag("--once", options->once, "Print one frame as text and exit")->excludes(list);
  app.add_flag("--json", options->json, "Print one frame (or the list) as a JSON document and exit");
  add_duration(app, "--interval", options->interval, "Time between two updates");
  app.add_flag("--dags", options->dags_only, "Show only DAGs, not their tasks");
  app.add_flag("--since-start", options->since_start, "Show figures since the start instead of over the last seconds");
  app.add_option("--folder", options->folder, "Folder of the live pages")
      ->type_name("DIR")
      ->capture_default_str()
      ->check([](const std::string &folder) {
        std::error_code ignored;
        const bool there = folder == live::kFolder || std::filesystem::is_directory(folder, ignored);
        return there ? std::string() : in_quotes(folder) + " is not a folder";
      });
  return [options](Console &console) { return top(*options, console); };
}

}  // namespace redag::cli
