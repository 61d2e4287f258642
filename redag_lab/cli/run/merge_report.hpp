// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents a merged run to people: its hosts, their clocks, and the chains over them. Pure.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/hosts/chains.hpp"
#include "redag_lab/hosts/merged_run.hpp"
#include "redag_lab/run/session.hpp"

namespace redag::cli {

/// Returns a table of the hosts, a table of the chains and what they show, and the verdicts about the merged run, whose
/// trace `session` need not hold.
[[nodiscard]] std::string describe(const lab::Session &session, const hosts::MergedRun &merged,
                                   const hosts::ChainWatch &watch, const StreamTraits &terminal);

}  // namespace redag::cli
