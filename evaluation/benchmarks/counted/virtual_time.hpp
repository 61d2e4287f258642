// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A program that is linked with virtual_time.cpp can have its clocks advance by a fixed step at each reading. The
// runtime treats short jobs and long ones differently, and under valgrind every job is long. In virtual time a job
// takes as long as its clocks are read, so that the program executes the same instructions in each run.
#pragma once

namespace redag::benchmarks {

/// All threads read virtual clocks from now on. Waits with a deadline then end too early: for programs without any.
void begin_virtual_time();

/// The calling thread reads virtual clocks from now on, which continue where the real ones are. The other threads keep
/// the real clocks.
void begin_virtual_time_here();
/// The calling thread reads the real clocks again, which have run ahead.
void end_virtual_time_here();

}  // namespace redag::benchmarks
