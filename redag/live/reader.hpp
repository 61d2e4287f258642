// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The reading end of live pages: finds them, and makes values of them. What it reads can be anything: a page is copied
// before it is looked at, every size in it is checked, its names are made fit for a terminal, and pages that somebody
// else could have written are refused. No state; any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/live/frame.hpp"
#include "redag/live/process.hpp"

namespace redag::live {

struct Page {
  Process process;
  Frame frame;
};

/// Looks up to `tries` times, 2 ms apart, for a frame that is not just being written.
/// Error: there is none, it is not ours (owned by the user or by root, nobody else may open it), or it is damaged.
[[nodiscard]] Result<Page> read_page(const std::string &path, int tries = 10);

struct Listed {
  std::string path;
  std::int64_t pid = 0;  // as the name has it
  std::uint32_t number = 0;
  Result<Page> page;
};

/// The pages of processes that live, by pid and number; those of dead ones are removed where that is permitted. A
/// folder that cannot be read has none.
[[nodiscard]] std::vector<Listed> list_pages(const std::string &folder);

/// Removes the pages of processes that are gone: how many.
std::size_t remove_stale_pages(const std::string &folder);

[[nodiscard]] std::string page_path(const std::string &folder, std::int64_t pid, std::uint32_t number);

}  // namespace redag::live
