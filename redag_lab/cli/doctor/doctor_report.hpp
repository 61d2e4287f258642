// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `redag doctor` found, as text and as JSON. Pure functions.
#pragma once

#include <cstddef>
#include <string>

#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/doctor/diagnosis.hpp"
#include "redag_lab/doctor/measure.hpp"

namespace redag::cli {

/// One line for each setting, yellow and red ones with why they matter and how to mend them; then the threads of the
/// examined processes, and a sentence.
[[nodiscard]] std::string describe(const doctor::Diagnosis &diagnosis, std::size_t width, bool colour);

/// The histogram of wake-ups and the charged overheads.
[[nodiscard]] std::string describe(const doctor::Measurement &measurement, std::size_t width, bool colour);

/// The document redag.doctor/1. `measurement`: null if there was none.
[[nodiscard]] Json to_json(const doctor::Diagnosis &diagnosis, const doctor::Measurement *measurement);

}  // namespace redag::cli
