#include "redag/base/text.hpp"

#include <fmt/format.h>

#include <cmath>

namespace redag {

std::string format_percent(double ratio) {
  if (!std::isfinite(ratio)) return "-";
  // Never let a miss read as none: 3 of 100 000 is 0.003 %.
  const double percent = 100 * ratio;
  if (percent > 0 && percent < 0.05) return fmt::format("{:.2g} %", percent);
  return fmt::format("{:.1f} %", percent);
}

std::string format_count(std::uint64_t count) {
  std::string text = fmt::format("{}", count);
  for (std::size_t at = text.size(); at > 3;) text.insert(at -= 3, " ");
  return text;
}

bool json_nests_deeper(std::string_view json, std::size_t levels) {
  std::size_t depth = 0;
  bool in_text = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_text) {
      if (c == '\\') ++i;
      if (c == '"') in_text = false;
    } else if (c == '"') {
      in_text = true;
    } else if (c == '[' || c == '{') {
      if (++depth > levels) return true;
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return false;
}

}  // namespace redag
