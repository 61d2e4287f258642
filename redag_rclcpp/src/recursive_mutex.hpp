// std::recursive_mutex that clang's -Wthread-safety understands.
#pragma once

#include <mutex>

#include "redag/base/thread_annotations.hpp"

namespace redag_rclcpp {

class REDAG_CAPABILITY("mutex") RecursiveMutex {
 public:
  void lock() REDAG_ACQUIRE() { mutex_.lock(); }
  void unlock() REDAG_RELEASE() { mutex_.unlock(); }
  /// Tells the analysis, where it cannot see the caller, that the caller has the mutex.
  void assert_held() const REDAG_ASSERT_CAPABILITY(this) {}

 private:
  std::recursive_mutex mutex_;
};

}  // namespace redag_rclcpp
