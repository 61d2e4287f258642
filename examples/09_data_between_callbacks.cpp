// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Passes data between tasks of different rates: the latest pose, under a lock that is held for a copy only, and a count
// that an ordinary thread reads. A task that waits for the lock waits for one copy. Tasks that share more than a copy
// belong into an exclusive group, which the bounds know.
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <thread>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

namespace {

struct Pose {
  double x = 0;
  double y = 0;
  std::uint64_t number = 0;
};

/// The last value that was written, for any number of threads.
template <class T>
class Shared {
 public:
  void write(const T &value) {
    const std::lock_guard guard(lock_);
    value_ = value;
  }
  [[nodiscard]] T read() const {
    const std::lock_guard guard(lock_);
    return value_;
  }

 private:
  mutable std::mutex lock_;
  T value_{};
};

}  // namespace

int main() {
  Shared<Pose> pose;
  std::atomic<std::uint64_t> plans{0};

  Executor executor;
  DagBuilder localisation("localisation");
  std::uint64_t number = 0;
  localisation.timer("ekf", 5ms, [&] { pose.write(Pose{.x = 0.1, .y = 0.2, .number = ++number}); });
  executor.add(std::move(localisation));

  DagBuilder control("control");
  std::uint64_t steered_by = 0;
  control.timer("pid", 2ms, [&] { steered_by = pose.read().number; });
  executor.add(std::move(control));

  DagBuilder planning("planning");
  planning.timer("plan", 50ms, [&, last = std::uint64_t{0}]() mutable {
    const Pose latest = pose.read();
    if (latest.number == last) return;
    last = latest.number;
    ++plans;
  });
  executor.add(std::move(planning));

  executor.start();
  std::this_thread::sleep_for(300ms);
  std::printf("%llu plans so far\n", static_cast<unsigned long long>(plans));
  executor.stop();
  std::printf("control steered by pose %llu of %llu\n", static_cast<unsigned long long>(steered_by),
              static_cast<unsigned long long>(number));
}
