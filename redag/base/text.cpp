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

}  // namespace redag
