// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a merged run says about its hosts and chains: sentences, and the file hosts.json ("redag.hosts/1",
// docs/results_format.md) beside its events, which reports show. Pure, except for reading the file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/hosts/chains.hpp"
#include "redag_lab/hosts/merged_run.hpp"

namespace redag::hosts {

inline constexpr const char *kHostsFile = "hosts.json";

struct Sentence {
  enum class Tone { Good, Bad, Caution, Plain };
  Tone tone = Tone::Plain;
  std::string text;
};

/// The results of all chains, one or more sentences each.
[[nodiscard]] std::vector<Sentence> sentences_of(const ChainWatch &watch);

/// "from 12.3ms to 12.5ms", or one value if they show as the same.
[[nodiscard]] std::string describe(const Interval &interval);

/// True if some answer missed its deadline for certain.
[[nodiscard]] bool has_misses(const ChainWatch &watch);

/// Returns hosts.json, of bounded size.
[[nodiscard]] std::string to_json(const MergedRun &merged, const ChainWatch &watch);

/// hosts.json as it was read.
struct RecordedHosts {
  std::string document;       // on one line
  std::uint64_t missed = 0;   // answers of all chains with this verdict
  std::uint64_t unknown = 0;  // likewise
};

/// Reads hosts.json beside a trace. Nothing if there is none, or that of another run than `run`. Errors name the file.
[[nodiscard]] Result<std::optional<RecordedHosts>> read_hosts_of(const std::string &trace, const trace::RunInfo &run);

}  // namespace redag::hosts
