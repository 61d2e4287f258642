// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Output of a command. Results go to standard output and are buffered; a broken pipe or a full disk is then reported
// once, at the end. All other text goes to standard error at once. Knows the abilities of the terminals. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag::cli {

struct StreamTraits {
  bool terminal = false;
  bool colour = false;    // a terminal, unless NO_COLOR or TERM=dumb is set
  std::size_t width = 0;  // columns: COLUMNS, or else those of the terminal; 0: no limit
};

class Console {
 public:
  /// Writes to two file descriptors, which the caller owns.
  Console(int out, StreamTraits out_traits, int err, StreamTraits err_traits);
  /// Uses standard output and standard error of the process.
  Console();

  [[nodiscard]] const StreamTraits &out_traits() const { return out_traits_; }
  [[nodiscard]] const StreamTraits &err_traits() const { return err_traits_; }

  /// Prints results as they are: documents for programs.
  void print(std::string_view text);
  /// Prints results for people: breaks lines that are wider than the terminal at words.
  void say(std::string_view text);
  /// Prints remarks; errors in writing them are ignored.
  void note(std::string_view text);
  void note(const Diagnostic &diagnostic);
  void note(const Diagnostics &diagnostics);
  /// Prints a warning about the run, not about a file.
  void warn(std::string_view message, std::string_view hint = {});
  void error(std::string_view message, std::string_view hint = {});

  /// True if a write to standard output has failed: there is no use in printing more.
  [[nodiscard]] bool is_broken() const { return error_ != 0; }

  /// Writes the printed text. A reader that left early (`| head`) is no error. Returns false, after a note, if the text
  /// could not be written.
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

/// Prints the errors of a failed result. Returns true if there are none.
template <class T>
[[nodiscard]] bool ok(const Result<T> &result, Console &console) {
  if (!result) console.note(result.error());
  return result.has_value();
}

}  // namespace redag::cli
