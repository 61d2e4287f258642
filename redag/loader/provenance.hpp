// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The provenance of a result: the block that every result file and page carries (docs/results_format.md). Comparisons
// of results leave it out; all else in a simulated result is the same for the same seed. Holds the command line and no
// environment. Thread-safe.
#pragma once

#include <ctime>
#include <optional>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag {

/// Texts for people and for scripts. All are empty for results from before this block existed.
struct Provenance {
  std::string created;      // UTC, ISO 8601: "2026-01-31T12:00:00Z"; the time of SOURCE_DATE_EPOCH if that is set
  std::string version;      // of redag
  std::string revision;     // of the sources: a git hash, with "-dirty" if they were changed
  std::string host;         // name of the machine
  std::string kernel;       // "Linux 6.1.0-rt7 x86_64"
  std::string command;      // the command line, quoted for a shell
  std::string calibration;  // source of the overheads in use: file and date; "none"

  [[nodiscard]] bool is_known() const { return !created.empty(); }
  friend bool operator==(const Provenance &, const Provenance &) = default;
};

/// Returns the provenance of this process at this time.
[[nodiscard]] Provenance current_provenance();

/// Sets the source of the overheads in use, from now on. It is "none" before.
void set_calibration(std::string text);

/// For example "Linux 6.1.0-rt7 x86_64"; empty if the system does not provide it.
[[nodiscard]] std::string kernel_name();

/// Git revision of this build; "unknown" outside a git checkout.
[[nodiscard]] const char *build_revision();

/// Returns the time of SOURCE_DATE_EPOCH (reproducible-builds.org), or nothing if it is not set. Error: it is no whole
/// number of seconds up to the year 9999.
[[nodiscard]] Result<std::optional<std::time_t>> source_date_epoch();

/// Returns a JSON object on one line. Bytes that are not UTF-8 become U+FFFD.
[[nodiscard]] std::string provenance_to_json(const Provenance &provenance);

/// Reads provenance_to_json(). Missing keys give empty texts. Error: not an object of texts.
[[nodiscard]] Result<Provenance> provenance_from_json(std::string_view text);

/// Returns comment lines for the top of a YAML file: "# created: \"2026-...\"" and more.
[[nodiscard]] std::string provenance_to_comment(const Provenance &provenance);

}  // namespace redag
