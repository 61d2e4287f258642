// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_keys.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace redag::cli {
namespace {

constexpr std::array<std::pair<char, LiveOrder>, kLiveOrders> kOrders{{{'d', LiveOrder::Dag},
                                                                       {'n', LiveOrder::Name},
                                                                       {'r', LiveOrder::Rate},
                                                                       {'p', LiveOrder::P99},
                                                                       {'x', LiveOrder::Longest},
                                                                       {'m', LiveOrder::Misses},
                                                                       {'c', LiveOrder::Cpu}}};
constexpr std::size_t kWheel = 3;  // rows for a turn of the wheel
constexpr std::size_t kMostTyped = 60;

/// Moves a position among `count` ones, `page` of which are seen at a time.
void move(Key key, std::size_t count, std::size_t page, std::size_t &at) {
  const std::size_t last = count > 0 ? count - 1 : 0;
  switch (key) {
    case Key::Up: at -= std::min<std::size_t>(at, 1); break;
    case Key::Down: at = std::min(at + 1, last); break;
    case Key::PageUp: at -= std::min(at, page); break;
    case Key::PageDown: at = std::min(at + page, last); break;
    case Key::WheelUp: at -= std::min(at, kWheel); break;
    case Key::WheelDown: at = std::min(at + kWheel, last); break;
    case Key::Home: at = 0; break;
    case Key::End: at = last; break;
    default: break;
  }
}

void sort_by(LiveOrder order, TopState &state) {
  state.view.order = order;
  state.cursor = 0;
}

/// Moves to the next row whose name contains what is sought, beginning at the mark or behind it.
void search(const TopPlaces &places, bool behind, TopState &state) {
  const std::size_t count = places.names.size();
  if (state.sought.empty()) return;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t row = (state.cursor + i + (behind ? 1 : 0)) % count;
    if (!contains(places.names[row], state.sought)) continue;
    state.cursor = row;
    return;
  }
}

TopAction press_typing(const KeyPress &key, const TopPlaces &places, TopState &state) {
  const bool filters = state.mode == TopMode::Filter;
  switch (key.key) {
    case Key::Text:
      if (state.typed.size() < kMostTyped) state.typed += key.text;
      break;
    case Key::Backspace:
      if (!state.typed.empty()) state.typed.pop_back();
      break;
    case Key::Escape:
      if (filters) state.view.filter.clear();
      state.mode = TopMode::Table;
      return TopAction::None;
    case Key::Enter: state.mode = TopMode::Table; break;
    case Key::Closed: return TopAction::Quit;
    default: return TopAction::None;
  }
  if (filters) {
    state.view.filter = state.typed;
    state.cursor = 0;
  } else {
    state.sought = state.typed;
    search(places, false, state);
  }
  return TopAction::None;
}

TopAction press_help(const KeyPress &key, const TopPlaces &places, TopState &state) {
  switch (key.key) {
    case Key::Closed: return TopAction::Quit;
    case Key::Escape:
    case Key::Enter:
    case Key::Help:
    case Key::Text:
      if (key.key == Key::Text && key.text == 'q') return TopAction::Quit;
      state.mode = TopMode::Table;
      state.first = 0;
      break;
    default:
      move(key.key, places.help_lines > places.page ? places.help_lines - places.page + 1 : 1, places.page,
           state.first);
      break;
  }
  return TopAction::None;
}

TopAction choose(std::size_t executor, const TopPlaces &places, TopState &state) {
  if (executor >= places.executors) return TopAction::None;
  state.chosen = executor;
  return TopAction::Attach;
}

TopAction press_list(const KeyPress &key, const TopPlaces &places, TopState &state) {
  switch (key.key) {
    case Key::Closed: return TopAction::Quit;
    case Key::Escape:
      if (!places.has_frame) return TopAction::Quit;
      state.mode = TopMode::Table;
      break;
    case Key::Text:
      if (key.text == 'q') return TopAction::Quit;
      if (key.text >= '1' && key.text <= '9') return choose(static_cast<std::size_t>(key.text - '1'), places, state);
      break;
    case Key::Enter: return choose(state.chosen, places, state);
    case Key::Click:
      if (key.line < places.executors_line) break;
      return choose(places.first_executor + (key.line - places.executors_line), places, state);
      break;
    default: move(key.key, places.executors, places.page, state.chosen); break;
  }
  return TopAction::None;
}

void click(const KeyPress &key, const TopPlaces &places, TopState &state) {
  if (key.line == places.titles_line) {
    for (const TitlePlace &title : places.titles) {
      if (!title.order || key.column < title.begin || key.column >= title.end) continue;
      // A second click on a title reverses the order, and a click on the names sorts by DAG or by name.
      const bool again = state.view.order == *title.order;
      if (again && *title.order == LiveOrder::Name) {
        sort_by(LiveOrder::Dag, state);
      } else if (again) {
        state.view.reversed = !state.view.reversed;
      } else {
        state.view.reversed = false;
        sort_by(*title.order, state);
      }
    }
  } else if (key.line >= places.rows_line && key.line < places.rows_line + places.page) {
    const std::size_t row = state.first + (key.line - places.rows_line);
    if (row < places.names.size()) state.cursor = row;
  }
}

TopAction press_letter(char letter, const TopPlaces &places, TopState &state) {
  for (const auto &[of_order, order] : kOrders) {
    if (of_order == letter) sort_by(order, state);
  }
  const auto place = static_cast<std::size_t>(state.view.order);
  switch (letter) {
    case 'q': return TopAction::Quit;
    case '?':
    case 'h':
      state.mode = TopMode::Help;
      state.first = 0;
      break;
    case '/':
      state.mode = TopMode::Search;
      state.typed.clear();
      break;
    case 'f':
    case '\\':
      state.mode = TopMode::Filter;
      state.typed = state.view.filter;
      break;
    case 'N': search(places, true, state); break;
    case '<': sort_by(static_cast<LiveOrder>((place + kLiveOrders - 1) % kLiveOrders), state); break;
    case '>': sort_by(static_cast<LiveOrder>((place + 1) % kLiveOrders), state); break;
    case 'i': state.view.reversed = !state.view.reversed; break;
    case 'g':
      state.view.dags_only = !state.view.dags_only;
      state.cursor = 0;
      break;
    case 't': state.view.since_start = !state.view.since_start; break;
    case 'l': state.mode = TopMode::Choose; break;
    case ' ': state.paused = !state.paused; break;
    case 'k': move(Key::Up, places.names.size(), places.page, state.cursor); break;
    case 'j': move(Key::Down, places.names.size(), places.page, state.cursor); break;
    default: break;
  }
  return TopAction::None;
}

}  // namespace

TopAction press(const KeyPress &key, const TopPlaces &places, TopState &state) {
  switch (state.mode) {
    case TopMode::Filter:
    case TopMode::Search: return press_typing(key, places, state);
    case TopMode::Help: return press_help(key, places, state);
    case TopMode::Choose: return press_list(key, places, state);
    case TopMode::Table: break;
  }
  switch (key.key) {
    case Key::Closed: return TopAction::Quit;
    case Key::Escape:
      // Takes back the filter first.
      if (state.view.filter.empty()) return TopAction::Quit;
      state.view.filter.clear();
      break;
    case Key::Help:
      state.mode = TopMode::Help;
      state.first = 0;
      break;
    case Key::Text: return press_letter(key.text, places, state);
    case Key::Click: click(key, places, state); break;
    default: move(key.key, places.names.size(), places.page, state.cursor); break;
  }
  return TopAction::None;
}

}  // namespace redag::cli
