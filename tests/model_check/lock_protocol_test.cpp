// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores every interleaving of threads that take a FutexLock. Of the inheriting kind, the kernel has the protocol.
#include "protocol.hpp"
#include "redag/base/futex_lock.hpp"

namespace redag::model_check {
namespace {

using explored::spawn;

// Three threads are explored without spurious wake-ups, and two with one of them.
TEST(LockProtocol, OneThreadHasTheLockAndNoneSleepsForEver) {
  for (const std::uint32_t spurious : {0U, 1U}) {
    expect_holds(
        [spurious] {
          FutexLock lock(false);
          Room room(1);
          const auto visit = [&] {
            lock.lock();
            room.enter();
            room.leave();
            lock.unlock();
          };
          std::vector<std::uint32_t> others{spawn(visit)};
          if (spurious == 0) others.push_back(spawn(visit));
          visit();
          for (const std::uint32_t other : others) explored::join(other);
          explored::check(lock.try_lock(), "the lock is not free in the end");
        },
        ExploreOptions{true, 50'000'000, spurious, false});
  }
}

TEST(LockProtocol, ALockThatIsTakenIsRefused) {
  expect_holds([] {
    FutexLock lock(false);
    Room room(1);
    const std::uint32_t a = spawn([&] {
      if (!lock.try_lock()) return;
      room.enter();
      room.leave();
      lock.unlock();
    });
    lock.lock();
    room.enter();
    room.leave();
    lock.unlock();
    explored::join(a);
  });
}

}  // namespace
}  // namespace redag::model_check
