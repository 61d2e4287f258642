// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>
#include <optional>

#include "redag/base/text.hpp"
#include "redag/live/writer.hpp"
#include "redag/threads/clock.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/cli/terminal/screen.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/cli/top/attachment.hpp"
#include "redag_lab/cli/top/live_json.hpp"
#include "redag_lab/cli/top/live_table.hpp"
#include "redag_lab/cli/top/top_screen.hpp"

namespace redag::cli {
namespace {

struct TopArguments {
  std::string target;
  std::string folder = live::kFolder;
  Duration interval = kSecond;
  bool list = false;
  bool once = false;
  bool json = false;
  LiveView view;
};

constexpr const char *kHowTo =
    "'redag run' publishes one by default; programs set ExecutorOptions::live, and ROS 2 nodes the parameter 'live'";

int list(const TopArguments &options, Console &console) {
  const std::vector<live::Listed> pages = live::list_pages(options.folder);
  const Time now = runtime::monotonic_now();
  if (options.json) {
    console.print(to_text(to_json(pages, now)));
  } else if (!pages.empty()) {
    const StreamTraits &out = console.out_traits();
    console.print(executor_table(pages, now).render(out.width, out.colour));
  }
  if (!pages.empty()) return kExitOk;
  console.note("no running executor publishes a live page\n");
  return kExitNo;
}

int show_once(const TopArguments &options, const std::optional<LiveTarget> &target, Console &console) {
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
    const StreamTraits &err = console.err_traits();
    console.note(executor_table(pages, now).render(err.width, err.colour));
    console.error("several executors are running: name one", fmt::format("redag top {}", pages.front().pid));
    return kExitBad;
  }
  const live::Listed &listed = pages.front();
  if (!ok(listed.page, console)) return kExitBad;
  const StreamTraits &out = console.out_traits();
  console.print(options.json ? to_text(to_json(listed, *listed.page, now))
                             : draw_once(listed, options.view, now, out.width, out.colour));
  return kExitOk;
}

int show_all(const TopArguments &options, Console &console) {
  const std::vector<live::Listed> pages = live::list_pages(options.folder);
  const StreamTraits &out = console.out_traits();
  if (options.json) {
    console.print(to_text(machine_json(pages, options.view)));
  } else if (!pages.empty()) {
    console.print(task_table(pages, options.view).render(out.width, out.colour));
  }
  for (const live::Listed &listed : pages) {
    if (!listed.page) console.note(listed.page.error());
  }
  if (!pages.empty()) return kExitOk;
  console.error("no running executor publishes a live page", kHowTo);
  return kExitNo;
}

/// The screen, until the user quits. One thread.
class Top {
 public:
  Top(const TopArguments &options, std::optional<LiveTarget> target) : options_(options), attachment_(target) {
    state_.view = options.view;
  }

  int run(bool colour) {
    const InterruptGuard guard;
    Screen screen(colour);
    look();
    if (pages_.size() > 1 && options_.target.empty()) state_.view.all = true;
    while (!InterruptGuard::interrupted()) {
      const Screen::Size size = screen.size();
      const TopInput input{.pages = pages_, .shown = shown_ ? &*shown_ : nullptr, .is_gone = is_gone_, .now = now_};
      screen.draw(draw_top(state_, input, size.columns, size.lines, colour));
      const Duration left = next_look_ - runtime::monotonic_now();
      const TopAction action = press(screen.wait(std::max<Duration>(left, 0)), state_);
      if (action == TopAction::Quit) break;
      if (action != TopAction::None) {
        attachment_.step(pages_);
        show();
      }
      if (runtime::monotonic_now() >= next_look_) look();
    }
    return kExitOk;
  }

 private:
  void look() {
    next_look_ = runtime::monotonic_now() + options_.interval;
    if (state_.paused) return;
    now_ = runtime::monotonic_now();
    pages_ = live::list_pages(options_.folder);
    show();
  }

  void show() {
    const live::Listed *const found = attachment_.find(pages_);
    is_gone_ = found == nullptr;
    if (found != nullptr) shown_ = *found;
  }

  const TopArguments &options_;
  TopState state_;
  Attachment attachment_;
  std::vector<live::Listed> pages_;
  std::optional<live::Listed> shown_;  // the latest page read of the watched executor
  bool is_gone_ = false;
  Time now_ = 0;
  Time next_look_ = 0;
};

int top(const TopArguments &options, Console &console) {
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
  const bool is_possible = Screen::is_possible();
  if (!is_possible || options.once || options.json) {
    if (!is_possible && !options.once && !options.json) {
      console.note("the output is not a terminal that can be drawn on: one frame is printed, as with --once\n");
    }
    return options.view.all ? show_all(options, console) : show_once(options, target, console);
  }
  return Top(options, target).run(console.out_traits().colour);
}

constexpr std::array kSortOrders{LiveOrder::Dag, LiveOrder::Rate, LiveOrder::Longest, LiveOrder::Misses,
                                 LiveOrder::Cpu};

}  // namespace

Action add_top(CLI::App &app) {
  auto options = std::make_shared<TopArguments>();
  LiveView &view = options->view;
  CLI::Option *target = app.add_option("PID", options->target,
                                       "Process ID; by default the only running executor, or all of them in one table");
  CLI::Option *list = app.add_flag("--list", options->list, "List the running executors")->excludes(target);
  app.add_flag("--all", view.all, "Show the tasks of all executors in one table, most urgent first")
      ->excludes(target)
      ->excludes(list);
  app.add_flag("--once", options->once, "Print one frame as text and exit")->excludes(list);
  app.add_flag("--json", options->json, "Print one frame (or the list) as a JSON document and exit");
  add_duration(app, "--interval", options->interval, "Time between two updates");
  add_choice(app, "--sort", view.order, choices_of(kSortOrders), "Order of the rows");
  add_pages_folder(app, options->folder);
  return [options](Console &console) { return top(*options, console); };
}

}  // namespace redag::cli
