#include "redag/runtime/realtime_share.hpp"

#include <algorithm>

namespace redag::runtime {

// Of the time that the kernel keeps from real-time threads (50 ms by default) two fifths may be used in one piece, and
// a fifth is for the timer's own work, threads of others, and wake-ups that come late.
RealtimeShare::RealtimeShare(const Throttling &throttling) : period_(throttling.period_us * kMicrosecond) {
  const Duration runtime = throttling.runtime_us * kMicrosecond;
  const Duration kept = period_ - runtime;
  const Duration room = std::min(10 * kMillisecond, kept / 5);
  burst_ = std::min({20 * kMillisecond, kept * 2 / 5, runtime / 2});
  share_ = static_cast<double>(std::max<Duration>(0, runtime - burst_ - room)) / static_cast<double>(period_);
  credit_ = burst_;
}

void RealtimeShare::set_busy(bool busy, Time now) {
  settle(now);
  busy_ = busy;
}

bool RealtimeShare::used_up(Time now) {
  settle(now);
  if (credit_ <= 0) {
    used_up_ = true;
  } else if (credit_ >= burst_ / 2) {
    used_up_ = false;
  }
  return used_up_;
}

Duration RealtimeShare::until_change() const {
  const auto needed = static_cast<double>(used_up_ ? burst_ / 2 - credit_ : credit_);
  const double rate = used_up_ ? share_ : 1.0 - share_;
  // Where nothing comes back: as long as the kernel itself looks at.
  return rate * static_cast<double>(period_) <= needed ? period_
                                                       : std::max(kMillisecond, static_cast<Duration>(needed / rate));
}

// More than a period's worth is neither saved nor owed: the kernel, too, forgets what lies further back.
void RealtimeShare::settle(Time now) {
  const Duration passed = std::max<Duration>(0, now - settled_);
  settled_ = std::max(settled_, now);
  const auto back = static_cast<Duration>(static_cast<double>(passed) * share_);
  credit_ = std::clamp(credit_ + back - (busy_ ? passed : 0), burst_ - period_, burst_);
}

}  // namespace redag::runtime
