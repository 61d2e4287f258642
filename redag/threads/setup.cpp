// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/live/owned_file.hpp"
#include "redag/threads/common_order.hpp"
#include "redag/threads/threads.hpp"

namespace redag::runtime {
namespace {

// From the top: 9 priorities for the kernel's own threads (migration, watchdog, raised interrupt threads), then one for
// the release timer. Below it is room for the user's own urgent threads above the jobs.
constexpr int kUserRoom = 9;
constexpr std::uint32_t kSpareThreads = 16;

/// Says why the executor cannot share its order with others; empty: it can.
std::string obstacle_to_sharing(const Mode &mode, PolicyKind policy) {
  if (mode.mode != PreemptionMode::Os) return fmt::format("the preemption is {} and not os", to_string(mode.mode));
  if (!rate_of(policy, 1, 1)) return fmt::format("policy {} does not order by periods", to_string(policy));
  return {};
}

}  // namespace

PriorityBand band_up_to(int limit) {
  const int timer = std::min(limit, kHighestPriority);
  if (timer < 2) return {};  // needs at least one for the timer and one for jobs
  return PriorityBand{timer > 4 * kUserRoom ? timer - kUserRoom - 1 : timer - 1, timer};
}

int PriorityBand::of_releases() const {
  const int most_urgent = of_level(0);
  return most_urgent < band_up_to(timer).top_job ? most_urgent + 1 : timer;
}

PriorityBand probe_priority_band() { return band_up_to(available_fifo_priority(kHighestPriority)); }

Result<std::string> order_folder(bool wanted, const char *value) {
  const std::string text = value == nullptr ? "" : value;
  if (text == "1" || (text.empty() && wanted)) return std::string(live::kFolder);
  if (text == "0" || text.empty()) return std::string();
  if (text.front() == '/') return text;
  return make_error(fmt::format("{} is {}", kShareOrderVariable, in_quotes(text)),
                    "use 1, 0, or the absolute path of a folder that the processes share");
}

Result<Mode> resolve_mode(PreemptionMode wanted, PolicyKind policy, const PriorityBand &band) {
  std::string obstacle;
  if (!is_static(policy)) {
    obstacle = fmt::format("policy {} gives priorities to jobs, but the kernel schedules threads", to_string(policy));
  } else if (band.top_job == 0) {
    obstacle = "this process may not use SCHED_FIFO";
  }
  switch (wanted) {
    case PreemptionMode::None:
    case PreemptionMode::Cooperative: return Mode{wanted, {}};
    case PreemptionMode::Os:
      if (obstacle.empty()) return Mode{wanted, {}};
      return make_error("preemption 'os' is not available: " + obstacle,
                        is_static(policy) ? realtime_hint() : "use a static policy, or preemption 'cooperative'");
    case PreemptionMode::Auto: break;
  }
  if (obstacle.empty()) return Mode{PreemptionMode::Os, "auto: this process may use SCHED_FIFO"};
  return Mode{PreemptionMode::Cooperative, "auto: " + obstacle};
}

sched::Config make_config(const Mode &mode, std::uint32_t workers, PolicyKind policy, const PriorityBand &band,
                          std::uint32_t threads) {
  sched::Config config;
  config.workers = workers;
  config.policy = policy;
  config.preemption = sched::preemption_of(mode.mode);
  if (mode.mode == PreemptionMode::Os) {
    config.levels = band.levels();
    config.max_started = threads;
  }
  return config;
}

int Setup::timer_priority() const {
  if (mode.mode == PreemptionMode::Os) return band.timer;
  return fifo_priority_above_this_thread();
}

int Setup::top_job_priority() const {
  if (mode.mode == PreemptionMode::Os) return band.top_job;
  return std::max(0, timer_priority() - 1);
}

Result<Setup> set_up(const SetupRequest &request) {
  Setup setup;
  setup.band = probe_priority_band();
  Result<Mode> mode = resolve_mode(request.preemption, request.policy, setup.band);
  if (!mode) return tl::unexpected(mode.error());
  setup.mode = *std::move(mode);
  Result<std::string> folder = order_folder(request.share_order, std::getenv(kShareOrderVariable));
  if (!folder) return tl::unexpected(folder.error());
  if (!folder->empty()) {
    const std::string obstacle = obstacle_to_sharing(setup.mode, request.policy);
    if (obstacle.empty()) {
      setup.order_folder = *std::move(folder);
      setup.band.shared = true;
    } else {
      setup.warnings.push_back(fmt::format("no order is shared with other processes, because {}", obstacle));
    }
  }
  const std::size_t processors = request.cpus.empty() ? usable_cpus().size() : request.cpus.size();
  const std::uint32_t workers = request.workers == 0 ? static_cast<std::uint32_t>(processors) : request.workers;
  const std::uint32_t threads = std::max(request.threads == 0 ? workers + kSpareThreads : request.threads, workers);
  setup.config = make_config(setup.mode, workers, request.policy, setup.band, threads);
  setup.config.ties = request.ties;
  if (setup.mode.mode != PreemptionMode::Os && request.threads > workers)
    setup.spare_threads = request.threads - workers;
  setup.missing_processors = missing_processors(workers, processors);
  if (!setup.missing_processors.empty()) setup.warnings.push_back(setup.missing_processors);
  const bool os = setup.mode.mode == PreemptionMode::Os;
  if (const auto throttling = os ? realtime_throttling() : std::nullopt) {
    setup.warnings.push_back(
        fmt::format("real-time throttling is on: SCHED_FIFO threads get at most {} of every {} us of a busy processor "
                    "('redag doctor' says what that means)",
                    throttling->runtime_us, throttling->period_us));
  }
  return setup;
}

std::string missing_processors(std::uint32_t workers, std::size_t cpus) {
  if (workers <= cpus) return "";
  return fmt::format("{} workers share {} processor(s), so jobs that run together slow each other down", workers, cpus);
}

}  // namespace redag::runtime
