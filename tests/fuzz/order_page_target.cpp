// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <vector>

#include "redag/base/check.hpp"
#include "redag/live/order_page.hpp"
#include "redag/threads/common_order.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void order_page_target(std::string_view input) {
  const auto statement = live::parse_order(input);
  if (!statement) return;
  REDAG_CHECK(live::parse_order(live::format_order(*statement)) == statement, "it survives being written");
  const runtime::CommonOrder order(std::vector{*statement});
  int last = statement->top_job;
  for (const Duration rate : statement->rates) {
    const int priority = order.priority_of(rate);
    REDAG_CHECK(priority >= 1 && priority <= last, "priorities do not increase with the period");
    last = priority;
  }
}

}  // namespace redag::fuzz
