// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/text.hpp"

#include <fmt/format.h>

#include <cmath>

namespace redag {
namespace {

bool can_be_shown(char32_t code) {
  const bool control = code < 0x20 || (code >= 0x7F && code < 0xA0);
  const bool separator = code == 0x2028 || code == 0x2029 || code == 0xFEFF;
  const bool direction =
      code == 0x200E || code == 0x200F || (code >= 0x202A && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
  return !control && !separator && !direction;
}

}  // namespace

char32_t code_point(std::string_view sequence) {
  const auto lead = static_cast<unsigned char>(sequence.front());
  if (sequence.size() == 1) return lead;
  char32_t code = lead & (0x7FU >> sequence.size());
  for (const char c : sequence.substr(1)) code = code << 6U | (static_cast<unsigned char>(c) & 0x3FU);
  return code;
}

std::size_t utf8_length(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  const unsigned lead = byte(at);
  if (lead < 0x80) return 1;
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || at + length > text.size()) return 0;
  for (std::size_t k = 1; k < length; ++k) {
    if ((byte(at + k) & 0xC0U) != 0x80) return 0;
  }
  const unsigned second = byte(at + 1);
  if (lead == 0xE0 && second < 0xA0) return 0;
  if (lead == 0xED && second > 0x9F) return 0;
  if (lead == 0xF0 && second < 0x90) return 0;
  if (lead == 0xF4 && second > 0x8F) return 0;
  return length;
}

std::string find_unprintable(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    if (length == 0) return fmt::format("byte 0x{:02X}", static_cast<unsigned char>(text[i]));
    const char32_t code = code_point(text.substr(i, length));
    if (!can_be_shown(code)) return fmt::format("U+{:04X}", static_cast<std::uint32_t>(code));
    i += length;
  }
  return {};
}

std::string printable(std::string_view text, std::string_view kept) {
  std::string shown;
  shown.reserve(text.size());
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = utf8_length(text, i);
    if (length == 0) {
      shown += fmt::format("\\x{:02X}", static_cast<unsigned char>(text[i++]));
      continue;
    }
    const char32_t code = code_point(text.substr(i, length));
    if (can_be_shown(code) || (length == 1 && kept.find(text[i]) != std::string_view::npos)) {
      shown += text.substr(i, length);
    } else {
      shown += fmt::format("\\u{{{:X}}}", static_cast<std::uint32_t>(code));
    }
    i += length;
  }
  return shown;
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  if (text.size() <= kLongest) return "'" + printable(text, {}) + "'";
  std::size_t cut = kLongest;
  while (cut > 0 && (static_cast<unsigned char>(text[cut]) & 0xC0U) == 0x80) --cut;  // whole characters
  return "'" + printable(text.substr(0, cut), {}) + "...'";
}

std::string format_percent(double ratio) {
  if (!std::isfinite(ratio)) return "-";
  // Never shows a miss as none: 3 of 100 000 is 0.003 %.
  const double percent = 100 * ratio;
  if (percent > 0 && percent < 0.05) return fmt::format("{:.2g} %", percent);
  if (percent < 100 && percent >= 99.95) {
    const int digits = std::min(12, static_cast<int>(std::ceil(-std::log10(100 - percent))) + 1);
    return fmt::format("{:.{}f} %", percent, digits);
  }
  return fmt::format("{:.1f} %", percent);
}

std::string format_count(std::uint64_t count) {
  std::string text = fmt::format("{}", count);
  for (std::size_t at = text.size(); at > 3;) text.insert(at -= 3, " ");
  return text;
}

std::string format_share(std::uint64_t part, std::uint64_t whole) {
  if (whole == 0) return "-";
  if (part == 0) return "none";
  constexpr double kSmall = 0.01;
  const double share = static_cast<double>(part) / static_cast<double>(whole);
  const std::string percent = format_percent(share);
  return share < kSmall ? fmt::format("{} ({} of {})", percent, format_count(part), format_count(whole)) : percent;
}

std::string format_count_and_share(std::uint64_t part, std::uint64_t whole) {
  if (whole == 0) return "-";
  if (part == 0) return "0";
  return fmt::format("{} ({})", format_count(part),
                     format_percent(static_cast<double>(part) / static_cast<double>(whole)));
}

bool json_is_too_large(std::string_view json, std::size_t levels, std::size_t values) {
  std::size_t depth = 0;
  std::size_t begun = 0;  // values: the first one of each array and object, and one behind each comma
  bool in_text = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_text) {
      if (c == '\\') ++i;
      if (c == '"') in_text = false;
    } else if (c == '"') {
      in_text = true;
    } else if (c == '[' || c == '{') {
      if (++depth > levels || ++begun > values) return true;
    } else if (c == ',') {
      if (++begun > values) return true;
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return false;
}

}  // namespace redag
