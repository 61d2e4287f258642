// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/styled.hpp"

namespace redag::cli {
namespace {

/// Returns `count` columns of a UTF-8 text, from column `first`.
std::string columns(std::string_view text, std::size_t first, std::size_t count) {
  std::string result;
  std::size_t column = 0;
  for (std::size_t at = 0; at < text.size(); ++column) {
    std::size_t end = at + 1;
    while (end < text.size() && (static_cast<unsigned char>(text[end]) & 0xc0U) == 0x80U) ++end;
    if (column >= first && column < first + count) result += text.substr(at, end - at);
    at = end;
  }
  return result;
}

}  // namespace

std::size_t width_of(const Line &line) {
  std::size_t width = 0;
  for (const Span &span : line) width += display_width(span.text);
  return width;
}

std::string plain(const Line &line) { return with_codes(line, false); }

std::string with_codes(const Line &line, bool colour) {
  std::string text;
  for (const Span &span : line) text += tinted(span.text, span.tint, colour);
  if (!colour) text.erase(text.find_last_not_of(' ') + 1);
  return text;
}

Line cut(Line line, std::size_t width) {
  std::size_t used = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const std::size_t own = display_width(line[i].text);
    const bool is_last = i + 1 == line.size();
    if (used + own < width || (used + own == width && is_last)) {
      used += own;
      continue;
    }
    // What follows may be blank only.
    std::string rest = line[i].text;
    for (std::size_t k = i + 1; k < line.size(); ++k) rest += line[k].text;
    line[i].text = redag::cut(rest, width - used);
    line.resize(i + 1);
  }
  return line;
}

Line reversed(Line line, std::size_t width) {
  const std::size_t used = width_of(line);
  if (used < width) line.push_back({std::string(width - used, ' ')});
  for (Span &span : line) span.reversed = true;
  return line;
}

std::string cut_middle(std::string_view text, std::size_t width) {
  const std::size_t own = display_width(text);
  if (own <= width) return std::string(text);
  if (width < 3) return redag::cut(text, width);
  const std::size_t before = (width - 1) / 2;
  const std::size_t after = width - 1 - before;
  return columns(text, 0, before) + "\u2026" + columns(text, own - after, after);
}

std::string padded(std::string text, std::size_t width, bool right) {
  const std::size_t used = display_width(text);
  const std::string blanks(width > used ? width - used : 0, ' ');
  return right ? blanks + text : text + blanks;
}

}  // namespace redag::cli
