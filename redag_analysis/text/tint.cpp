// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/tint.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace redag {
namespace {

constexpr const char *kReset = "\033[0m";

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

/// A character of a text, or a code of tinted(), which takes no column.
struct Piece {
  std::size_t bytes;
  bool is_code;
};

Piece first_piece(std::string_view text) {
  if (text.starts_with("\033[")) return {std::min(text.find('m'), text.size() - 1) + 1, true};
  std::size_t bytes = 1;
  while (bytes < text.size() && (static_cast<unsigned char>(text[bytes]) & 0xc0U) == 0x80U) ++bytes;
  return {bytes, false};
}

}  // namespace

std::string tinted(std::string_view text, Tint tint, bool colour) {
  if (!colour || tint == Tint::Plain) return std::string(text);
  return fmt::format("{}{}{}", code_of(tint), text, kReset);
}

std::size_t display_width(std::string_view text) {
  std::size_t columns = 0;
  while (!text.empty()) {
    const Piece piece = first_piece(text);
    if (!piece.is_code) ++columns;
    text.remove_prefix(piece.bytes);
  }
  return columns;
}

std::string cut(std::string_view text, std::size_t width) {
  if (display_width(text) <= width) return std::string(text);
  if (width == 0) return {};
  std::size_t kept = 0;
  bool has_codes = false;
  for (std::size_t columns = 0;;) {
    const Piece piece = first_piece(text.substr(kept));
    if (!piece.is_code && ++columns == width) break;
    has_codes = has_codes || piece.is_code;
    kept += piece.bytes;
  }
  return std::string(text.substr(0, kept)) + "~" + (has_codes ? kReset : "");
}

}  // namespace redag
