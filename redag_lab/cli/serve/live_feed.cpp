// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/serve/live_feed.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "redag/base/lock_guard.hpp"
#include "redag/threads/clock.hpp"
#include "redag_lab/cli/top/live_json.hpp"

namespace redag::cli {

LiveState::LiveState(std::vector<live::Listed> pages, Time now)
    : pages_(std::move(pages)), now_(now), documents_(pages_.size() + 1) {}

std::shared_ptr<const std::string> LiveState::document(const live::Listed *shown) {
  const std::size_t place = shown == nullptr ? pages_.size() : static_cast<std::size_t>(shown - pages_.data());
  const LockGuard guard(lock_);
  if (documents_[place] == nullptr) {
    const Json document = {{"list", to_json(pages_, now_)},
                           {"frame", shown == nullptr ? Json(nullptr) : to_json(*shown, *shown->page, now_)}};
    documents_[place] = std::make_shared<const std::string>(document.dump());
  }
  return documents_[place];
}

LiveFeed::LiveFeed(std::string folder, Duration interval, unsigned most_watchers)
    : folder_(std::move(folder)), interval_(interval), most_watchers_(most_watchers), thread_([this] { main(); }) {}

LiveFeed::~LiveFeed() {
  stop();
  thread_.join();
}

void LiveFeed::stop() {
  const LockGuard guard(lock_);
  stopped_ = true;
  changed_.notify_all();
}

void LiveFeed::main() {
  for (;;) {
    {
      const LockGuard guard(lock_);
      while (!stopped_ && watchers_ == 0) changed_.wait(lock_);
      if (stopped_) return;
    }
    auto state = std::make_shared<LiveState>(live::list_pages(folder_), runtime::monotonic_now());
    const LockGuard guard(lock_);
    state_ = std::move(state);
    ++number_;
    changed_.notify_all();
    const auto until = std::chrono::steady_clock::now() + std::chrono::nanoseconds(interval_);
    while (!stopped_ && changed_.wait_until(lock_, until) == std::cv_status::no_timeout) {
    }
  }
}

std::unique_ptr<LiveFeed::Watcher> LiveFeed::watch(std::optional<LiveTarget> target) {
  const LockGuard guard(lock_);
  if (stopped_ || watchers_ >= most_watchers_) return nullptr;
  // A state that nobody watched is old: the first watcher waits for a new one.
  auto watcher = std::make_unique<Watcher>(*this, target, watchers_ == 0 ? number_ : 0);
  ++watchers_;
  changed_.notify_all();
  return watcher;
}

LiveFeed::Watcher::~Watcher() {
  const LockGuard guard(feed_.lock_);
  --feed_.watchers_;
}

std::shared_ptr<const std::string> LiveFeed::Watcher::next() {
  std::shared_ptr<LiveState> state;
  {
    const LockGuard guard(feed_.lock_);
    while (!feed_.stopped_ && feed_.number_ <= seen_) feed_.changed_.wait(feed_.lock_);
    if (feed_.stopped_) return nullptr;
    seen_ = feed_.number_;
    state = feed_.state_;
  }
  const std::vector<live::Listed> &pages = state->pages();
  const live::Listed *shown = attachment_.find(pages);
  if (shown == nullptr && !attachment_.is_known() && !attachment_.has_target()) {
    const auto readable =
        std::find_if(pages.begin(), pages.end(), [](const auto &page) { return page.page.has_value(); });
    if (readable != pages.end()) {
      attachment_.attach(*readable);
      shown = &*readable;
    }
  }
  return state->document(shown);
}

}  // namespace redag::cli
