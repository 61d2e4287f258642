// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ParameterReader declares and reads the ROS parameters of the executor and of its monitor. For one thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "rclcpp/node.hpp"
#include "rclcpp/parameter_value.hpp"

namespace redag_rclcpp {

struct ParameterSpec {
  const char *name;
  const char *description;
  std::string allowed;
};

/// Throws rclcpp::exceptions::InvalidParameterValueException, whose text names all three.
[[noreturn]] void refuse(const char *name, const rclcpp::ParameterValue &value, const std::string &allowed);

/// Checks types and values itself, to give one message for both mistakes.
class ParameterReader {
 public:
  explicit ParameterReader(rclcpp::Node &node) : node_(node) {}

  rclcpp::ParameterValue value(const ParameterSpec &spec, const rclcpp::ParameterValue &initial, bool read_only = true);
  std::int64_t integer(const ParameterSpec &spec, std::int64_t initial, std::int64_t least, std::int64_t most);
  bool flag(const ParameterSpec &spec, bool initial);
  std::string text(const ParameterSpec &spec, const std::string &initial, bool read_only = true);
  std::chrono::nanoseconds seconds(const ParameterSpec &spec, double initial, bool may_be_zero);
  /// The first value is the default.
  template <class Values>
  typename Values::value_type one_of(const ParameterSpec &spec, const Values &values) {
    const rclcpp::ParameterValue value =
        this->value(spec, rclcpp::ParameterValue(std::string(to_string(values.front()))));
    if (value.get_type() == rclcpp::ParameterType::PARAMETER_STRING) {
      for (const auto candidate : values) {
        if (value.get<std::string>() == to_string(candidate)) return candidate;
      }
    }
    refuse(spec.name, value, spec.allowed);
  }

  // Parameters of both.

  /// The folder for results; "": none.
  std::string trace();
  /// True if response times are to be compared with their bounds.
  bool bounds();

 private:
  rclcpp::Node &node_;
};

}  // namespace redag_rclcpp
