// Numbers as text for people, the same in tables, verdicts and pages. Pure functions.
#pragma once

#include <cstdint>
#include <string>

namespace redag {

/// A share of one: 0.1421 -> "14.2 %"; "-" if nothing was counted (not finite). Never reads as none where it is not.
[[nodiscard]] std::string format_percent(double ratio);

/// 1234567 -> "1 234 567".
[[nodiscard]] std::string format_count(std::uint64_t count);

}  // namespace redag
