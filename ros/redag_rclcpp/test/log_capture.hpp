// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Collects the log messages of its lifetime, one object at a time. Create it after rclcpp::init(), which also sets what
// receives messages. Any thread may log meanwhile.
#pragma once

#include <rcutils/logging.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <string>
#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"

namespace redag_rclcpp {

class LogCapture {
 public:
  LogCapture() : before_(rcutils_logging_get_output_handler()) {
    {
      const redag::LockGuard guard(kept().lock);
      kept().messages.clear();
    }
    rcutils_logging_set_output_handler(&keep);
  }
  ~LogCapture() { rcutils_logging_set_output_handler(before_); }
  LogCapture(const LogCapture &) = delete;
  LogCapture &operator=(const LogCapture &) = delete;

  [[nodiscard]] static bool has(const std::string &text) { return count(text, RCUTILS_LOG_SEVERITY_DEBUG) > 0; }
  /// Warnings and errors with this text.
  [[nodiscard]] static int warnings_with(const std::string &text) { return count(text, RCUTILS_LOG_SEVERITY_WARN); }

 private:
  struct Message {
    int severity = 0;
    std::string text;
  };
  struct Kept {
    redag::PiMutex lock;
    std::vector<Message> messages REDAG_GUARDED_BY(lock);
  };
  static Kept &kept() {
    static Kept kept;
    return kept;
  }
  static int count(const std::string &text, int least_severity) {
    const redag::LockGuard guard(kept().lock);
    return static_cast<int>(std::count_if(kept().messages.begin(), kept().messages.end(), [&](const Message &message) {
      return message.severity >= least_severity && message.text.find(text) != std::string::npos;
    }));
  }
  static void keep(const rcutils_log_location_t *, int severity, const char *, rcutils_time_point_value_t,
                   const char *format, va_list *arguments) {
    char text[2048];
    va_list copy;
    va_copy(copy, *arguments);
    std::vsnprintf(text, sizeof text, format, copy);
    va_end(copy);
    const redag::LockGuard guard(kept().lock);
    kept().messages.push_back({severity, text});
  }

  rcutils_logging_output_handler_t before_;
};

}  // namespace redag_rclcpp
