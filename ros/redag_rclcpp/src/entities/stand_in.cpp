// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "entities/stand_in.hpp"

#include <utility>

#include "entities/callback.hpp"

namespace redag_rclcpp {

void StandIn::look_for(const void *client) {
  auto found = std::dynamic_pointer_cast<ActionClientCallback>(waiting_.in_own_group(client));
  if (found == replaced_) return;
  leave();
  if (!found) return;
  found->begin_stand_in(event_);
  replaced_ = std::move(found);
}

void StandIn::leave() {
  if (const auto left = std::exchange(replaced_, nullptr)) left->end_stand_in();
}

}  // namespace redag_rclcpp
