// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes YAML that yaml::parse() reads as it was. Quotes texts where YAML asks for it. Not libyaml's writer, whose
// lists have another indentation than all the files of earlier versions. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace redag::yaml {

/// Call in the order of the document: begin_map(), then a key and a value in turn, end_map(). A value is a text, a map
/// or a list. Requires that each begin has its end before take(), and that a key has at most 1000 bytes.
class Writer {
 public:
  enum class Layout : std::uint8_t { Lines, OneLine };  // what lies in a map or list on one line is on that line too

  void begin_map(Layout layout = Layout::Lines) { begin(true, layout); }
  void end_map() { end(true); }
  void begin_list(Layout layout = Layout::Lines) { begin(false, layout); }
  void end_list() { end(false); }
  /// Bytes that are not UTF-8 become U+FFFD.
  void text(std::string_view text);
  /// The same, always in quotes.
  void quoted(std::string_view text);

  void write(std::string_view key, std::string_view value) {
    text(key);
    text(value);
  }
  void write(std::string_view key, std::uint64_t value) { write(key, std::string_view(std::to_string(value))); }

  /// Returns the document, with a line feed at its end. No call may follow.
  [[nodiscard]] std::string take();

 private:
  struct Part {
    bool is_map = false;
    Layout layout = Layout::Lines;
    std::size_t indentation = 0;
    std::size_t written = 0;  // keys and values
  };

  void begin(bool is_map, Layout layout);
  void end(bool is_map);
  /// Writes what stands between the last key or value and the next one.
  void separate(Layout of_next);
  void begin_line(std::size_t indentation);

  std::vector<Part> open_;
  std::string out_;
  bool after_dash_ = false;  // the first key of a map in a list is on the line of the list's dash
};

}  // namespace redag::yaml
