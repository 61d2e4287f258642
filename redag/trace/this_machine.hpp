// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The machine and the program that make a recording. Reads /proc; any thread.
#pragma once

#include "redag/trace/trace.hpp"

namespace redag::trace {

/// As far as the operating system tells.
[[nodiscard]] Machine this_machine();

/// States them in the description of a run of this process.
void add_provenance(RunInfo &info);

}  // namespace redag::trace
