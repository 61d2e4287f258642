// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Where a command's text goes: results to standard output (buffered, so that a broken pipe or a full disk is seen once,
// at the end), everything else to standard error (at once). Knows what the terminals can show. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag::cli {

enum class Tint : std::uint8_t { Plain, Good, Bad, Caution, Faint, Strong };

/// `text` wrapped in the terminal's codes for `tint`, or as it is where `colour` is false.
[[nodiscard]] std::string tinted(std::string_view text, Tint tint, bool colour);

/// Columns that a UTF-8 text takes, one a code point.
[[nodiscard]] std::size_t display_width(std::string_view text);

struct StreamTraits {
  bool terminal = false;
  bool colour = false;    // a terminal, and neither NO_COLOR nor TERM=dumb says otherwise
  std::size_t width = 0;  // columns; 0: no limit
};

class Console {
 public:
  /// Writes to two file descriptors, which it does not own.
  Console(int out, StreamTraits out_traits, int err, StreamTraits err_traits);
  /// Standard output and standard error of the process.
  Console();

  [[nodiscard]] const StreamTraits &out_traits() const { return out_traits_; }
  [[nodiscard]] const StreamTraits &err_traits() const { return err_traits_; }

  /// Results.
  void print(std::string_view text);
  /// Remarks; errors in writing them are ignored.
  void note(std::string_view text);
  void note(const Diagnostic &diagnostic);
  void note(const Diagnostics &diagnostics);
  /// A warning about the run, not about a file.
  void warn(std::string_view message, std::string_view hint = {});
  void error(std::string_view message, std::string_view hint = {});

  /// Writes what was printed. A reader that went away (`| head`) is no error. False, with a note, if it could not be
  /// written.
  [[nodiscard]] bool flush();

 private:
  void write_out(std::string_view text);

  int out_;
  int err_;
  StreamTraits out_traits_;
  StreamTraits err_traits_;
  std::string buffer_;
  int error_ = 0;  // errno of the first failure
};

}  // namespace redag::cli
