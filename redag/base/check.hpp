// Broken invariants. REDAG_CHECK stays on in release builds: a scheduler that goes on after losing count of a job is
// worse than one that stops and says where.
#pragma once

#include <source_location>

namespace redag::detail {

/// Prints the condition and its place to standard error and aborts.
[[noreturn]] void check_failed(const char *condition, const char *message, std::source_location where) noexcept;

}  // namespace redag::detail

#define REDAG_CHECK(condition, message) \
  (static_cast<bool>(condition)         \
       ? static_cast<void>(0)           \
       : ::redag::detail::check_failed(#condition, message, ::std::source_location::current()))
