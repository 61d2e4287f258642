// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "watch/notes.hpp"

#include <fmt/format.h>

namespace redag_rclcpp {

std::string Notes::alert() const {
  std::vector<Deadlock> lasting = deadlocks();
  std::erase_if(lasting, [](const Deadlock &deadlock) { return deadlock.ended != redag::kNever; });
  if (lasting.empty()) return "";
  const Deadlock &first = lasting.front();
  std::string text =
      fmt::format("{}: {} waits for {}, which cannot get {}", first.certain ? "deadlock" : "possible deadlock",
                  first.waiting, first.blocked, first.resource);
  if (lasting.size() > 1) text = fmt::format("{} deadlocks; {}", lasting.size(), text);
  return text;
}

}  // namespace redag_rclcpp
