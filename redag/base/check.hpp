// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Checks for broken invariants. REDAG_CHECK stays on in release builds: a scheduler that has lost count of a job should
// stop and say where, not continue. Any thread.
#pragma once

namespace redag::detail {

/// Prints the condition and its place to standard error, and aborts.
[[noreturn]] void check_failed(const char *condition, const char *message, const char *file, int line) noexcept;

}  // namespace redag::detail

// Uses __FILE__ because clang 14 has no std::source_location with GCC's standard library.
#define REDAG_CHECK(condition, message)                \
  (static_cast<bool>(condition) ? static_cast<void>(0) \
                                : ::redag::detail::check_failed(#condition, message, __FILE__, __LINE__))
