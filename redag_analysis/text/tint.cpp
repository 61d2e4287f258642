// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/tint.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace redag {
namespace {

const char *code_of(Tint tint) {
  switch (tint) {
    case Tint::Plain: break;
    case Tint::Good: return "\033[32m";
    case Tint::Bad: return "\033[31m";
    case Tint::Caution: return "\033[33m";
    case Tint::Faint: return "\033[2m";
    case Tint::Strong: return "\033[1m";
  }
  return "";
}

}  // namespace

std::string tinted(std::string_view text, Tint tint, bool colour) {
  if (!colour || tint == Tint::Plain) return std::string(text);
  return fmt::format("{}{}\033[0m", code_of(tint), text);
}

std::size_t display_width(std::string_view text) {
  std::size_t columns = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text.substr(i).starts_with("\033[")) {
      i = std::min(text.find('m', i), text.size());  // tinted() writes no other codes
      continue;
    }
    if ((static_cast<unsigned char>(text[i]) & 0xc0U) != 0x80U) ++columns;
  }
  return columns;
}

std::string cut(std::string_view text, std::size_t width) {
  if (display_width(text) <= width) return std::string(text);
  if (width == 0) return {};
  std::size_t bytes = 0;
  for (std::size_t columns = 0; bytes < text.size(); ++bytes) {
    const bool starts_character = (static_cast<unsigned char>(text[bytes]) & 0xc0U) != 0x80U;
    if (starts_character && ++columns == width) break;
  }
  return std::string(text.substr(0, bytes)) + "…";
}

}  // namespace redag
