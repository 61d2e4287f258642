// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "parameter_reader.hpp"

#include <fmt/format.h>

#include <cmath>

#include "rclcpp/exceptions.hpp"

namespace redag_rclcpp {

using rclcpp::ParameterType;
using rclcpp::ParameterValue;
using std::chrono::nanoseconds;

namespace {

constexpr double kMostSeconds = 1e6;  // eleven days: a larger value has the wrong unit

}  // namespace

void refuse(const char *name, const ParameterValue &value, const std::string &allowed) {
  throw rclcpp::exceptions::InvalidParameterValueException(
      fmt::format("parameter '{}' is {}, but must be {}", name, rclcpp::to_string(value), allowed));
}

ParameterValue ParameterReader::value(const ParameterSpec &spec, const ParameterValue &initial, bool read_only) {
  if (!node_.has_parameter(spec.name)) {
    rcl_interfaces::msg::ParameterDescriptor descriptor;
    descriptor.description = spec.description;
    descriptor.additional_constraints = spec.allowed;
    descriptor.read_only = read_only;
    descriptor.dynamic_typing = true;  // accepts 5 for 5.0; read functions reject other types
    node_.declare_parameter(spec.name, initial, descriptor);
  }
  return node_.get_parameter(spec.name).get_parameter_value();
}

std::int64_t ParameterReader::integer(const ParameterSpec &spec, std::int64_t initial, std::int64_t least,
                                      std::int64_t most) {
  const ParameterValue value = this->value(spec, ParameterValue(initial));
  if (value.get_type() != ParameterType::PARAMETER_INTEGER) refuse(spec.name, value, spec.allowed);
  const auto number = value.get<std::int64_t>();
  if (number < least || number > most) refuse(spec.name, value, spec.allowed);
  return number;
}

bool ParameterReader::flag(const ParameterSpec &spec, bool initial) {
  const ParameterValue value = this->value(spec, ParameterValue(initial));
  if (value.get_type() != ParameterType::PARAMETER_BOOL) refuse(spec.name, value, spec.allowed);
  return value.get<bool>();
}

std::string ParameterReader::text(const ParameterSpec &spec, const std::string &initial, bool read_only) {
  const ParameterValue value = this->value(spec, ParameterValue(initial), read_only);
  if (value.get_type() != ParameterType::PARAMETER_STRING) refuse(spec.name, value, spec.allowed);
  return value.get<std::string>();
}

nanoseconds ParameterReader::seconds(const ParameterSpec &spec, double initial, bool may_be_zero) {
  const ParameterValue value = this->value(spec, ParameterValue(initial));
  double number = 0;
  if (value.get_type() == ParameterType::PARAMETER_DOUBLE) {
    number = value.get<double>();
  } else if (value.get_type() == ParameterType::PARAMETER_INTEGER) {
    number = static_cast<double>(value.get<std::int64_t>());
  } else {
    refuse(spec.name, value, spec.allowed);
  }
  const bool fits = number == 0 ? may_be_zero : number >= 1e-9 && number <= kMostSeconds;
  if (!fits) refuse(spec.name, value, spec.allowed);
  return nanoseconds(std::llround(number * 1e9));
}

std::string ParameterReader::trace() {
  return text(
      {"trace",
       "Folder for events.redag, jobs.csv, summary.json and trace.pftrace, which are written when spinning ends; "
       "empty: none",
       "the path of a folder"},
      "");
}

bool ParameterReader::bounds() {
  return flag({"bounds", "Compare response times with their bounds; needs the execution times of all tasks in `config`",
               "true or false"},
              true);
}

}  // namespace redag_rclcpp
