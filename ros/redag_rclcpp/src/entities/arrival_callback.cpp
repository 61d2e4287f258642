// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "entities/arrival_callback.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace redag_rclcpp {

using redag::kNever;
using redag::runtime::Release;

namespace {

constexpr Duration kAskAgain = 10 * redag::kMillisecond;  // between releases of a skipped job that keeps its input

}  // namespace

// ---- connecting an entity ----

bool ArrivalCallback::connect() {
  if (!by_wait_set_ && is_hooked_by_user()) by_wait_set_ = true;
  if (!by_wait_set_) {
    try {
      hook();
    } catch (const std::exception &) {
      unhook();
      by_wait_set_ = true;
    }
  }
  hook_intra_process();
  return by_wait_set_;
}

void ArrivalCallback::detach() {
  std::shared_ptr<ExecutorContext> left;
  {
    const redag::LockGuard guard(lock_);
    left = leave();
    tokens_.clear();
  }
  releases_.wait();
  unhook();
}

// ---- arrivals ----

void ArrivalCallback::arrived(std::size_t count, Source source, int part, bool seen_only) {
  std::shared_ptr<ExecutorContext> to_wake;
  std::shared_ptr<ExecutorContext> to_adopt;
  std::shared_ptr<ExecutorContext> to_tell;
  Time now = 0;
  Release release;
  bool begins = false;
  std::size_t overwritten = 0;
  {
    const redag::LockGuard guard(lock_);
    if (!context()) return;  // detached: the engine may no longer exist
    now = engine().now();
    if (takes_part_) to_tell = context();
    // Messages of this process arrive on the publishing thread, within the job that is the task's predecessor.
    const redag::runtime::RunningJob *publisher = engine().current_job();
    if (learn_from_arrival(now, count, source, publisher)) to_adopt = context();
    const Time origin = origin_of(now, publisher);
    const bool direct = context()->direct();
    if (joined_) came_[index_of(source)].store(true, std::memory_order_relaxed);
    if (depth_ > 0) count = std::min(count, depth_);
    bool replaces = false;
    for (std::size_t i = 0; i < count; ++i) {
      if (depth_ > 0 && kept_[index_of(source)] >= depth_) {
        const Overwritten whose = drop_oldest(source);
        if (joined_) {
          // The scheduler has heard of the message; a later one replaces it, as later data of a predecessor does.
        } else if (whose == Overwritten::Released && direct && !replaces && releases_.none()) {
          // The released job's message is gone. Its release is replaced by one for the next message. A release that is
          // still in progress could come after the one that replaces it, and stands for the next message instead.
          replaces = true;
        } else if (whose != Overwritten::Skipped) {
          ++overwritten;
        }
        if (whose == Overwritten::Started) continue;
      }
      tokens_.push(Token{.arrival = now,
                         .origin = origin,
                         .source = source,
                         .part = part,
                         .seen_only = seen_only,
                         .sender = publisher == nullptr ? redag::JobSlot() : publisher->job.slot});
      ++kept_[index_of(source)];
    }
    if (replaces) {
      begins = true;
      begin_release_of_first(release);
    } else {
      const bool noted = noted_;
      begins = joined_ ? begin_receive(release) : begin_release(release);
      if (noted_ && !noted) to_wake = context();
      if (overwritten > 0 && !begins) releases_.begin();
    }
  }
  const bool uses_engine = begins || overwritten > 0;
  for (; overwritten > 0; --overwritten) engine().miss(task(), now, redag::Reason::QueueFull);
  if (begins) tell(release, now);
  if (uses_engine) end_release();
  if (to_wake) to_wake->wake();
  if (to_adopt) to_adopt->rate_seen();
  if (to_tell) to_tell->exchange_arrived();
}

// Removes the token of the oldest message, which the middleware has overwritten. Returns what became of its job.
ArrivalCallback::Overwritten ArrivalCallback::drop_oldest(Source source) {
  const std::size_t at = index_of(source);
  for (std::size_t *skipped : {&dropping_[at], &dropped_[at]}) {
    if (*skipped == 0) continue;
    --*skipped;
    --kept_[at];
    return Overwritten::Skipped;
  }
  for (std::size_t i = 0; i < tokens_.size(); ++i) {
    if (tokens_.at(i).source != source) continue;
    tokens_.erase(i);
    --kept_[at];
    return i == 0 && released_ > 0 ? Overwritten::Released : Overwritten::Waiting;
  }
  return Overwritten::Started;
}

// Prepares the release of the first token. True: the caller must call Engine::release() and end_release() after it has
// left lock_. Without a job of the task that is in progress, only releases_ keeps the engine, and the task's id its
// own.
bool ArrivalCallback::begin_release(Release &release) {
  if (joined_ || released_ > 0 || !context() || tokens_.empty() || !is_direct()) return false;
  begin_release_of_first(release);
  return true;
}

// As begin_release(), for the newest token of a joined callback.
bool ArrivalCallback::begin_receive(Release &message) {
  if (!context() || tokens_.empty() || !is_direct()) return false;
  const Token &newest = tokens_.at(tokens_.size() - 1);
  message = {task(), newest.arrival, newest.origin};
  releases_.begin();
  return true;
}

// False: the callback is noted, and admit() will release what has arrived.
bool ArrivalCallback::is_direct() {
  if (context()->direct()) return true;
  if (!noted_) {
    noted_ = true;
    context()->note(shared_from_this());
  }
  return false;
}

void ArrivalCallback::tell(const Release &release, Time now) {
  joined_ ? engine().receive(release, now) : engine().release(release, now);
}

void ArrivalCallback::begin_release_of_first(Release &release) {
  const Token &first = tokens_.front();
  release = {task(), first.arrival, first.origin};
  ++released_;
  releases_.begin();
}

// If the scheduler has skipped a job meanwhile, for example the released one at once, this releases the next token.
void ArrivalCallback::end_release() {
  while (releases_.end()) {
    Release release;
    {
      const redag::LockGuard guard(lock_);
      if (!begin_release(release)) return;
    }
    engine().release(release, engine().now());
  }
}

void ArrivalCallback::admit() {
  Release release;
  {
    const redag::LockGuard guard(lock_);
    noted_ = false;
    if (!context() || released_ > 0 || tokens_.empty()) return;
    if (joined_) {
      const Token &newest = tokens_.at(tokens_.size() - 1);
      release = {task(), newest.arrival, newest.origin};
      releases_.begin();
    } else {
      begin_release_of_first(release);
    }
  }
  tell(release, engine().now());
  end_release();
}

Time ArrivalCallback::expire(Time now, std::vector<Release> &releases, std::vector<Release> &) {
  releases.push_back(Release{task(), now});  // repeats a release after a skip
  return kNever;
}

void ArrivalCallback::skipped(redag::Reason reason) noexcept {
  Release release;
  {
    const redag::LockGuard guard(lock_);
    // The messages of a joined callback's skipped job stay until its next job takes a later one.
    if (!context() || joined_) return;
    // Reason::Overrun means that arrived() has replaced this job. The token now belongs to the new job.
    if (released_ == 1 && reason != redag::Reason::Overrun && !tokens_.empty()) {
      const Token &token = tokens_.front();
      if (token.seen_only || !drops_skipped()) {
        // The token stays released; the timer queue repeats its release.
        if (context()->timers().schedule(*this, engine().now() + kAskAgain)) context()->timers_changed();
        return;
      }
      ++dropped_[index_of(token.source)];
      tokens_.pop();
    }
    --released_;
    // A thread in end_release(), perhaps this one further up its stack, releases the next token. The depth of calls is
    // thus limited.
    if (releases_.tell() || !begin_release(release)) return;
  }
  engine().release(release, engine().now());
  end_release();
}

bool ArrivalCallback::take_token(Token &token) {
  Release next;
  bool begins = false;
  {
    const redag::LockGuard guard(lock_);
    if (released_ > 0) --released_;
    if (tokens_.empty()) return false;
    token = tokens_.pop();
    const std::size_t at = index_of(token.source);
    dropping_[at] += std::exchange(dropped_[at], 0);
    token.after_skipped = dropping_[at] > 0;
    begins = begin_release(next);
  }
  if (begins) {
    engine().release(next, engine().now());
    end_release();
  }
  return true;
}

// The newest token that had come when the job was released; with `or_later`, else the first one after it. Passes over
// the older ones of its source, which hands out its messages in their order.
bool ArrivalCallback::take_newest(Time release, bool or_later, Token &token) {
  const redag::LockGuard guard(lock_);
  if (tokens_.empty() || (tokens_.front().arrival > release && !or_later)) return false;
  std::size_t newest = 0;
  while (newest + 1 < tokens_.size() && tokens_.at(newest + 1).arrival <= release) ++newest;
  token = tokens_.at(newest);
  tokens_.erase(newest);
  for (std::size_t i = newest; i-- > 0;) {
    if (tokens_.at(i).source == token.source) pass_over(i);
  }
  const std::size_t at = index_of(token.source);
  dropping_[at] += std::exchange(dropped_[at], 0);
  token.after_skipped = dropping_[at] > 0;
  return true;
}

// The message of that token will be dropped before the next one of its source is taken.
void ArrivalCallback::pass_over(std::size_t position) {
  ++dropped_[index_of(tokens_.at(position).source)];
  tokens_.erase(position);
}

// A job of a joined callback.
bool ArrivalCallback::run_newest(Time release) {
  Token token;
  bool or_later = true;  // the message of the release may have been overwritten
  do {
    if (!take_newest(release, std::exchange(or_later, false), token)) return false;
  } while (!execute_token(token));
  if (came_[0] && came_[1]) {  // older messages of the other source are copies, or too old
    const redag::LockGuard guard(lock_);
    while (!tokens_.empty() && tokens_.front().arrival < token.arrival) pass_over(0);
  }
  return true;
}

// Among equal rates the oldest data goes first: a chain of callbacks that began earlier ends earlier. Data that came to
// this callback before, or is older than the callback's deadline, counts as new. Otherwise callbacks that publish to
// each other in a circle would go first for ever.
Time ArrivalCallback::origin_of(Time now, const redag::runtime::RunningJob *publisher) {
  Time origin = now;
  const bool is_young = publisher != nullptr && now - publisher->job.origin <= deadline();
  if (is_young && publisher->job.origin != last_origin_) {
    origin = publisher->job.origin;
  }
  last_origin_ = origin;
  return origin;
}

// Returns true if the rate is now known better than it was: the third arrival tells it, twice as many tell it better.
bool ArrivalCallback::learn_from_arrival(Time now, std::size_t count, Source source,
                                         const redag::runtime::RunningJob *publisher) {
  const Duration learning_time = context()->learning_time();
  if (learning_time == 0 || has_learned_) return false;
  if (arrivals_[0] + arrivals_[1] == 0) first_arrival_ = now;
  last_arrival_ = now;
  arrivals_[index_of(source)] += count;
  if (publisher != nullptr &&
      std::find(publishers_.begin(), publishers_.end(), publisher->job.task) == publishers_.end()) {
    publishers_.push_back(publisher->job.task);
  }
  has_learned_ = now - first_arrival_ >= learning_time;
  const std::uint64_t arrivals = arrivals_[0] + arrivals_[1];
  if (!has_learned_ && arrivals < tells_at_) return false;
  tells_at_ = 2 * arrivals;
  return true;
}

bool ArrivalCallback::has_learned() const {
  const redag::LockGuard guard(lock_);
  return has_learned_;
}

std::vector<TaskId> ArrivalCallback::publishers() const {
  const redag::LockGuard guard(lock_);
  return publishers_;
}

std::vector<KeptInput> ArrivalCallback::kept() const {
  constexpr std::size_t kMost = 64;  // the oldest are of interest
  std::vector<KeptInput> kept;
  const redag::LockGuard guard(lock_);
  for (std::size_t i = 0; i < std::min(tokens_.size(), kMost); ++i) {
    kept.push_back({.arrived = tokens_.at(i).arrival, .sender = tokens_.at(i).sender});
  }
  return kept;
}

std::optional<Time> ArrivalCallback::waits_since() const {
  const redag::LockGuard guard(lock_);
  for (std::size_t i = 0; joined_ && i < tokens_.size(); ++i) {
    const Token &token = tokens_.at(i);
    if (token.source == Source::IntraProcess || !came_[index_of(Source::IntraProcess)]) return token.arrival;
  }
  return std::nullopt;
}

Duration ArrivalCallback::mean_interval() const {
  const redag::LockGuard guard(lock_);
  // If another process subscribes as well, the middleware brings each message of this process a second time, and rclcpp
  // does not take it. The measured share of taken messages is assumed to hold for overwritten messages, too.
  auto arrivals = static_cast<double>(arrivals_[index_of(Source::Middleware)]);
  const auto taken = static_cast<double>(taken_.load(std::memory_order_relaxed));
  const auto takes = static_cast<double>(takes_.load(std::memory_order_relaxed));
  if (takes > 0) arrivals *= std::min(taken / takes, 1.0);
  arrivals += static_cast<double>(arrivals_[index_of(Source::IntraProcess)]);
  const auto handled = static_cast<Duration>(std::llround(arrivals));
  if (handled < 3) return 0;
  return (last_arrival_ - first_arrival_) / (handled - 1);
}

// ---- the wait set ----

WaitSetMember::Held ArrivalCallback::watched() const {
  {
    const redag::LockGuard guard(lock_);
    if (!by_wait_set_ || seen_ || !context()) return {};
  }
  return {.entity = entity()};
}

WaitSetMember::Held ArrivalCallback::hooked() const { return by_wait_set_ ? Held{} : Held{.entity = entity()}; }

void ArrivalCallback::seen_by_wait_set() {
  {
    const redag::LockGuard guard(lock_);
    seen_ = true;
  }
  arrived(1, Source::Middleware, 0, true);
}

void ArrivalCallback::take_leftovers(const Held &held, rcl_wait_set_t &set, bool any) {
  if (any && is_ready(held, set)) release_leftovers(Source::Middleware);
}

void ArrivalCallback::release_leftovers(Source source) {
  {
    const redag::LockGuard guard(lock_);
    leftovers_[index_of(source)] = true;
    if (kept_[index_of(source)] > 0) return;
  }
  arrived(1, source, 0);
}

// ---- jobs ----

ArrivalCallback::Taking::~Taking() {
  if (begun_) return;
  begin();
  callback_.leftovers_[index_of(source_)] = true;  // the message may still be there
}

void ArrivalCallback::Taking::begin() {
  begun_ = true;
  --callback_.kept_[index_of(source_)];
}

void ArrivalCallback::Taking::count(bool taken) {
  callback_.takes_.fetch_add(1, std::memory_order_relaxed);
  if (taken) callback_.taken_.fetch_add(1, std::memory_order_relaxed);
}

bool ArrivalCallback::run(Time release) {
  if (joined_) return run_newest(release);
  Token token;
  return take_token(token) && execute_token(token);
}

bool ArrivalCallback::execute_token(const Token &token) {
  // Tells the wait set that its arrival was handled, also if an exception leaves this function.
  struct Watch {
    ~Watch() {
      if (!token.seen_only) return;
      std::shared_ptr<ExecutorContext> context;
      {
        const redag::LockGuard guard(self.lock_);
        self.seen_ = false;
        context = self.context();
      }
      if (context) context->wait_set_changed();
    }
    ArrivalCallback &self;
    const Token &token;
  } watch{*this, token};

  Taking taking(*this, token.source);
  if (token.after_skipped) drop_skipped(token.source);
  const bool taken = handle(token, taking);
  bool more = false;
  std::shared_ptr<ExecutorContext> to_look;
  // This job has lowered kept_ and now reads leftovers_. release_leftovers() sets leftovers_ and then reads kept_. At
  // least one of them sees what the other wrote.
  if (leftovers_[index_of(token.source)]) {
    const redag::LockGuard guard(lock_);
    std::atomic<bool> &leftovers = leftovers_[index_of(token.source)];
    leftovers = leftovers && taken;
    more = leftovers && kept_[index_of(token.source)] == 0;
    if (more && joined_) {
      // A token without a message would wait for the next round, and then cost the message that comes in it.
      more = false;
      leftovers = false;
      to_look = context();
    }
  }
  if (more) arrived(1, token.source, 0);
  if (to_look) to_look->look_for_leftovers(shared_from_this());
  return taken;
}

// ---- messages of skipped jobs ----

// Counts one message as dropped. False: none remains to be dropped; some may have been overwritten meanwhile.
bool ArrivalCallback::begin_drop(Source source) {
  const redag::LockGuard guard(lock_);
  if (dropping_[index_of(source)] == 0) return false;
  --dropping_[index_of(source)];
  --kept_[index_of(source)];
  return true;
}

// The source has no more messages: those that remain to be dropped are gone as well.
void ArrivalCallback::forget_dropped(Source source) {
  const redag::LockGuard guard(lock_);
  kept_[index_of(source)] -= std::exchange(dropping_[index_of(source)], 0);
}

}  // namespace redag_rclcpp
