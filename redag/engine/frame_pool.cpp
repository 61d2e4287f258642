// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/frame_pool.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <new>

#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/thread_annotations.hpp"

namespace redag::runtime {
namespace {

constexpr std::size_t kLeastSize = 64;
constexpr std::size_t kMostSize = std::size_t{1} << 20U;
constexpr std::size_t kClasses = std::bit_width(kMostSize / kLeastSize);

class SizeClass {
 public:
  /// Returns null if nothing is left over.
  [[nodiscard]] void *take() {
    const LockGuard guard(lock_);
    LeftOver *const taken = first_;
    if (taken != nullptr) first_ = taken->next;
    return taken;
  }
  void give_back(void *storage) {
    const LockGuard guard(lock_);
    first_ = new (storage) LeftOver{first_};
  }

 private:
  struct LeftOver {
    LeftOver *next = nullptr;
  };
  PiMutex lock_;
  LeftOver *first_ REDAG_GUARDED_BY(lock_) = nullptr;
};

std::size_t class_of(std::size_t size) {
  return static_cast<std::size_t>(std::bit_width((std::max(size, kLeastSize) - 1) / kLeastSize));
}

// Never destroyed: an executor with static storage gives frames back when the process ends.
SizeClass &size_class(std::size_t number) {
  static auto &classes = *new std::array<SizeClass, kClasses>;
  return classes[number];
}

}  // namespace

void *take_storage(std::size_t size) {
  if (size > kMostSize) return ::operator new(size);
  const std::size_t number = class_of(size);
  if (void *const storage = size_class(number).take()) return storage;
  return ::operator new(kLeastSize << number);
}

void give_back_storage(void *storage, std::size_t size) noexcept {
  if (size > kMostSize) return ::operator delete(storage);
  size_class(class_of(size)).give_back(storage);
}

}  // namespace redag::runtime
