// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/time_service.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::hosts {
namespace {

using trace::file_error;

constexpr std::string_view kBlank = " \t\r";

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

// A value of the text, and where it stands.
struct Found {
  std::string_view value;
  int line = 0;
};

// Finds the first line that begins with `key`, which a blank or a colon ends.
std::optional<Found> find_line(std::string_view text, std::string_view key) {
  int number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!line.starts_with(key)) continue;
    std::string_view rest = line.substr(key.size());
    if (!rest.empty() && kBlank.find(rest.front()) == std::string_view::npos && rest.front() != ':') continue;
    rest = trimmed(rest);
    if (rest.starts_with(':')) rest = trimmed(rest.substr(1));
    return Found{rest, number};
  }
  return std::nullopt;
}

// Returns the decimal number before `unit` as a duration; `suffix` is the unit of parse_duration(). Finer digits than
// nanoseconds are rounded up in size, and the result is at most 1 ns too large.
std::optional<Duration> number_of(std::string_view text, std::string_view suffix) {
  std::string number(text.substr(0, text.find_first_of(kBlank)));
  if (number.starts_with('+')) number.erase(0, 1);
  if (number.empty() || number.find_first_not_of("-.0123456789") != std::string::npos) return std::nullopt;
  const std::size_t digits = suffix == "s" ? 9 : 0;
  bool is_rounded = false;
  if (const std::size_t point = number.find('.'); point != std::string::npos && number.size() > point + 1 + digits) {
    is_rounded = number.find_first_not_of('0', point + 1 + digits) != std::string::npos;
    number.resize(digits == 0 ? point : point + 1 + digits);
  }
  const bool is_negative = number.starts_with('-');
  Result<Duration> value = parse_duration(number + std::string(suffix));
  if (!value || *value < -kMostOffset || *value > kMostOffset) return std::nullopt;
  if (is_rounded) *value += is_negative ? -1 : 1;
  return *value;
}

class Reader {
 public:
  Reader(std::string_view text, const std::string &file) : text_(text), file_(file) {}

  Result<TimeServiceReading> chrony() const {
    const Found at = *find_line(text_, "System time");
    if (const auto leap = find_line(text_, "Leap status"); leap && leap->value.starts_with("Not synchronised")) {
      return file_error(file_, leap->line, "chrony had not synchronised this clock",
                        "wait until `chronyc waitsync` returns, and record again");
    }
    const std::optional<Duration> size = number_of(at.value, "s");
    const bool is_slow = at.value.find(" slow of NTP time") != std::string_view::npos;
    const bool is_fast = at.value.find(" fast of NTP time") != std::string_view::npos;
    if (!size || *size < 0 || is_slow == is_fast) {
      return file_error(file_, at.line, fmt::format("{} is no offset from NTP time", in_quotes(at.value)),
                        "save the output of `chronyc tracking` as it is");
    }
    const Result<Duration> delay = seconds("Root delay");
    const Result<Duration> dispersion = seconds("Root dispersion");
    if (!delay) return tl::unexpected<Diagnostics>(delay.error());
    if (!dispersion) return tl::unexpected<Diagnostics>(dispersion.error());
    // chronyc(1), "tracking": the error of the corrected clock is at most root dispersion + root delay / 2. The
    // system's clock itself is `size` away from that one, and chrony slews it there.
    const Duration error = *dispersion + (std::max<Duration>(*delay, 0) + 1) / 2;
    const Duration offset = is_fast ? *size : -*size;
    return TimeServiceReading{"chrony", {std::min<Duration>(offset, 0) - error, std::max<Duration>(offset, 0) + error}};
  }

  Result<TimeServiceReading> linuxptp() const {
    const Found at = *find_line(text_, "master_offset");
    const auto present = find_line(text_, "gmPresent");
    const std::optional<Duration> offset = number_of(at.value, "ns");
    if (!offset) {
      return file_error(file_, at.line, fmt::format("{} is no offset in nanoseconds", in_quotes(at.value)),
                        "save the output of `pmc` as it is");
    }
    if (!present || (present->value != "true" && present->value != "false")) {
      return file_error(file_, present ? present->line : at.line, "it does not say whether there is a grandmaster",
                        "save the whole output of pmc 'GET TIME_STATUS_NP'");
    }
    // Its own grandmaster: the clock of this host is the common one.
    if (present->value == "false" && *offset == 0) return TimeServiceReading{"linuxptp", {}};
    if (present->value == "false") {
      return file_error(file_, present->line, "linuxptp had lost the grandmaster of this clock",
                        "record again once gmPresent is true");
    }
    TimeServiceReading reading{"linuxptp", {std::min<Duration>(*offset, 0), std::max<Duration>(*offset, 0)}};
    const Result<std::optional<Duration>> delay = path_delay();
    if (!delay) return tl::unexpected<Diagnostics>(delay.error());
    reading.states_uncertainty = delay->has_value();
    reading.offset.low -= delay->value_or(0);
    reading.offset.high += delay->value_or(0);
    return reading;
  }

 private:
  Result<Duration> seconds(std::string_view key) const {
    const auto found = find_line(text_, key);
    if (!found) {
      return file_error(file_, 0, fmt::format("the line '{}' is missing", key),
                        "save the whole output of `chronyc tracking`");
    }
    const std::optional<Duration> value = number_of(found->value, "s");
    if (value && found->value.find("seconds") != std::string_view::npos) return *value;
    return file_error(file_, found->line, fmt::format("{} is no number of seconds", in_quotes(found->value)),
                      "save the output of `chronyc tracking` as it is");
  }

  // The delay that linuxptp measures is half of a round trip. However it is divided between the two ways, the offset
  // that follows from it is wrong by at most this half. It says nothing about the clocks beyond the next one.
  Result<std::optional<Duration>> path_delay() const {
    const auto found = find_line(text_, "meanPathDelay");
    if (!found) return std::optional<Duration>();
    const std::optional<Duration> delay = number_of(found->value, "ns");
    if (!delay || *delay < 0) {
      return file_error(file_, found->line, fmt::format("{} is no delay in nanoseconds", in_quotes(found->value)),
                        "save the output of `pmc` as it is");
    }
    const auto steps = find_line(text_, "stepsRemoved");
    if (steps && steps->value != "0" && steps->value != "1") return std::optional<Duration>();
    return std::optional(*delay);
  }

  std::string_view text_;
  const std::string &file_;
};

}  // namespace

Result<TimeServiceReading> parse_time_service(std::string_view text, const std::string &file) {
  const Reader reader(text, file);
  if (find_line(text, "System time")) return reader.chrony();
  if (find_line(text, "master_offset")) return reader.linuxptp();
  return file_error(
      file, text.empty() ? 0 : 1, "neither chrony nor linuxptp wrote this text",
      "save the output of `chronyc tracking`, or of `pmc -u -b 0 'GET TIME_STATUS_NP' 'GET CURRENT_DATA_SET'`");
}

void add_reading(const TimeServiceReading &reading, const std::string &path, ClockStatement &clock) {
  clock.by += fmt::format("{}{} ({})", clock.by.empty() ? "" : ", ", reading.service, path);
  clock.needs_extra = clock.needs_extra || !reading.states_uncertainty;
  const Interval &offset = reading.offset;
  clock.kept_within = clock.kept_within ? Interval{std::min(clock.kept_within->low, offset.low),
                                                   std::max(clock.kept_within->high, offset.high)}
                                        : offset;
}

}  // namespace redag::hosts
