// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds live pages and reads them into values. Pages are not trusted: a page is copied before it is examined, every
// size in it is checked, and its names are made fit for a terminal. No state; any thread.
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

/// Tries up to `tries` times, 2 ms apart, to read a frame that is not being written. Error: there is none, the page
/// could be another user's (not owned by the user or root, or open to others), or it is damaged.
[[nodiscard]] Result<Page> read_page(const std::string &path, int tries = 10);

struct Listed {
  std::string path;
  std::int64_t pid = 0;  // from the file's name
  std::uint32_t number = 0;
  Result<Page> page;
};

/// Returns the pages of live processes, by pid and number. Removes those of dead processes where permitted. A folder
/// that cannot be read gives no pages.
[[nodiscard]] std::vector<Listed> list_pages(const std::string &folder);

}  // namespace redag::live
