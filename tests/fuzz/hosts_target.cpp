// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag_lab/hosts/chains.hpp"
#include "redag_lab/hosts/hosts_yaml.hpp"
#include "redag_lab/hosts/time_service.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

namespace {

template <class Value>
void check_refusal(const Result<Value> &read) {
  if (read) return;
  REDAG_CHECK(!read.error().empty(), "a refusal says why");
  for (const Diagnostic &diagnostic : read.error()) REDAG_CHECK(!diagnostic.message.empty(), "it says something");
}

void check_clock(const hosts::ClockStatement &statement) {
  const Result<hosts::ClockOffset> clock = hosts::ClockOffset::of(statement, 0, kSecond, 100);
  check_refusal(clock);
  if (!clock) return;
  for (const Time time : {Time{0}, kSecond / 3, kSecond}) {
    const hosts::Interval bounds = clock->at(time);
    REDAG_CHECK(bounds.low <= bounds.high, "bounds of an offset contain it");
    REDAG_CHECK(std::max(bounds.high - clock->shift(), clock->shift() - bounds.low) <= clock->within(),
                "the stated error covers the run");
  }
}

}  // namespace

void hosts_target(std::string_view input) {
  const Result<hosts::HostList> list = hosts::parse_hosts(input, "fuzz.yaml");
  check_refusal(list);
  if (list) {
    for (const hosts::HostEntry &host : list->hosts) check_clock(host.clock);
  }
  const Result<hosts::TimeServiceReading> reading = hosts::parse_time_service(input, "fuzz.txt");
  check_refusal(reading);
  if (reading) {
    hosts::ClockStatement clock;
    hosts::add_reading(*reading, "fuzz.txt", clock);
    check_clock(clock);
  }
  check_refusal(hosts::parse_offset(input));
  check_refusal(hosts::parse_rate(input));
  check_refusal(hosts::parse_link(input));
}

}  // namespace redag::fuzz
