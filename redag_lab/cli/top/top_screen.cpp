// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_screen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/live/rates.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/cli/top/live_table.hpp"

namespace redag::cli {
namespace {

using live::Frame;
using Lines = std::vector<std::string>;

// Each line fits into 80 columns.
constexpr std::array kHelp{
    "KEYS",
    "  arrows, page keys, Home, End    scroll",
    "  < >      next order of the rows",
    "  a        the tasks of all executors, most urgent first",
    "  Tab      next executor",
    "  space    pause the picture (not the executor)",
    "  q        quit",
    "COLUMNS, over the last seconds",
    "  p50, p99, max   response time from the nominal release; of a DAG end to end",
    "  worst           longest response time since the start",
    "  missed          jobs late, skipped or aborted since the start, +lately",
    "  bound           proven bound on the response time",
    "  active          jobs that have started and not ended, and max_active",
    "  away            of these, jobs that wait without a worker",
    "  ready           jobs that could start",
    "  cpu             share of one processor, of jobs that ended",
    "COLOURS",
    "  red             missed lately, or beyond the deadline or the bound",
    "  yellow          within a tenth of it, missed earlier, or at max_active",
};

// Keys that matter most come first, because a narrow screen shows the beginning.
constexpr const char *kKeys = "? help  q quit  < > sort  a all  Tab next";
constexpr const char *kNone = "no running executor publishes a live page; waiting for one";

/// Returns "gpu 80.4 % busy, 2 jobs queued", of all devices.
std::string devices_in_words(const Frame &frame) {
  std::string text;
  for (const live::DeviceFrame &device : frame.devices) {
    text += fmt::format("{}{} {} busy, {} queued", text.empty() ? "" : "; ", device.name,
                        format_percent(share_of(device, frame)), plural(device.queued, "job"));
  }
  return text;
}

/// Returns the lines above the table of an executor.
Lines head_of(const live::Listed &listed, Time now, bool colour) {
  const Frame &frame = listed.page->frame;
  const live::page::Figures total = total_of(frame);
  const double busy = frame.workers > 0 ? cpu_of(total, frame) / frame.workers : 0;
  const Duration lived = frame.published - frame.began;
  const double cost = lived > 0 ? static_cast<double>(frame.publisher_cpu) / static_cast<double>(lived) : 0;
  const Tint misses = total.recent_misses > 0 ? Tint::Bad : total.misses > 0 ? Tint::Caution : Tint::Good;
  Lines lines;
  lines.push_back(tinted(fmt::format("{}  {} {}  {}, {}, preemption {}, {}", frame.name, frame.program, id_of(listed),
                                     frame.driver, plural(frame.workers, "worker"), frame.preemption, frame.policy),
                         Tint::Strong, colour));
  lines.push_back(fmt::format("up {}  finished {} ({:.4g}/s)  workers busy {}  page costs {}", humanize_duration(lived),
                              format_count(total.finished), rate_of(total, frame), format_percent(busy),
                              format_percent(cost)));
  lines.push_back(tinted(misses_in_words(total, frame.window), misses, colour));
  if (total.away > 0 || !frame.devices.empty()) lines.back() += fmt::format("  {} away", plural(total.away, "job"));
  if (const std::string hint = hint_on_misses(frame); !hint.empty()) lines.back() += "  " + hint;
  if (!frame.devices.empty()) lines.push_back(devices_in_words(frame));
  if (!frame.alert.empty()) lines.push_back(tinted(frame.alert, Tint::Bad, colour));
  if (const auto late = overdue(frame, now)) {
    lines.push_back(
        tinted(fmt::format("no update for {}: the process is stopped, or gets no processor", humanize_duration(*late)),
               Tint::Bad, colour));
  }
  if (frame.left_out > 0) {
    lines.push_back(tinted(fmt::format("{} more tasks do not fit the live page", format_count(frame.left_out)),
                           Tint::Caution, colour));
  }
  return lines;
}

/// The parts of a screen. Of the body, what fits below the head is seen.
struct Parts {
  Lines head;
  Lines body;
  std::string foot;
};

class Drawing {
 public:
  Drawing(const TopState &state, const TopInput &input, std::size_t columns, bool colour)
      : state_(state), input_(input), columns_(columns), colour_(colour) {}

  [[nodiscard]] Parts draw() const {
    if (state_.mode == TopMode::Help) return {{}, {kHelp.begin(), kHelp.end()}, "any letter: back  q quit"};
    const bool is_empty = state_.view.all ? input_.pages.empty() : input_.shown == nullptr;
    if (is_empty) return {{kNone}, {}, "q quit"};
    return table();
  }

 private:
  [[nodiscard]] Parts table() const {
    Parts parts;
    if (!state_.view.all) {
      const Frame &frame = input_.shown->page->frame;
      parts.head = head_of(*input_.shown, input_.is_gone ? frame.published : input_.now, colour_);
      if (input_.is_gone) {
        parts.head.push_back(
            tinted(fmt::format("the executor has ended; waiting for the next '{}'", frame.name), Tint::Bad, colour_));
      }
    }
    parts.head.push_back(status());
    const auto pages = state_.view.all ? std::span(input_.pages) : std::span(input_.shown, 1);
    parts.body = task_table(pages, state_.view).lines(columns_, colour_);
    // Titles of the table stay while its rows are scrolled.
    parts.head.push_back(std::move(parts.body.front()));
    parts.body.erase(parts.body.begin());
    if (parts.body.empty()) parts.body.emplace_back("no tasks yet");
    parts.foot = kKeys;
    return parts;
  }

  [[nodiscard]] std::string status() const {
    const LiveView &view = state_.view;
    const char *const order = view.all && view.order == LiveOrder::Dag ? "urgency" : to_string(view.order);
    std::string line = fmt::format("sorted by {}", order);
    if (!view.all) line += ", last " + humanize_duration(input_.shown->page->frame.window);
    line = tinted(line, Tint::Faint, colour_);
    if (state_.paused) line += tinted("  paused", Tint::Caution, colour_);
    return line;
  }

  const TopState &state_;
  const TopInput &input_;
  std::size_t columns_;
  bool colour_;
};

}  // namespace

std::vector<std::string> draw_top(TopState &state, const TopInput &input, std::size_t columns, std::size_t lines,
                                  bool colour) {
  Parts parts = Drawing(state, input, columns, colour).draw();
  const std::size_t above = lines > 0 ? lines - 1 : 0;
  Lines screen = std::move(parts.head);
  screen.resize(std::min(screen.size(), above));
  const std::size_t room = above - screen.size();
  const std::size_t count = parts.body.size();
  state.page = std::max<std::size_t>(room, 1);
  state.first = std::min(state.first, count > room ? count - room : 0);
  const std::size_t last = std::min(count, state.first + room);
  for (std::size_t i = state.first; i < last; ++i) screen.push_back(std::move(parts.body[i]));
  screen.resize(above);
  const std::string part = count > room ? fmt::format("{}-{} of {}  ", state.first + 1, last, count) : "";
  if (lines > 0) screen.push_back(tinted(part + parts.foot, Tint::Faint, colour));
  for (std::string &line : screen) line = cut(line, columns);
  return screen;
}

std::string draw_once(const live::Listed &listed, const LiveView &view, Time now, std::size_t width, bool colour) {
  std::string text;
  for (const std::string &line : head_of(listed, now, colour)) text += (width > 0 ? cut(line, width) : line) + "\n";
  return text + task_table(std::span(&listed, 1), view).render(width, colour);
}

}  // namespace redag::cli
