// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Files that list the hosts of a robot for `redag merge-traces` (docs/hosts.md): their results, what is known of their
// clocks, and links. Paths in a file are relative to it. Not thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/hosts/chains.hpp"
#include "redag_lab/hosts/clock_offset.hpp"

namespace redag::hosts {

/// A host as a user names it.
struct HostEntry {
  std::string name = {};
  std::string result = {};  // folder of a recorded run, or its events
  ClockStatement clock = {};
  std::vector<std::string> clock_files = {};  // texts of a time service
  std::string file = {};                      // where it stands; empty: on the command line
  int line = 0;
  int column = 0;
};

struct HostList {
  std::vector<HostEntry> hosts;
  std::vector<Link> links;
};

/// Why this cannot be the name of a host; empty: it can. A name is a part of "host.dag.task" and "host/dag".
[[nodiscard]] std::string host_name_mistake(std::string_view name);

/// Reads a file of hosts. Errors name file and line.
[[nodiscard]] Result<HostList> parse_hosts(std::string_view text, const std::string &file);

/// The longest file of hosts.
inline constexpr std::size_t kMostHostsBytes = std::size_t{1} << 20U;

}  // namespace redag::hosts
