// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/common_order.hpp"

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/sched/policy.hpp"
#include "redag/threads/setup.hpp"

namespace redag::runtime {

CommonOrder::CommonOrder(std::span<const live::OrderStatement> statements) {
  std::vector<sched::RankedTask> ranked;
  for (const live::OrderStatement &statement : statements) {
    top_job_ = top_job_ == 0 ? statement.top_job : std::min(top_job_, statement.top_job);
    for (const Duration rate : statement.rates) {
      ranked.push_back(sched::RankedTask{.period = rate, .deadline = rate, .task = TaskId(ranked.size())});
    }
  }
  const PriorityBand band{.top_job = top_job_};
  const auto priorities = sched::assign_priorities(ranked, PolicyKind::RateMonotonic, Ties::Share, band.levels());
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    steps_.push_back(Step{ranked[i].period, band.of_level(priorities[i].level)});
  }
  std::sort(steps_.begin(), steps_.end(), [](const Step &a, const Step &b) { return a.first < b.first; });
  const auto same = [](const Step &a, const Step &b) { return a.priority == b.priority; };
  steps_.erase(std::unique(steps_.begin(), steps_.end(), same), steps_.end());
}

int CommonOrder::priority_of(Duration period) const {
  REDAG_CHECK(top_job_ > 0, "an order of no executors");
  const auto next = std::upper_bound(steps_.begin(), steps_.end(), period,
                                     [](Duration value, const Step &step) { return value < step.first; });
  if (next != steps_.begin()) return std::prev(next)->priority;
  return steps_.empty() ? top_job_ : steps_.front().priority;
}

std::optional<Duration> rate_of(PolicyKind policy, Duration period, Duration deadline) {
  switch (policy) {
    case PolicyKind::RateMonotonic: return period;
    case PolicyKind::DeadlineMonotonic: return deadline;
    case PolicyKind::Fixed:
    case PolicyKind::ChainAware:
    case PolicyKind::Edf:
    case PolicyKind::Fifo: break;
  }
  return std::nullopt;
}

void make_statable(std::vector<Duration> &rates) {
  std::sort(rates.begin(), rates.end());
  rates.erase(std::unique(rates.begin(), rates.end()), rates.end());
  const std::size_t count = rates.size();
  if (count <= live::kMostRates) return;
  for (std::size_t i = 0; i < live::kMostRates; ++i) rates[i] = rates[i * count / live::kMostRates];
  rates.resize(live::kMostRates);
}

OrderLook look_at(const live::OrderPage &own, std::span<const live::OrderPage> pages) {
  OrderLook look;
  look.must_publish = true;
  std::vector<live::OrderStatement> statements{own.statement};
  for (const live::OrderPage &page : pages) {
    if (page.name == own.name) {
      look.must_publish = page.statement != own.statement;
    } else {
      statements.push_back(page.statement);
    }
  }
  look.order = CommonOrder(statements);
  return look;
}

}  // namespace redag::runtime
