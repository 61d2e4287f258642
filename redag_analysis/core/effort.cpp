// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/effort.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace redag::analysis {

thread_local Effort *Effort::current = nullptr;

void Effort::look() {
  const std::uint64_t steps = std::exchange(current->unseen_, 0);
  const double done = current->at_.done;
  for (Effort *scope = current; scope != nullptr; scope = scope->outer_) scope->count(steps, done);
}

void Effort::count(std::uint64_t steps, double done) {
  at_.steps += steps;
  at_.done = done;
  if (limits_.steps > 0 && at_.steps > limits_.steps) {
    throw GaveUp{this, fmt::format("more than {} million steps", limits_.steps / 1'000'000)};
  }
  if (!limits_.stop) return;
  if (std::string why = limits_.stop(at_); !why.empty()) throw GaveUp{this, std::move(why)};
}

void Effort::reached(std::size_t part, std::size_t whole) {
  if (current == nullptr || whole == 0) return;
  const double share = static_cast<double>(part) / static_cast<double>(whole);
  current->at_.done = share * share;
}

bool Effort::itemises(std::uint32_t unit) {
  if (current == nullptr) return true;
  const Itemised &wanted = current->limits_.itemised;
  if (wanted.which != Itemised::Which::Units) return wanted.which == Itemised::Which::All;
  return std::find(wanted.units.begin(), wanted.units.end(), unit) != wanted.units.end();
}

}  // namespace redag::analysis
