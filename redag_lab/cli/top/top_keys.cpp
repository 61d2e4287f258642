// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/top_keys.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace redag::cli {
namespace {

void scroll(Key key, TopState &state) {
  switch (key) {
    case Key::Up: state.first -= std::min<std::size_t>(state.first, 1); break;
    case Key::Down: ++state.first; break;
    case Key::PageUp: state.first -= std::min(state.first, state.page); break;
    case Key::PageDown: state.first += state.page; break;
    case Key::Home: state.first = 0; break;
    case Key::End: state.first = std::numeric_limits<std::size_t>::max(); break;
    default: break;
  }
}

void enter(TopMode mode, TopState &state) {
  state.mode = mode;
  state.first = 0;
}

TopAction press_table(const KeyPress &key, TopState &state) {
  LiveView &view = state.view;
  if (key.key == Key::Escape) return TopAction::Quit;
  if (key.key == Key::Tab) return std::exchange(view.all, false) ? TopAction::None : TopAction::Next;
  if (key.key != Key::Text) {
    scroll(key.key, state);
    return TopAction::None;
  }
  const auto turn_to = [&](std::size_t order) { view.order = static_cast<LiveOrder>(order % kLiveOrders); };
  const auto order = static_cast<std::size_t>(view.order);
  switch (key.text) {
    case '?':
    case 'h': enter(TopMode::Help, state); break;
    case '<': turn_to(order + kLiveOrders - 1); break;
    case '>': turn_to(order + 1); break;
    case 'a': view.all = !view.all; break;
    case ' ': state.paused = !state.paused; break;
    case 'q': return TopAction::Quit;
    default: break;
  }
  return TopAction::None;
}

/// The help: letters, Enter and Escape go back to the table.
TopAction press_help(const KeyPress &key, TopState &state) {
  if (key.key == Key::Text && key.text == 'q') return TopAction::Quit;
  if (key.key == Key::Text || key.key == Key::Enter || key.key == Key::Escape) {
    enter(TopMode::Table, state);
  } else {
    scroll(key.key, state);
  }
  return TopAction::None;
}

}  // namespace

TopAction press(const KeyPress &key, TopState &state) {
  if (key.key == Key::Closed) return TopAction::Quit;
  return state.mode == TopMode::Help ? press_help(key, state) : press_table(key, state);
}

}  // namespace redag::cli
