// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Where a result comes from: the one block that every result file and page carries (docs/results_format.md).
// Comparisons of results leave it out; all else in a simulated result is the same for the same seed. Holds the command
// line and no environment. Thread-safe.
#pragma once

#include <ctime>
#include <optional>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag {

/// Texts for people and for scripts. All are empty in results of before there was this block.
struct Provenance {
  std::string created;      // UTC, ISO 8601: "2026-01-31T12:00:00Z"; the time that SOURCE_DATE_EPOCH names, where set
  std::string version;      // of redag
  std::string revision;     // of the sources it was built from: a git hash, "-dirty" after it if they were changed
  std::string host;         // name of the machine
  std::string kernel;       // "Linux 6.1.0-rt7 x86_64"
  std::string command;      // the command line, quoted for a shell
  std::string calibration;  // what measured the overheads in use: file and date; "none"

  [[nodiscard]] bool is_known() const { return !created.empty(); }
  friend bool operator==(const Provenance &, const Provenance &) = default;
};

/// Of this process, now.
[[nodiscard]] Provenance current_provenance();

/// What the overheads in use were measured with, from now on: "none" until it is called.
void set_calibration(std::string text);

/// "Linux 6.1.0-rt7 x86_64"; empty if the system does not tell.
[[nodiscard]] std::string kernel_name();

/// Git revision of this build; "unknown" outside a git checkout.
[[nodiscard]] const char *build_revision();

/// The time of SOURCE_DATE_EPOCH (reproducible-builds.org); nothing where it is not set. Error: it is no whole number
/// of seconds up to the year 9999.
[[nodiscard]] Result<std::optional<std::time_t>> source_date_epoch();

/// A JSON object on one line; bytes that are not UTF-8 become U+FFFD.
[[nodiscard]] std::string provenance_to_json(const Provenance &provenance);

/// The reverse; keys that are missing are empty. Error: not an object of texts.
[[nodiscard]] Result<Provenance> provenance_from_json(std::string_view text);

/// Comment lines for the top of a YAML file: "# created: \"2026-...\"" and so on.
[[nodiscard]] std::string provenance_to_comment(const Provenance &provenance);

}  // namespace redag
