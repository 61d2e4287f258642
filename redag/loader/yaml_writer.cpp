// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/yaml_writer.hpp"

#include <utility>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#include "redag/loader/workload_yaml_tree.hpp"

namespace redag::yaml {
namespace {

bool contains(std::string_view set, char c) { return set.find(c) != std::string_view::npos; }

// libyaml takes U+FFFE and U+FFFF only in escapes.
bool is_raw(std::string_view character) {
  return find_unprintable(character).empty() && character != "\xEF\xBF\xBE" && character != "\xEF\xBF\xBF";
}

/// The text between the quotes, without control characters and invalid bytes.
std::string escaped(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    if (length == 0) {
      out += "\xEF\xBF\xBD";
      ++i;
      continue;
    }
    const std::string_view character = text.substr(i, length);
    if (character == "\"" || character == "\\") {
      out += '\\';
      out += character;
    } else if (is_raw(character)) {
      out += character;
    } else {
      out += fmt::format("\\U{:08X}", static_cast<std::uint32_t>(code_point(character)));
    }
    i += length;
  }
  return out;
}

bool is_all_raw(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    if (length == 0 || !is_raw(text.substr(i, length))) return false;
    i += length;
  }
  return true;
}

/// True if YAML reads the text without quotes as it is. `in_line`: inside {} or [].
bool is_plain(std::string_view text, bool in_line) {
  if (find_odd_space(text) != std::string_view::npos) return false;
  if (is_null(text) || text.front() == ' ' || text.back() == ' ') return false;
  if (text.starts_with("---") || text.starts_with("...")) return false;
  if (contains(",[]{}#&*!|>'\"%@`", text.front())) return false;
  const auto ends_word = [text](std::size_t i) { return i == text.size() || text[i] == ' '; };
  if (contains("-?:", text.front()) && ends_word(1)) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == ':' && ends_word(i + 1)) return false;
    if (text[i] == '#' && text[i - 1] == ' ') return false;
    if (contains(in_line ? "&,?[]{}" : "&", text[i])) return false;
  }
  return is_all_raw(text);
}

}  // namespace

void Writer::begin_line(std::size_t indentation) {
  if (!after_dash_ && !out_.empty()) {
    out_ += '\n';
    out_.append(indentation, ' ');
  }
  after_dash_ = false;
}

void Writer::separate(Layout of_next) {
  if (open_.empty()) return;
  Part &part = open_.back();
  const bool is_value = part.is_map && part.written % 2 == 1;
  if (is_value) {
    out_ += of_next == Layout::OneLine ? ": " : ":";
  } else if (part.layout == Layout::OneLine) {
    if (part.written > 0) out_ += ", ";
  } else {
    begin_line(part.indentation);
    if (!part.is_map) out_ += "- ";
  }
  ++part.written;
}

void Writer::begin(bool is_map, Layout layout) {
  Part part{is_map, layout, 0, 0};
  if (!open_.empty()) {
    if (open_.back().layout == Layout::OneLine) part.layout = Layout::OneLine;
    part.indentation = open_.back().indentation + 2;
  }
  const bool is_item = !open_.empty() && !open_.back().is_map;
  separate(part.layout);
  if (part.layout == Layout::OneLine) {
    out_ += is_map ? '{' : '[';
  } else if (is_item) {
    after_dash_ = true;
  }
  open_.push_back(part);
}

void Writer::end(bool is_map) {
  REDAG_CHECK(!open_.empty() && open_.back().is_map == is_map, "each begin has its end");
  const Part part = open_.back();
  REDAG_CHECK(!is_map || part.written % 2 == 0, "each key has a value");
  open_.pop_back();
  const bool is_empty = part.written == 0;
  if (is_empty && part.layout == Layout::Lines) {
    const bool is_value = !open_.empty() && open_.back().is_map;
    out_ += is_value ? " " : "";
    out_ += is_map ? "{}" : "[]";
    after_dash_ = false;
  } else if (part.layout == Layout::OneLine) {
    out_ += is_map ? '}' : ']';
  }
}

void Writer::text(std::string_view text) {
  const bool in_line = !open_.empty() && open_.back().layout == Layout::OneLine;
  if (!is_plain(text, in_line)) {
    quoted(text);
    return;
  }
  separate(Layout::OneLine);
  out_ += text;
}

void Writer::quoted(std::string_view text) {
  separate(Layout::OneLine);
  out_ += '"' + escaped(text) + '"';
}

std::string Writer::take() {
  REDAG_CHECK(open_.empty(), "each begin has its end");
  return std::move(out_) + '\n';
}

}  // namespace redag::yaml
