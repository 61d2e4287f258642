// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A pause for spinning threads, between two looks at a value that another thread is about to change. Any thread.
#pragma once

namespace redag {

/// Leaves more of the processor core to its other hardware thread for some tens of ns. Not a system call.
inline void relax() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  __asm__ __volatile__("yield");
#endif
}

}  // namespace redag
