// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the live pages from time to time for all watchers together, while there are any. Holds the latest state only: a
// slow watcher misses states and delays nobody.
//
// Threads: any; the feed has a thread of its own.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "redag/base/mutex.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/base/time.hpp"
#include "redag/live/reader.hpp"
#include "redag_lab/cli/top/attachment.hpp"

namespace redag::cli {

/// The pages at one moment. Documents are made once for all watchers, when the first one asks.
class LiveState {
 public:
  LiveState(std::vector<live::Listed> pages, Time now);

  [[nodiscard]] const std::vector<live::Listed> &pages() const { return pages_; }
  /// Returns the list of executors as JSON, and the frame of one of `pages` (null: none).
  [[nodiscard]] std::shared_ptr<const std::string> document(const live::Listed *shown);

 private:
  const std::vector<live::Listed> pages_;
  const Time now_;
  Mutex lock_;
  std::vector<std::shared_ptr<const std::string>> documents_
      REDAG_GUARDED_BY(lock_);  // by page, then that without a frame; null: not asked for
};

class LiveFeed {
 public:
  LiveFeed(std::string folder, Duration interval, unsigned most_watchers);
  ~LiveFeed();
  LiveFeed(const LiveFeed &) = delete;
  LiveFeed &operator=(const LiveFeed &) = delete;

  /// One who watches an executor, and its successors of the same name and program. Not thread-safe.
  class Watcher {
   public:
    /// Use LiveFeed::watch().
    Watcher(LiveFeed &feed, std::optional<LiveTarget> target, std::uint64_t seen)
        : feed_(feed), attachment_(target), seen_(seen) {}
    ~Watcher();
    Watcher(const Watcher &) = delete;
    Watcher &operator=(const Watcher &) = delete;

    /// Waits for the next state, and returns its document; null once the feed has ended.
    [[nodiscard]] std::shared_ptr<const std::string> next();

   private:
    LiveFeed &feed_;
    Attachment attachment_;
    std::uint64_t seen_;  // number of the last state
  };

  /// Returns null if there are too many watchers, or the feed has ended. Without a target, the first readable executor
  /// is watched.
  [[nodiscard]] std::unique_ptr<Watcher> watch(std::optional<LiveTarget> target);

  /// Ends the waiting of all watchers, for good.
  void stop();

 private:
  void main();

  const std::string folder_;
  const Duration interval_;
  const unsigned most_watchers_;
  Mutex lock_;
  std::condition_variable_any changed_;
  std::shared_ptr<LiveState> state_ REDAG_GUARDED_BY(lock_);
  std::uint64_t number_ REDAG_GUARDED_BY(lock_) = 0;  // of the state
  unsigned watchers_ REDAG_GUARDED_BY(lock_) = 0;
  bool stopped_ REDAG_GUARDED_BY(lock_) = false;
  std::thread thread_;
};

}  // namespace redag::cli
