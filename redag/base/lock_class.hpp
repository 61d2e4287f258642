// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Checks, in debug builds, that no thread which must react at once waits for unbounded work. Such threads release and
// wake jobs, above all jobs. A lock that they take is Bounded, and its owner begins nothing unbounded. Any thread.
#pragma once

#include <cstdint>

#include "redag/base/check.hpp"

namespace redag {

enum class LockClass : std::uint8_t {
  Undeclared,  // of users, and not checked
  Bounded,     // held for a bounded time: its owner takes no Unbounded lock, and calls no code of users
  Unbounded,   // its owner may compute or wait: no thread that must react takes it
};

#ifdef REDAG_CHECK_LOCK_CLASSES  // the same for the library and all that use it
inline constexpr bool kChecksLockClasses = true;
#else
inline constexpr bool kChecksLockClasses = false;
#endif

namespace detail {

inline thread_local std::uint32_t bounded_locks = 0;  // held by this thread
inline thread_local std::uint32_t must_react = 0;     // scopes

}  // namespace detail

/// begin_unbounded_work() is called before code whose time nothing bounds: of users, or under an Unbounded lock.
inline void begin_unbounded_work() noexcept {
  if constexpr (!kChecksLockClasses) return;
  REDAG_CHECK(detail::must_react == 0, "a thread that must react begins unbounded work, or waits for it");
  REDAG_CHECK(detail::bounded_locks == 0, "unbounded work begins under a lock that threads which must react take");
}

/// While it exists, the calling thread must react.
class MustReact {
 public:
  MustReact() noexcept { detail::must_react += kChecksLockClasses ? 1 : 0; }
  ~MustReact() { detail::must_react -= kChecksLockClasses ? 1 : 0; }
  MustReact(const MustReact &) = delete;
  MustReact &operator=(const MustReact &) = delete;
};

namespace detail {

inline void before_lock(LockClass its_class) noexcept {
  if (kChecksLockClasses && its_class == LockClass::Unbounded) begin_unbounded_work();
}
inline void after_lock(LockClass its_class) noexcept {
  if (kChecksLockClasses && its_class == LockClass::Bounded) ++bounded_locks;
}
inline void before_unlock(LockClass its_class) noexcept {
  if (kChecksLockClasses && its_class == LockClass::Bounded) --bounded_locks;
}

}  // namespace detail

}  // namespace redag
