// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The files of live pages: their names, who may have written them, their headers, and the end of those whose process is
// dead. Nothing in a file is trusted. No state; any thread.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/live/page.hpp"

namespace redag::live {

/// A page that is open for reading.
class PageFile {
 public:
  /// Error: there is none, or it could be another user's (not owned by the user or root, or open to others).
  [[nodiscard]] static Result<PageFile> open(const std::string &path);
  PageFile(PageFile &&other) noexcept;
  PageFile &operator=(PageFile &&) = delete;
  PageFile(const PageFile &) = delete;
  PageFile &operator=(const PageFile &) = delete;
  ~PageFile();

  /// Returns false if there are too few bytes. Reads instead of mapping: a page truncated meanwhile would kill us
  /// (SIGBUS).
  [[nodiscard]] bool read(void *target, std::size_t size, std::uint64_t offset) const;
  /// Its sizes are checked. Error: it is not a live page of this version.
  [[nodiscard]] Result<page::Header> header() const;
  [[nodiscard]] tl::unexpected<Diagnostics> damaged(const char *what) const;
  /// True if its name still leads to this file.
  [[nodiscard]] bool has_name() const;

 private:
  PageFile(std::string path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}

  std::string path_;
  int descriptor_;
  std::uint64_t size_ = 0;
  ino_t inode_ = 0;
  dev_t device_ = 0;
};

struct PageName {
  std::int64_t pid = 0;
  std::uint32_t number = 0;
};

[[nodiscard]] std::string page_path(const std::string &folder, std::int64_t pid, std::uint32_t number);
/// The names of all pages in the folder, by pid and number. A folder that cannot be read has none.
[[nodiscard]] std::vector<PageName> named_pages(const std::string &folder);
/// Removes the pages of dead processes; returns how many.
std::size_t remove_stale_pages(const std::string &folder);

}  // namespace redag::live
