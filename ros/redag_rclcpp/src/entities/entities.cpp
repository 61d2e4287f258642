// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "entities/entities.hpp"

#include <set>

#include "compat.hpp"

namespace redag_rclcpp {

void find_entities(const rclcpp::CallbackGroup::SharedPtr &group, std::vector<Entity> &found) {
  std::vector<Entity> all;
  std::set<const void *> parts;
  const auto add = [&](const auto &entity) {
    all.push_back(entity_of(entity));
    all.back().group = group;
    if (all.back().part != nullptr) parts.insert(all.back().part);
  };
  const auto add_waitable = [&](const rclcpp::Waitable::SharedPtr &waitable) {
    add(waitable);
    for (const auto &timer : compat::timers_of(*waitable)) {
      all.push_back(entity_of(waitable, timer));
      all.back().group = group;
    }
  };
  group->collect_all_ptrs(add, add, add, add, add_waitable);
  for (Entity &entity : all) {
    if (parts.count(entity.key) == 0) found.push_back(std::move(entity));
  }
}

}  // namespace redag_rclcpp
