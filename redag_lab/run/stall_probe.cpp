// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/stall_probe.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "redag/base/int128.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"

namespace redag::lab {
namespace {

constexpr Duration kBurst = 40 * kMillisecond;
constexpr Duration kPause = 10 * kMillisecond;
constexpr std::size_t kMostGaps = std::size_t{1} << 17U;

class Watcher {
 public:
  Watcher(int cpu, const StallOptions &options) : options_(options) {
    result_.cpu = cpu;
    result_.gaps.resize(kMostGaps);  // touches the pages before the measurement
  }

  Result<void> start() {
    return runtime::start_thread({"redag-stalls", options_.fifo_priority, {result_.cpu}}, [this] { main(); })
        .map([this](runtime::ThreadHandle &&thread) { thread_ = std::move(thread); });
  }
  void join() {
    if (thread_.joinable()) thread_.join();
  }

  WatchedProcessor take() {
    result_.gaps.resize(count_);
    return std::move(result_);
  }

 private:
  [[nodiscard]] bool stopped() const { return options_.stop != nullptr && options_.stop->load(); }

  void main() {
    const Time end = runtime::monotonic_now() + options_.duration;
    runtime::Event never;
    for (Time now = runtime::monotonic_now(); now < end && !stopped(); now = runtime::monotonic_now()) {
      watch(std::min(now + kBurst, end));
      // Ordinary threads pause as well, and other threads that want to run do so during the pause.
      never.wait_until(runtime::monotonic_now() + kPause);
    }
  }

  void watch(Time until) {
    Duration cpu = runtime::thread_cpu_now();
    Time read_at = runtime::monotonic_now();
    const Time begun = read_at;
    Time last = read_at;
    for (Time now = runtime::monotonic_now(); now < until && count_ < kMostGaps;
         last = now, now = runtime::monotonic_now()) {
      const Duration length = now - last;
      if (length < kShortestGap) continue;
      const Duration used = runtime::thread_cpu_now();
      const Duration uncharged = (now - read_at) - (used - cpu);
      result_.gaps[count_++] =
          Gap{result_.watched + now - begun, length, std::clamp<Duration>(length - uncharged, 0, length)};
      cpu = used;
      read_at = now = runtime::monotonic_now();
    }
    result_.watched += last - begun;
  }

  const StallOptions &options_;
  WatchedProcessor result_;
  std::size_t count_ = 0;
  runtime::ThreadHandle thread_;
};

}  // namespace

Result<std::vector<WatchedProcessor>> watch_for_stalls(const StallOptions &options) {
  std::vector<std::unique_ptr<Watcher>> watchers;
  Result<void> started;
  for (const int cpu : runtime::usable_cpus()) {
    watchers.push_back(std::make_unique<Watcher>(cpu, options));
    started = watchers.back()->start();
    if (!started) break;
  }
  std::vector<WatchedProcessor> watched;
  for (auto &watcher : watchers) {
    watcher->join();
    watched.push_back(watcher->take());
  }
  if (!started) return tl::unexpected(started.error());
  return watched;
}

Loss fit_loss(std::span<const LossSample> samples, Duration watched) {
  Loss loss;
  if (samples.empty() || watched <= 0) return loss;
  Int128 sum = 0;
  for (const LossSample &sample : samples) sum += sample.length;
  // A processor that is lost most of the time guarantees nothing. The rate is capped just below one, and a bound then
  // reports the failure.
  const Int128 twice = (2 * sum * kSecond + watched - 1) / watched;
  loss.per_second = static_cast<Duration>(std::min<Int128>(twice, kSecond - kMillisecond));
  Duration level = 0;
  Duration at = 0;
  for (const LossSample &sample : samples) {
    const Int128 leaked = Int128{sample.at - at} * loss.per_second / kSecond;
    level = std::max<Duration>(0, level - static_cast<Duration>(leaked)) + sample.length;
    loss.longest = std::max(loss.longest, level);
    at = sample.at;
  }
  return loss;
}

}  // namespace redag::lab
