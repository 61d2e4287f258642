// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The writing end of a live page: a file in shared memory that only its owner can read, gone when this is destroyed.
// Not thread-safe. Writing allocates nothing but the memory of rows that were never used before.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "redag/base/result.hpp"
#include "redag/live/frame.hpp"
#include "redag/live/page.hpp"

namespace redag::live {

inline constexpr const char *kFolder = "/dev/shm";
/// Frames up to this size can be published: a thousand DAGs with four thousand tasks.
inline constexpr std::size_t kSlotSize = std::size_t{3} << 19U;

class PageWriter {
 public:
  /// Makes `folder`/redag.PID.N, with the first N that is free, and removes pages of dead processes there. Error: what
  /// the system refused.
  [[nodiscard]] static Result<std::unique_ptr<PageWriter>> create(const std::string &folder = kFolder,
                                                                  std::size_t slot_size = kSlotSize);
  ~PageWriter();
  PageWriter(const PageWriter &) = delete;
  PageWriter &operator=(const PageWriter &) = delete;

  /// Makes it the latest frame; its sequence is set here. Rows that find no room, in the slot or in the system's
  /// memory, are left out and counted.
  void publish(const Frame &frame);

  [[nodiscard]] const std::string &path() const { return path_; }

 private:
  PageWriter(std::string path, int descriptor, std::byte *memory, std::size_t slot_size);
  /// All that was written before it is there for whoever reads the word.
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
