// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A whole terminal for a while: alternate screen, keys one by one, the size as it is now. What was there comes back
// when this ends, also if the program crashes or is killed by a signal that can be caught. One at a time, one thread.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::cli {

enum class Key : std::uint8_t { None, Text, Up, Down, PageUp, PageDown, Home, End, Enter, Escape, Resize, Closed };

struct KeyPress {
  Key key = Key::None;
  char text = 0;  // Key::Text: an ASCII character
};

/// What the bytes that a terminal sent mean: the first key, which is taken from them. Unknown sequences are None.
[[nodiscard]] KeyPress take_key(std::string &bytes);

class Screen {
 public:
  /// Takes standard input and standard output, which must be terminals (is_possible()).
  Screen();
  ~Screen();
  Screen(const Screen &) = delete;
  Screen &operator=(const Screen &) = delete;

  [[nodiscard]] static bool is_possible();

  struct Size {
    std::size_t columns = 80;
    std::size_t lines = 24;
  };
  [[nodiscard]] Size size() const;

  /// Shows the lines from the top, as many as there is room for; what was there before is gone. None of them may be
  /// wider than the screen. False: the terminal is gone.
  [[nodiscard]] bool draw(const std::vector<std::string> &lines);

  /// The next key, or None after `timeout`, or when a signal came.
  [[nodiscard]] KeyPress wait(Duration timeout);

 private:
  std::string pending_;
};

}  // namespace redag::cli
