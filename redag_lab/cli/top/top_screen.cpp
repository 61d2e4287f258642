// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_screen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/base/words.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/top/device_lines.hpp"
#include "redag_lab/cli/top/live_figures.hpp"
#include "redag_lab/cli/top/live_table.hpp"

namespace redag::cli {
namespace {

using live::Frame;

constexpr std::size_t kLeastBar = 36;  // columns of a thread, with the name of its task
constexpr std::size_t kMarginOfList = 4;

Line fitted(Line line, std::size_t width, const Glyphs &glyphs) {
  constexpr std::string_view kDots = "\u2026";
  line = cut(std::move(line), width);
  for (Span &span : line) {
    const std::size_t at = glyphs.ascii ? span.text.find(kDots) : std::string::npos;
    if (at != std::string::npos) span.text.replace(at, kDots.size(), "~");
  }
  return line;
}

// Each line fits into 80 columns.
constexpr std::array kHelp{
    "KEYS",
    "  arrows, j, k, page keys, Home, End    move the mark",
    "  /  search a name        N  next match",
    "  f  show only names that contain a text (Esc: all again)",
    "  d n r p x m c    sort by DAG, name, rate, p99, max, misses, processor time",
    "  < >  next order         i  reverse it",
    "  g  only DAGs            t  since the start, or over the last seconds",
    "  space  pause the picture (not the executor)",
    "  l  list of executors    ?  this help              q  quit",
    "  mouse: the wheel scrolls; a click on a title sorts, a second one reverses",
    "",
    "COLUMNS",
    "  p50, p99, max    response time: from the nominal release to the end",
    "                   of a DAG: end to end, of the sink with the worst one",
    "  missed           jobs late, skipped or aborted since the start, +lately",
    "  bound            proven bound on the response time",
    "  active           jobs that have started and not ended, and max_active",
    "  away             of these, jobs that wait without a worker: for a device,",
    "                   an event, a time, or in a call that blocks",
    "  ready, wait      jobs that could start; that wait for predecessors",
    "  cpu              share of one processor, of jobs that ended",
    "  responses        how often each response time occurred, on one axis of",
    "                   time for all rows; red: beyond the deadline",
    "  p99 lately       the p99 at the last looks; full height: the deadline",
    "",
    "DEVICES",
    "  busy             time of its services, as a share of its slots",
    "  slots            used, and there are; queue: jobs that wait for one",
    "  served/s         services that ended, per second",
    "  serves           the tasks of the jobs that it serves now",
    "",
    "COLOURS",
    "  red     missed lately, or beyond the deadline or the bound",
    "  yellow  within a tenth of it, missed earlier, or at max_active",
};

// Keys that matter most come first, because a narrow screen shows the beginning.
constexpr const char *kKeys = "? help  q quit  / search  f filter  < > sort  g DAGs  space pause  l list";
constexpr const char *kListKeys = "up, down, Enter or 1 to 9: choose  q quit";

Line words(std::string text, Tint tint = Tint::Plain) { return {{std::move(text), tint}}; }

std::vector<Line> head_of(const live::Listed &listed, const Frame &frame, Time now) {
  const live::page::Figures total = total_of(frame);
  std::vector<Line> lines;
  lines.push_back(
      words(fmt::format("{}  {} {}  {}, {} worker{}, preemption {}, {}", frame.name, frame.program, listed.pid,
                        frame.driver, frame.workers, frame.workers == 1 ? "" : "s", frame.preemption, frame.policy),
            Tint::Strong));
  const double busy = frame.workers > 0 ? cpu_of(total, frame, false) / frame.workers : 0;
  const Duration lived = frame.published - frame.began;
  const double cost = lived > 0 ? static_cast<double>(frame.publisher_cpu) / static_cast<double>(lived) : 0;
  lines.push_back(words(fmt::format("up {}  finished {} ({:.4g}/s)  workers busy {}  page costs {}",
                                    humanize_duration(lived), format_count(total.finished),
                                    rate_of(total, frame, false), format_percent(busy), format_percent(cost))));
  lines.push_back(words(misses_in_words(total, frame.window), total.recent_misses > 0 ? Tint::Bad
                                                              : total.misses > 0      ? Tint::Caution
                                                                                      : Tint::Good));
  if (total.away > 0 || !frame.devices.empty()) {
    lines.back().push_back({fmt::format("  {} away", plural(total.away, "job"))});
  }
  if (const std::string kinds = kinds_of_misses(total); !kinds.empty()) lines.back().push_back({"  " + kinds});
  if (const std::string hint = hint_on_misses(frame); !hint.empty()) lines.back().push_back({"  " + hint});
  if (!frame.alert.empty()) lines.push_back(words(frame.alert, Tint::Bad));
  if (const auto late = overdue(frame, now)) {
    lines.push_back(
        words(fmt::format("no update for {}: the process is stopped, or gets no processor", humanize_duration(*late)),
              Tint::Bad));
  }
  if (frame.left_out > 0) {
    lines.push_back(
        words(fmt::format("{} more tasks do not fit the live page", format_count(frame.left_out)), Tint::Caution));
  }
  return lines;
}

/// Returns the threads with their bars, in at most `most` lines. Of more threads, the busiest.
std::vector<Line> bars_of(const Frame &frame, bool since_start, std::size_t width, std::size_t most,
                          const Glyphs &glyphs) {
  if (frame.threads.empty() || most == 0 || width < kLeastBar) return {};
  const std::size_t in_a_line = width / kLeastBar;
  std::vector<live::ThreadFrame> threads = frame.threads;
  const std::size_t room = in_a_line * most;
  std::string rest;
  if (frame.threads_in_all > std::min(threads.size(), room)) {
    const auto busier = [](const auto &a, const auto &b) { return a.recent_used > b.recent_used; };
    std::stable_sort(threads.begin(), threads.end(), busier);
    threads.resize(std::min(threads.size(), room - 1));
    std::sort(threads.begin(), threads.end(), [](const auto &a, const auto &b) { return a.index < b.index; });
    rest = fmt::format("{} more threads", frame.threads_in_all - threads.size());
  }
  std::vector<Line> lines;
  const std::size_t room_of_one = width / in_a_line;
  const std::size_t digits = fmt::format("{}", threads.empty() ? 0 : threads.back().index).size();
  const auto add = [&](Line line, std::size_t position) {
    if (position % in_a_line == 0) lines.emplace_back();
    const std::size_t used = width_of(line);
    if (used < room_of_one) line.push_back({std::string(room_of_one - used, ' ')});
    lines.back().insert(lines.back().end(), line.begin(), line.end());
  };
  for (std::size_t i = 0; i < threads.size(); ++i) {
    const live::ThreadFrame &thread = threads[i];
    const std::string number = fmt::format("{:>{}} ", thread.index, digits);
    const std::size_t bar = std::clamp<std::size_t>(room_of_one / 2, 18, 40);
    Line line = words(number, Tint::Faint);
    const Line share = share_bar(share_of(thread, frame, since_start), bar, glyphs);
    line.insert(line.end(), share.begin(), share.end());
    const std::size_t left = room_of_one - width_of(line) - 2;
    const std::string task = thread.task ? full_name(frame.tasks[*thread.task], frame) : "";
    line.push_back({" " + cut_middle(task, left), Tint::Faint});
    add(std::move(line), i);
  }
  if (!rest.empty()) add(words(rest, Tint::Faint), threads.size());
  return lines;
}

/// Which of `count` rows is at the top of `page` ones, so that the marked one is seen.
std::size_t first_in_sight(std::size_t first, std::size_t cursor, std::size_t count, std::size_t page) {
  first = std::min(first, count > page ? count - page : 0);
  if (cursor < first) return cursor;
  return cursor >= first + page ? cursor - page + 1 : first;
}

class Drawing {
 public:
  Drawing(const TopState &state, const TopInput &input, std::size_t columns, std::size_t lines, const Glyphs &glyphs)
      : state_(state), input_(input), columns_(columns), lines_(lines), glyphs_(glyphs) {}

  TopDrawing draw() {
    drawing_.first = state_.first;
    drawing_.places.has_frame = input_.shown != nullptr;
    if (state_.mode == TopMode::Help) {
      help();
    } else if (state_.mode == TopMode::Choose) {
      list();
    } else if (input_.shown == nullptr) {
      add(words("no running executor publishes a live page; waiting for one"));
      finish(words(kKeys, Tint::Faint));
    } else {
      frame();
    }
    for (Line &line : drawing_.lines) line = fitted(std::move(line), columns_, glyphs_);
    return std::move(drawing_);
  }

 private:
  void add(Line line) { drawing_.lines.push_back(std::move(line)); }

  /// Fills the screen with blank lines, and puts `last` on its last line.
  void finish(Line last) {
    drawing_.lines.resize(lines_ > 0 ? lines_ - 1 : 0);
    if (lines_ > 0) add(std::move(last));
  }

  void help() {
    const std::size_t page = lines_ > 2 ? lines_ - 2 : 1;
    drawing_.places.page = page;
    drawing_.places.help_lines = kHelp.size();
    drawing_.first = std::min(state_.first, kHelp.size() > page ? kHelp.size() - page : 0);
    const std::size_t last = std::min(kHelp.size(), drawing_.first + page);
    for (std::size_t i = drawing_.first; i < last; ++i) {
      const std::string_view line = kHelp[i];
      add(words(std::string(line), !line.empty() && line[0] != ' ' ? Tint::Strong : Tint::Plain));
    }
    const std::string more = last < kHelp.size() ? fmt::format("{} more below: down  ", kHelp.size() - last) : "";
    finish(words(more + "any other key: back", Tint::Faint));
  }

  void list() {
    if (input_.pages.empty()) {
      add(words("no running executor publishes a live page; waiting for one"));
      return finish(words(kKeys, Tint::Faint));
    }
    add(words("Which executor?", Tint::Strong));
    const std::size_t width = columns_ > kMarginOfList ? columns_ - kMarginOfList : 1;
    const std::string text = list_text(input_.pages, StreamTraits{true, false, width}, input_.now);
    std::vector<std::string> rows;
    for (std::size_t at = 0; at < text.size(); at = std::min(text.find('\n', at), text.size()) + 1) {
      rows.push_back(text.substr(at, text.find('\n', at) - at));
    }
    const std::size_t count = input_.pages.size();
    const std::size_t page = lines_ > 3 ? lines_ - 3 : 1;
    const std::size_t chosen = std::min(state_.chosen, count - 1);
    const std::size_t first = first_in_sight(0, chosen, count, page);
    add(words(std::string(kMarginOfList, ' ') + rows.front(), Tint::Strong));
    drawing_.places.executors = count;
    drawing_.places.executors_line = 2;
    drawing_.places.first_executor = first;
    drawing_.places.page = page;
    for (std::size_t i = first; i < std::min(count, first + page); ++i) {
      const std::string number = i < 9 ? fmt::format("{}", i + 1) : " ";
      Line line = words(fmt::format("{} {} {}", i == chosen ? ">" : " ", number, rows[i + 1]));
      add(i == chosen ? reversed(std::move(line), columns_) : std::move(line));
    }
    finish(words(kListKeys, Tint::Faint));
  }

  void frame() {
    const live::Listed &listed = *input_.shown;
    const Frame &frame = listed.page->frame;
    for (Line &line : head_of(listed, frame, input_.is_gone ? frame.published : input_.now)) add(std::move(line));
    if (input_.is_gone) {
      add(words(fmt::format("the executor has ended; waiting for the next '{}'", frame.name), Tint::Bad));
    }
    for (Line &line : bars_of(frame, state_.view.since_start, columns_, lines_ / 6, glyphs_)) add(std::move(line));
    for (Line &line : device_lines(frame, state_.view.since_start, columns_, lines_ / 6, glyphs_)) add(std::move(line));
    add(status(frame));
    LiveTable table = make_table(frame, state_.view, input_.course, columns_, glyphs_);
    drawing_.places.titles_line = drawing_.lines.size();
    drawing_.places.titles = table.places;
    add(std::move(table.titles));
    rows(table, frame);
    finish(last_line());
  }

  Line status(const Frame &frame) const {
    const LiveView &view = state_.view;
    Line line = words(fmt::format("sorted by {}{}, {}", to_string(view.order), view.reversed ? ", reversed" : "",
                                  view.since_start ? "since the start" : "last " + humanize_duration(frame.window)),
                      Tint::Faint);
    if (!view.filter.empty()) line.push_back({fmt::format("  filter: {}", view.filter), Tint::Caution});
    if (state_.paused) line.push_back({"  paused", Tint::Caution});
    return line;
  }

  void rows(const LiveTable &table, const Frame &frame) {
    TopPlaces &places = drawing_.places;
    for (const LiveRow &row : table.rows) places.names.push_back(full_name(row, frame));
    const std::size_t count = table.rows.size();
    const std::size_t used = drawing_.lines.size() + 1;  // and the last line
    const std::size_t room = lines_ > used ? lines_ - used : 1;
    // A line says how many rows are out of sight.
    const std::size_t page = count > room && room > 1 ? room - 1 : room;
    const std::size_t cursor = std::min(state_.cursor, count > 0 ? count - 1 : 0);
    const std::size_t first = first_in_sight(state_.first, cursor, count, page);
    drawing_.first = first;
    places.rows_line = drawing_.lines.size();
    places.page = page;
    const std::size_t last = std::min(count, first + page);
    for (std::size_t i = first; i < last; ++i) {
      add(i == cursor ? reversed(table.lines[i], columns_) : table.lines[i]);
    }
    if (count == 0) {
      add(words(state_.view.filter.empty() ? "no tasks yet" : "no name contains the filter's text", Tint::Faint));
    }
    if (page < count && room > 1) {
      std::string more = first > 0 ? fmt::format("{} more above", first) : "";
      if (last < count) more += fmt::format("{}{} more below", first > 0 ? ", " : "", count - last);
      add(words(more, Tint::Caution));
    }
  }

  Line last_line() const {
    if (state_.mode == TopMode::Filter) return {{"filter: " + state_.typed + "_", Tint::Strong}};
    if (state_.mode == TopMode::Search) return {{"search: " + state_.typed + "_", Tint::Strong}};
    return words(kKeys, Tint::Faint);
  }

  const TopState &state_;
  const TopInput &input_;
  std::size_t columns_;
  std::size_t lines_;
  const Glyphs &glyphs_;
  TopDrawing drawing_;
};

}  // namespace

TopDrawing draw_top(const TopState &state, const TopInput &input, std::size_t columns, std::size_t lines,
                    const Glyphs &glyphs) {
  return Drawing(state, input, columns, lines, glyphs).draw();
}

std::vector<Line> draw_once(const live::Listed &listed, const LiveView &view, Time now, std::size_t width,
                            const Glyphs &glyphs) {
  constexpr std::size_t kPipe = 120;  // columns of the bars where there is no limit
  constexpr std::size_t kMostBars = 8;
  const Frame &frame = listed.page->frame;
  std::vector<Line> lines = head_of(listed, frame, now);
  for (Line &line : bars_of(frame, view.since_start, width > 0 ? width : kPipe, kMostBars, glyphs)) {
    lines.push_back(std::move(line));
  }
  const std::size_t all_devices = frame.devices_in_all + 2;
  for (Line &line : device_lines(frame, view.since_start, width > 0 ? width : kPipe, all_devices, glyphs)) {
    lines.push_back(std::move(line));
  }
  LiveTable table = make_table(frame, view, nullptr, width, glyphs);
  lines.push_back(std::move(table.titles));
  for (Line &line : table.lines) lines.push_back(std::move(line));
  if (!table.hidden.empty()) {
    lines.push_back(words(fmt::format("(no room for: {})", fmt::join(table.hidden, ", ")), Tint::Faint));
  }
  if (width > 0) {
    for (Line &line : lines) line = fitted(std::move(line), width, glyphs);
  }
  return lines;
}

std::string list_text(const std::vector<live::Listed> &pages, const StreamTraits &terminal, Time now) {
  Table table({{"pid", true, 9},
               {"executor", false, 8},
               {"program", false, 6},
               {"driver", false, 4},
               {"tasks", true, 3},
               {"jobs", true, 2},
               {"misses", true, 5},
               {"up", true, 1},
               {"state", false, 7}});
  for (const live::Listed &listed : pages) {
    const std::string pid =
        listed.number == 0 ? fmt::format("{}", listed.pid) : fmt::format("{}.{}", listed.pid, listed.number);
    if (!listed.page) {
      table.add({{pid}, {"?"}, {}, {}, {}, {}, {}, {}, {listed.page.error().front().message, Tint::Bad}});
      continue;
    }
    const Frame &frame = listed.page->frame;
    const live::page::Figures total = total_of(frame);
    const auto late = overdue(frame, now);
    table.add({{pid},
               {frame.name},
               {frame.program},
               {frame.driver},
               {format_count(frame.tasks.size())},
               {format_count(total.finished)},
               {format_count(total.misses), total.misses > 0 ? Tint::Bad : Tint::Faint},
               {humanize_duration(frame.published - frame.began)},
               late ? Cell{"no update for " + humanize_duration(*late), Tint::Bad} : Cell{"running", Tint::Good}});
  }
  return table.render(terminal.width, terminal.colour);
}

}  // namespace redag::cli
