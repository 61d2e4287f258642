// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/executor_options.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <type_traits>

#include "redag/base/text.hpp"
#include "redag/loader/validate.hpp"
#include "redag/runtime/executor_impl.hpp"

namespace redag::runtime {
namespace {

constexpr std::size_t kMaxTraceCapacity = std::size_t{1} << 28U;
constexpr double kMaxWatchedDeadlines = 1e6;
constexpr std::uint64_t kMinRecordBytes = std::uint64_t{64} << 10U;
constexpr std::uint64_t kMaxRecordBytes = std::uint64_t{1} << 40U;

template <class Number>
void check_range(const char *option, Number value, std::type_identity_t<Number> least,
                 std::type_identity_t<Number> most) {
  if (value >= least && value <= most) return;
  refuse(fmt::format("ExecutorOptions::{} must be from {} to {}, not {}", option, least, most, value));
}

void check_duration(const char *option, nanoseconds value) {
  if (value.count() >= 0 && value.count() <= kMaxDuration) return;
  refuse(fmt::format("ExecutorOptions::{} must be from 0s to {}, not {}", option, kMaxDurationText,
                     format_duration(value.count())));
}

}  // namespace

[[noreturn]] void refuse(const std::string &what) { throw std::invalid_argument(what); }

void check(const ExecutorOptions &options) {
  if (const std::string why = name_mistake(options.name); !why.empty()) {
    refuse(fmt::format("ExecutorOptions::name {} {}", in_quotes(options.name), why));
  }
  check_range("workers", options.workers, 0U, kMaxWorkers);
  check_range("threads", options.threads, 0U, 2 * kMaxWorkers);
  if (options.threads > 0 && options.threads < options.workers) {
    refuse(fmt::format("ExecutorOptions::threads is {}, but must be 0 or at least {}, the number of workers",
                       options.threads, options.workers));
  }
  check_range("trace_capacity", options.trace_capacity, std::size_t{0}, kMaxTraceCapacity);
  check_range("record_bytes", options.record_bytes, kMinRecordBytes, kMaxRecordBytes);
  if (const std::string why = device_mistake(options.devices); !why.empty()) {
    refuse("ExecutorOptions::devices: " + why);
  }
  check_duration("spin", options.spin);
  check_duration("stop_timeout", options.stop_timeout);
  if (!options.watchdog) return;
  const WatchLimits &limits = options.watchdog->limits;
  check_duration("watchdog: limits.longest", nanoseconds(limits.longest));
  check_duration("watchdog: interval", nanoseconds(options.watchdog->interval));
  check_range("watchdog: limits.deadlines", limits.deadlines, 0.0, kMaxWatchedDeadlines);
  if (limits.longest == 0 && limits.deadlines == 0) {
    refuse(
        "ExecutorOptions::watchdog: no job would be overdue (set limits.longest or limits.deadlines to a value greater "
        "than 0)");
  }
}

}  // namespace redag::runtime
