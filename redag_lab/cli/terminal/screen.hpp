// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Takes over a terminal: alternate screen, single keys, the current size. The destructor restores the previous state,
// and so do handlers for crashes and catchable signals. One object at a time, on one thread.
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

/// Parses and removes the first key from the bytes that a terminal sent. Unknown sequences are None.
[[nodiscard]] KeyPress take_key(std::string &bytes);

class Screen {
 public:
  /// Takes over standard input and standard output, which must be terminals (is_possible()).
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

  /// Replaces the screen by the lines from the top, as many as fit. None of them may be wider than the screen. Returns
  /// false if the terminal is gone.
  [[nodiscard]] bool draw(const std::vector<std::string> &lines);

  /// Returns the next key, or None after `timeout` or a signal.
  [[nodiscard]] KeyPress wait(Duration timeout);

 private:
  std::string pending_;
};

}  // namespace redag::cli
