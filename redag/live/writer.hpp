// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes a live page: a file in shared memory that only its owner can read, removed by the destructor. Not thread-safe.
// Writing allocates only the memory of rows that were never used before.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "redag/base/result.hpp"
#include "redag/live/frame.hpp"
#include "redag/live/owned_file.hpp"
#include "redag/live/page.hpp"

namespace redag::live {

/// The largest frame that can be published: a thousand DAGs with five thousand tasks.
inline constexpr std::size_t kSlotSize = std::size_t{4} << 20U;

class PageWriter {
 public:
  /// Creates `folder`/redag.PID.N with the first free N, and removes pages of dead processes there. Error: what the
  /// system refused.
  [[nodiscard]] static Result<std::unique_ptr<PageWriter>> create(const std::string &folder = kFolder,
                                                                  std::size_t slot_size = kSlotSize);
  ~PageWriter();
  PageWriter(const PageWriter &) = delete;
  PageWriter &operator=(const PageWriter &) = delete;

  /// Makes `frame` the latest one and sets its sequence. Rows for which there is no room, in the slot or in the
  /// system's memory, are left out and counted.
  void publish(const Frame &frame);

  [[nodiscard]] const std::string &path() const { return path_; }

 private:
  PageWriter(std::string path, int descriptor, std::byte *memory, std::size_t slot_size);
  /// Stores a word with release order: a reader that sees it also sees all earlier writes.
  void store_word(std::size_t offset, std::uint64_t word);
  [[nodiscard]] bool reserve(std::size_t slot, std::size_t size);

  std::string path_;
  int descriptor_;
  std::byte *memory_;
  std::size_t slot_size_;
  std::size_t reserved_[2] = {0, 0};  // bytes of each slot that have memory behind them
  std::uint64_t sequence_ = 0;
};

}  // namespace redag::live
