// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "entities/action_names.hpp"

#include <cxxabi.h>
#include <rcl/wait.h>

#include <cstdlib>
#include <memory>
#include <typeinfo>

#include "compat.hpp"
#include "entities/wait_set_member.hpp"

namespace redag_rclcpp {

std::string action_name_of(rclcpp::Waitable &waitable, rclcpp::Context &context) {
  WaitSetSizes sizes;
  sizes.add(waitable);
  rcl_wait_set_t set = rcl_get_zero_initialized_wait_set();
  check_rcl(
      rcl_wait_set_init(&set, sizes.subscriptions, sizes.guard_conditions, sizes.timers, sizes.clients, sizes.services,
                        sizes.events, context.get_rcl_context().get(), rcl_get_default_allocator()),
      "cannot create a wait set");
  const std::unique_ptr<rcl_wait_set_t, void (*)(rcl_wait_set_t *)> owner(&set, [](rcl_wait_set_t *finished) {
    if (rcl_wait_set_fini(finished) != RCL_RET_OK) rcl_reset_error();
  });
  compat::add_to_wait_set(waitable, set);
  // Each is NAME/_action/PART.
  std::string part;
  if (set.size_of_services > 0) part = rcl_service_get_service_name(set.services[0]);
  if (set.size_of_clients > 0) part = rcl_client_get_service_name(set.clients[0]);
  return part.substr(0, part.rfind("/_action/"));
}

std::string action_type_of(const rclcpp::Waitable &waitable) {
  const char *const mangled = typeid(waitable).name();
  int status = 0;
  const std::unique_ptr<char, void (*)(void *)> name(abi::__cxa_demangle(mangled, nullptr, nullptr, &status),
                                                     std::free);
  const std::string type = status == 0 ? name.get() : mangled;
  const std::size_t begin = type.find('<');
  const std::size_t end = type.rfind('>');
  return begin < end && end != std::string::npos ? type.substr(begin + 1, end - begin - 1) : type;
}

}  // namespace redag_rclcpp
