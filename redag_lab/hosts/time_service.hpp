// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What time services say about the clock of their host: the texts of `chronyc tracking` (chrony) and of `pmc`
// (linuxptp: TIME_STATUS_NP, CURRENT_DATA_SET). Pure functions of text.
#pragma once

#include <string>
#include <string_view>

#include "redag/base/result.hpp"
#include "redag_lab/hosts/clock_offset.hpp"

namespace redag::hosts {

struct TimeServiceReading {
  std::string service;  // "chrony", "linuxptp"
  /// Contains the offset of the host's clock as long as the service corrects what it has measured.
  Interval offset;
  bool states_uncertainty = true;  // false: of the offset's error nothing is known but what the user adds
};

/// Reads the text of either service. Errors, with the line in `file`: another text, a value that is missing or
/// ill-formed, a clock that is not synchronised.
[[nodiscard]] Result<TimeServiceReading> parse_time_service(std::string_view text, const std::string &file);

/// Adds a reading to what is known of a clock, which then has been within all of them. `path` is the file of the text.
void add_reading(const TimeServiceReading &reading, const std::string &path, ClockStatement &clock);

/// The longest text that is read.
inline constexpr std::size_t kMostTimeServiceBytes = std::size_t{1} << 20U;

}  // namespace redag::hosts
