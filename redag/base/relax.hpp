// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a thread does between two looks at something that another thread is about to change.
#pragma once

namespace redag {

/// Leaves the processor's other thread more of it, for some tens of ns. Not a system call.
inline void relax() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  __asm__ __volatile__("yield");
#endif
}

}  // namespace redag
