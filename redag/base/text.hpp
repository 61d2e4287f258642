// Numbers as text for people, the same in tables, verdicts and pages; and what is asked of texts from outside before
// they are parsed. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace redag {

/// A share of one: 0.1421 -> "14.2 %"; "-" if nothing was counted (not finite). Never reads as none where it is not.
[[nodiscard]] std::string format_percent(double ratio);

/// 1234567 -> "1 234 567".
[[nodiscard]] std::string format_count(std::uint64_t count);

/// No JSON that this project writes is nested as deep.
inline constexpr std::size_t kMaxJsonDepth = 32;

/// Are there more than `levels` arrays and objects inside one another? What copies or prints a tree of JSON calls
/// itself once a level: ask before parsing what others wrote. Of a text that is not JSON, any answer.
[[nodiscard]] bool json_nests_deeper(std::string_view json, std::size_t levels = kMaxJsonDepth);

}  // namespace redag
