// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "action_type.hpp"

#include <cxxabi.h>

#include <cstdlib>
#include <memory>
#include <typeinfo>

namespace redag_rclcpp {

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
