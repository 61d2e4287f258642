// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/serve/live_feed.hpp"

#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/live/reader.hpp"
#include "redag/threads/clock.hpp"
#include "redag_lab/cli/top/live_json.hpp"

namespace redag::cli {

void LiveFeed::stop() {
  const LockGuard guard(lock_);
  stopped_ = true;
  ended_.notify_all();
}

std::unique_ptr<LiveFeed::Watcher> LiveFeed::watch(std::optional<LiveTarget> target) {
  const LockGuard guard(lock_);
  if (stopped_ || watchers_ >= most_watchers_) return nullptr;
  ++watchers_;
  return std::make_unique<Watcher>(*this, target);
}

LiveFeed::Watcher::~Watcher() {
  const LockGuard guard(feed_.lock_);
  --feed_.watchers_;
}

std::optional<std::string> LiveFeed::Watcher::next() {
  {
    const LockGuard guard(feed_.lock_);
    while (!feed_.stopped_ && feed_.ended_.wait_until(feed_.lock_, due_) == std::cv_status::no_timeout) {
    }
    if (feed_.stopped_) return std::nullopt;
  }
  due_ = std::chrono::steady_clock::now() + std::chrono::nanoseconds(feed_.interval_);
  const std::vector<live::Listed> pages = live::list_pages(feed_.folder_);
  const Time now = runtime::monotonic_now();
  const live::Listed *const shown = attachment_.find(pages);
  const Json document = {{"list", to_json(pages, now)},
                         {"frame", shown == nullptr ? Json(nullptr) : to_json(*shown, *shown->page, now)}};
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace redag::cli
