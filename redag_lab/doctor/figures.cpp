// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/doctor/figures.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>

#include "redag/base/check.hpp"
#include "redag/base/int128.hpp"

namespace redag::doctor {

Loss fit_loss(std::span<const LossSample> samples, Duration watched) {
  Loss loss;
  if (samples.empty() || watched <= 0) return loss;
  Int128 sum = 0;
  for (const LossSample &sample : samples) sum += sample.length;
  // A processor that is lost most of the time guarantees nothing. The rate is capped just below one, and a bound then
  // reports the failure.
  const Int128 twice = (2 * sum * kSecond + watched - 1) / watched;
  loss.per_second = static_cast<Duration>(std::min<Int128>(twice, kSecond - kMillisecond));
  Duration level = 0;
  Duration at = 0;
  for (const LossSample &sample : samples) {
    const Int128 leaked = Int128{sample.at - at} * loss.per_second / kSecond;
    level = std::max<Duration>(0, level - static_cast<Duration>(leaked)) + sample.length;
    loss.longest = std::max(loss.longest, level);
    at = sample.at;
  }
  return loss;
}

Duration usual_delay(std::span<const LossSample> delays, Duration watched, Loss &beyond) {
  REDAG_CHECK(!delays.empty(), "the usual one of no delays");
  std::vector<Duration> lengths;
  lengths.reserve(delays.size());
  for (const LossSample &delay : delays) lengths.push_back(delay.length);
  std::sort(lengths.begin(), lengths.end());
  const Duration usual = lengths[std::min(lengths.size() - 1, lengths.size() * 99 / 100)];
  std::vector<LossSample> excess;
  for (const LossSample &delay : delays) {
    if (delay.length > usual) excess.push_back({delay.at + delay.length, delay.length - usual});
  }
  beyond = fit_loss(excess, watched);
  return usual;
}

void take_larger(Loss &loss, const Loss &other) {
  loss.longest = std::max(loss.longest, other.longest);
  loss.per_second = std::max(loss.per_second, other.per_second);
}

TraceFigures figures_of(const Workload &workload, std::span<const JobEvent> events,
                        const std::vector<std::vector<Absence>> &absences) {
  TraceFigures figures;
  const std::vector<TaskRef> refs = flatten(workload);
  std::vector<std::size_t> next(refs.size());                // index into the task's absences; earlier ones have passed
  std::vector<std::optional<Time>> dispatched(refs.size());  // the tasks have `concurrency` 1: one job each
  for (const JobEvent &event : events) {
    const std::size_t t = event.task.value;
    REDAG_CHECK(t < refs.size(), "an event of another workload");
    switch (event.kind) {
      case JobEventKind::Released:
        if (refs[t].task->activation == Activation::Timer) figures.lateness.push_back(event.time - event.value);
        break;
      case JobEventKind::Dispatched: dispatched[t] = event.time; break;
      case JobEventKind::Started:
        if (dispatched[t]) {
          figures.dispatch.push_back({*dispatched[t], std::max<Duration>(0, event.value - *dispatched[t])});
        }
        dispatched[t].reset();
        break;
      case JobEventKind::Resumed: {
        const std::vector<Absence> &own = absences[t];
        while (next[t] < own.size() && own[next[t]].end < event.time) ++next[t];
        if (next[t] == own.size() || own[next[t]].begin > event.time) break;  // the job had not stopped
        figures.preempt.push_back({event.time, own[next[t]].end - event.time});
        break;
      }
      default: break;
    }
  }
  const auto earlier = [](const LossSample &x, const LossSample &y) { return x.at < y.at; };
  std::sort(figures.dispatch.begin(), figures.dispatch.end(), earlier);
  return figures;
}

}  // namespace redag::doctor
