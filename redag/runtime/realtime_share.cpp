// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/realtime_share.hpp"

#include <algorithm>

namespace redag::runtime {

// The kernel keeps some time from real-time threads (50 ms by default). Up to two fifths of it can be used in one
// piece. One fifth is for the timer's own work, other programs' threads, and late wake-ups.
RealtimeShare::RealtimeShare(const Throttling &throttling, std::size_t processors)
    : period_(throttling.period_us * kMicrosecond) {
  const Duration runtime = throttling.runtime_us * kMicrosecond;
  const Duration kept = period_ - runtime;
  const Duration room = std::min(10 * kMillisecond, kept / 5);
  burst_ = std::min({20 * kMillisecond, kept * 2 / 5, runtime / 2});
  share_ = static_cast<double>(std::max<Duration>(0, runtime - burst_ - room)) / static_cast<double>(period_);
  accounts_.resize(std::max<std::size_t>(processors, 1), Account{burst_, false, false});
}

void RealtimeShare::ran_everywhere() {
  for (Account &account : accounts_) account.busy = true;
}

void RealtimeShare::set_busy(const std::vector<bool> &busy, Time now) {
  settle(now);
  for (std::size_t i = 0; i < accounts_.size(); ++i) accounts_[i].busy = busy[i];
}

void RealtimeShare::set_busy(bool busy, Time now) {
  settle(now);
  for (Account &account : accounts_) account.busy = busy;
}

bool RealtimeShare::used_up(Time now) {
  settle(now);
  used_up_ = false;
  for (Account &account : accounts_) {
    if (account.credit <= 0) {
      account.used_up = true;
    } else if (account.credit >= burst_ / 2) {
      account.used_up = false;
    }
    used_up_ = used_up_ || account.used_up;
  }
  return used_up_;
}

Duration RealtimeShare::until_change() const {
  Duration first = kNever;
  Duration last = 0;
  for (const Account &account : accounts_) {
    if (account.used_up) last = std::max(last, time_for(burst_ / 2 - account.credit, share_));
    first = std::min(first, time_for(account.credit, 1.0 - share_));
  }
  return used_up_ ? last : first;
}

// Returns the time in which `credit` changes at `rate`: at least 1 ms, at most one period of the kernel.
Duration RealtimeShare::time_for(Duration credit, double rate) const {
  const auto needed = static_cast<double>(credit);
  return rate * static_cast<double>(period_) <= needed ? period_
                                                       : std::max(kMillisecond, static_cast<Duration>(needed / rate));
}

// Updates all credits to `now`. A debt is at most about one period's worth, because the kernel, too, forgets earlier
// use.
void RealtimeShare::settle(Time now) {
  const Duration passed = std::max<Duration>(0, now - settled_);
  settled_ = std::max(settled_, now);
  const auto back = static_cast<Duration>(static_cast<double>(passed) * share_);
  for (Account &account : accounts_) {
    account.credit = std::clamp(account.credit + back - (account.busy ? passed : 0), burst_ - period_, burst_);
  }
}

}  // namespace redag::runtime
