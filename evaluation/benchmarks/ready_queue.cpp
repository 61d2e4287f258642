// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares the ready queue with common alternatives. Each thread takes the most urgent of 1000 items and inserts it
// again at another of 64 levels. Ordered queues: ours (by levels, and the heap for dynamic policies),
// std::priority_queue and tbb::concurrent_priority_queue. moodycamel and boost::lockfree do not order and do less; they
// are a reference. Our queue needs no lock within one thread. The runtime holds it under a PiMutex.
#include <benchmark/benchmark.h>
#if __has_include(<concurrentqueue/moodycamel/concurrentqueue.h>)
#include <concurrentqueue/moodycamel/concurrentqueue.h>
#else
#include <concurrentqueue/concurrentqueue.h>  // Debian 12
#endif
#include <oneapi/tbb/concurrent_priority_queue.h>

#include <array>
#include <boost/lockfree/queue.hpp>
#include <memory>
#include <mutex>
#include <queue>
#include <vector>

#include "redag/base/pi_mutex.hpp"
#include "redag/derived/rng.hpp"
#include "redag/sched/ready_queue.hpp"

namespace {

using redag::sched::Job;

constexpr std::uint32_t kItems = 1000;
constexpr std::uint32_t kLevels = 64;

struct NoLock {
  void lock() {}
  void unlock() {}
};

struct Item {
  std::uint32_t level = 0;
  std::uint32_t id = 0;
};
struct LessUrgent {
  bool operator()(const Item &a, const Item &b) const { return a.level > b.level; }
};

/// Wraps LevelQueue or HeapQueue, as the scheduler uses them, with a lock.
template <class Queue, class Lock>
class Ours {
 public:
  bool take(Item &item) {
    const std::lock_guard guard(lock_);
    const std::uint32_t slot = queue_.top();
    if (slot == redag::sched::kNil) return false;
    queue_.remove(jobs_, slot);
    item = {static_cast<std::uint32_t>(jobs_[slot].key), slot};
    return true;
  }
  void insert(const Item &item) {
    const std::lock_guard guard(lock_);
    jobs_[item.id].key = item.level;
    jobs_[item.id].rank = item.level;
    jobs_[item.id].sequence = ++sequence_;
    if constexpr (std::is_same_v<Queue, redag::sched::LevelQueue>) {
      queue_.push(jobs_, item.id, item.level);
    } else {
      queue_.push(jobs_, item.id);
    }
  }

 private:
  static Queue make() {
    if constexpr (std::is_same_v<Queue, redag::sched::LevelQueue>)
      return Queue(kLevels);
    else
      return Queue();
  }
  Lock lock_;
  std::vector<Job> jobs_ = std::vector<Job>(kItems);
  std::uint64_t sequence_ = 0;
  Queue queue_ = make();
};

template <class Lock>
class Standard {
 public:
  bool take(Item &item) {
    const std::lock_guard guard(lock_);
    if (queue_.empty()) return false;
    item = queue_.top();
    queue_.pop();
    return true;
  }
  void insert(const Item &item) {
    const std::lock_guard guard(lock_);
    queue_.push(item);
  }

 private:
  Lock lock_;
  std::priority_queue<Item, std::vector<Item>, LessUrgent> queue_;
};

class Tbb {
 public:
  bool take(Item &item) { return queue_.try_pop(item); }
  void insert(const Item &item) { queue_.push(item); }

 private:
  tbb::concurrent_priority_queue<Item, LessUrgent> queue_;
};

class Moodycamel {
 public:
  bool take(Item &item) { return queue_.try_dequeue(item); }
  void insert(const Item &item) { queue_.enqueue(item); }

 private:
  moodycamel::ConcurrentQueue<Item> queue_{2 * kItems};
};

class Boost {
 public:
  bool take(Item &item) { return queue_.pop(item); }
  void insert(const Item &item) { queue_.push(item); }

 private:
  boost::lockfree::queue<Item> queue_{2 * kItems};
};

template <class Queue>
void take_and_insert(benchmark::State &state) {
  static std::unique_ptr<Queue> queue;
  if (state.thread_index() == 0) {
    queue = std::make_unique<Queue>();
    redag::Rng fill(1);
    for (std::uint32_t i = 0; i < kItems; ++i) {
      queue->insert({static_cast<std::uint32_t>(fill.uniform(0, kLevels - 1)), i});
    }
  }
  redag::Rng rng(static_cast<std::uint64_t>(state.thread_index()) + 2);
  std::array<std::uint32_t, 4096> levels{};
  for (auto &level : levels) level = static_cast<std::uint32_t>(rng.uniform(0, kLevels - 1));
  std::size_t next = 0;
  std::int64_t pairs = 0;
  for (auto _ : state) {
    Item item;
    if (!queue->take(item)) continue;
    item.level = levels[next++ & 4095U];
    queue->insert(item);
    ++pairs;
  }
  state.SetItemsProcessed(pairs);
}

using redag::PiMutex;
using redag::sched::HeapQueue;
using redag::sched::LevelQueue;

BENCHMARK(take_and_insert<Ours<LevelQueue, NoLock>>)->Name("levels, one thread");
BENCHMARK(take_and_insert<Ours<HeapQueue, NoLock>>)->Name("heap, one thread");
BENCHMARK(take_and_insert<Standard<NoLock>>)->Name("std::priority_queue, one thread");
#define THREADED(type, name) BENCHMARK(take_and_insert<type>)->Name(name)->ThreadRange(1, 16)->UseRealTime()
using LevelsLocked = Ours<LevelQueue, PiMutex>;
using HeapLocked = Ours<HeapQueue, PiMutex>;
THREADED(LevelsLocked, "levels + PiMutex");
THREADED(HeapLocked, "heap + PiMutex");
THREADED(Standard<std::mutex>, "std::priority_queue + mutex");
THREADED(Tbb, "tbb::concurrent_priority_queue");
THREADED(Moodycamel, "moodycamel (unordered)");
THREADED(Boost, "boost::lockfree (unordered)");

}  // namespace
