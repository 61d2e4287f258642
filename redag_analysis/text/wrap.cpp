// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/wrap.hpp"

#include <algorithm>

#include "redag_analysis/text/tint.hpp"

namespace redag {
namespace {

constexpr std::size_t kHanging = 2;  // indentation of the rest of a broken line

// Breaks a text whose first line has `first` columns, and the others `width`.
std::vector<std::string> broken(std::string_view text, std::size_t first, std::size_t width) {
  std::vector<std::string> lines(1);
  std::size_t used = 0;
  bool is_first_word = true;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(' '));
    text.remove_prefix(std::min(word.size() + 1, text.size()));
    const std::size_t columns = display_width(word);
    if (!is_first_word && used + 1 + columns > (lines.size() == 1 ? first : width)) {
      lines.emplace_back(word);
      used = columns;
      continue;
    }
    if (!is_first_word) lines.back() += " ";
    lines.back() += word;
    used += columns + (is_first_word ? 0 : 1);
    is_first_word = false;
  }
  return lines;
}

// Columns beside an indentation. Where it leaves no room, each word has a line of its own.
std::size_t beside(std::size_t indent, std::size_t width) { return width > indent ? width - indent : 1; }

std::string joined(const std::vector<std::string> &lines, std::size_t indent) {
  std::string all;
  for (const std::string &line : lines) all += (all.empty() ? "" : "\n" + std::string(indent, ' ')) + line;
  return all;
}

}  // namespace

std::vector<std::string> lines_within(std::string_view text, std::size_t width) {
  return width == 0 ? std::vector<std::string>{std::string(text)} : broken(text, width, width);
}

std::string wrapped(std::string_view text, std::size_t indent, std::size_t width) {
  return joined(lines_within(text, width == 0 ? 0 : beside(indent, width)), indent) + "\n";
}

std::string fitted(std::string_view document, std::size_t width) {
  std::string all;
  while (!document.empty()) {
    const std::string_view line = document.substr(0, document.find('\n'));
    document.remove_prefix(line.size());
    if (width == 0 || display_width(line) <= width) {
      all += line;
    } else {
      const std::size_t indent = std::min(line.find_first_not_of(' '), line.size());
      const std::size_t hanging = indent + kHanging;
      all += std::string(indent, ' ') +
             joined(broken(line.substr(indent), beside(indent, width), beside(hanging, width)), hanging);
    }
    if (document.empty()) break;
    all += "\n";
    document.remove_prefix(1);
  }
  return all;
}

}  // namespace redag
