// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the browsers of `redag serve` get from time to time: the latest state of the live pages. A slow watcher misses
// states and delays nobody.
//
// Threads: any.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <optional>
#include <string>

#include "redag/base/mutex.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/base/time.hpp"
#include "redag_lab/cli/top/attachment.hpp"

namespace redag::cli {

class LiveFeed {
 public:
  LiveFeed(std::string folder, Duration interval, unsigned most_watchers)
      : folder_(std::move(folder)), interval_(interval), most_watchers_(most_watchers) {}

  /// One who watches an executor, and its successors of the same name and program. Not thread-safe.
  class Watcher {
   public:
    /// Use LiveFeed::watch().
    Watcher(LiveFeed &feed, std::optional<LiveTarget> target) : feed_(feed), attachment_(target) {}
    ~Watcher();
    Watcher(const Watcher &) = delete;
    Watcher &operator=(const Watcher &) = delete;

    /// Waits for an interval, except at first. Returns the list of executors and the frame of the watched one (null:
    /// there is none) as JSON; nothing once the feed has ended.
    [[nodiscard]] std::optional<std::string> next();

   private:
    LiveFeed &feed_;
    Attachment attachment_;
    std::chrono::steady_clock::time_point due_ = {};
  };

  /// Returns null if there are too many watchers, or the feed has ended. Without a target, the first readable executor
  /// is watched.
  [[nodiscard]] std::unique_ptr<Watcher> watch(std::optional<LiveTarget> target);

  /// Ends the waiting of all watchers, for good.
  void stop();

 private:
  const std::string folder_;
  const Duration interval_;
  const unsigned most_watchers_;
  Mutex lock_;
  std::condition_variable_any ended_;
  unsigned watchers_ REDAG_GUARDED_BY(lock_) = 0;
  bool stopped_ REDAG_GUARDED_BY(lock_) = false;
};

}  // namespace redag::cli
