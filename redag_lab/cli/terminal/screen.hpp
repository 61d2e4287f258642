// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A whole terminal by ncurses: lines with tints, keys, its size. The destructor restores the terminal, and so do
// handlers for crashes and catchable signals. One object at a time, on one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::cli {

enum class Key : std::uint8_t {
  None,
  Text,
  Up,
  Down,
  PageUp,
  PageDown,
  Home,
  End,
  Tab,
  Enter,
  Escape,
  Closed,  // the terminal is gone
};

struct KeyPress {
  Key key = Key::None;
  char text = 0;  // Text: an ASCII character
};

class Screen {
 public:
  /// Takes over standard input and standard output. Requires is_possible().
  explicit Screen(bool colour);
  ~Screen();
  Screen(const Screen &) = delete;
  Screen &operator=(const Screen &) = delete;

  /// True if both are terminals, of a kind that can be drawn on.
  [[nodiscard]] static bool is_possible();

  struct Size {
    std::size_t columns = 80;
    std::size_t lines = 24;
  };
  [[nodiscard]] Size size() const;

  /// Replaces the screen by the lines from the top, as many as fit, with the codes of tinted(). Sends the terminal what
  /// has changed.
  void draw(const std::vector<std::string> &lines);

  /// Returns the next key; None after `timeout` or a signal.
  [[nodiscard]] KeyPress wait(Duration timeout);
};

}  // namespace redag::cli
