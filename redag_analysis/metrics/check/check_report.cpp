// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/check/check_report.hpp"

#include <algorithm>
#include <array>

namespace redag::metrics {

bool follows_from_rates(Rule rule) {
  constexpr std::array kRules{Rule::Grid,     Rule::Admission, Rule::Deadline, Rule::Preemption,
                              Rule::Priority, Rule::Deferral,  Rule::Start,    Rule::Device};
  return std::find(kRules.begin(), kRules.end(), rule) != kRules.end();
}

const char *to_string(Rule rule) {
  switch (rule) {
    case Rule::Stream: return "stream";
    case Rule::Life: return "life";
    case Rule::Conservation: return "conservation";
    case Rule::Grid: return "grid";
    case Rule::Precedence: return "precedence";
    case Rule::Admission: return "admission";
    case Rule::Deadline: return "deadline";
    case Rule::TaskOverlap: return "task_overlap";
    case Rule::MaxActive: return "max_active";
    case Rule::Group: return "group";
    case Rule::Worker: return "worker";
    case Rule::Preemption: return "preemption";
    case Rule::Priority: return "priority";
    case Rule::WorkConservation: return "work_conservation";
    case Rule::Deferral: return "deferral";
    case Rule::Budget: return "budget";
    case Rule::Execution: return "execution";
    case Rule::Start: return "start";
    case Rule::Device: return "device";
  }
  return "?";
}

RuleSet RuleSet::all() { return {}; }

RuleSet RuleSet::rclcpp() {
  return all()
      .without(Rule::Priority)
      .without(Rule::WorkConservation)
      .without(Rule::Deferral)
      .without(Rule::Budget)
      .without(Rule::Preemption)
      .without(Rule::MaxActive);
}

RuleSet RuleSet::without(Rule rule) const {
  RuleSet rest = *this;
  rest.bits_ &= ~(1U << static_cast<unsigned>(rule));
  return rest;
}

std::string Violation::to_string() const {
  std::string line = format_duration(time) + " ";
  if (!job.empty()) line += job + ": ";
  return line + redag::metrics::to_string(rule) + ": " + text + " (event " + std::to_string(event) + ")";
}

std::string CheckReport::to_string(std::size_t at_most) const {
  std::string text;
  const std::size_t shown = std::min(at_most, violations.size());
  for (std::size_t i = 0; i < shown; ++i) text += violations[i].to_string() + "\n";
  if (violation_count > shown) text += "and " + std::to_string(violation_count - shown) + " more\n";
  return text;
}

}  // namespace redag::metrics
