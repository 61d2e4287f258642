// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <optional>
#include <string>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/base/time.hpp"
#include "redag/loader/callback_match.hpp"
#include "redag/loader/cpu_list.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void values_target(std::string_view input) {
  if (const Result<Duration> duration = parse_duration(input)) {
    const Result<Duration> again = parse_duration(format_duration(*duration));
    REDAG_CHECK(again && *again == *duration, "a duration is read as it was written");
    (void)humanize_duration(*duration);
  }
  if (const std::optional<std::vector<int>> cpus = parse_cpu_list(input)) {
    REDAG_CHECK(parse_cpu_list(format_cpu_list(*cpus)) == cpus, "a list of processors is read as it was written");
  }
  (void)ros_name_mistake(input);
  const std::size_t half = input.size() / 2;
  (void)glob_match(input.substr(0, half), input.substr(half));
}

}  // namespace redag::fuzz
