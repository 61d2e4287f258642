// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/runner.hpp"

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_pipeline.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <utility>

namespace redag::experiment {
namespace {

struct Item {
  std::uint64_t unit = 0;
  Result<std::string> result;
};

// The number of units per job that may wait behind a slow unit, which delays the hand-over. Beyond it, other units wait
// too.
constexpr std::size_t kItemsPerJob = 64;

}  // namespace

NextUnit units_of(std::vector<std::uint64_t> units) {
  return [units = std::move(units), next = std::size_t{0}]() mutable -> std::optional<std::uint64_t> {
    if (next == units.size()) return std::nullopt;
    return units[next++];
  };
}

Result<std::uint64_t> run_units(const NextUnit &next, const RunnerOptions &options, const Evaluate &evaluate,
                                const Accept &accept) {
  namespace tbb = oneapi::tbb;
  const std::uint32_t jobs = std::max<std::uint32_t>(1, options.jobs);
  std::uint64_t accepted = 0;       // used by the last stage only
  Diagnostics failure;              // used by the last stage only
  std::atomic<bool> failed{false};  // tells the first stage to stop

  const auto feed = [&](tbb::flow_control &control) -> std::uint64_t {
    const bool stopped = options.stop != nullptr && options.stop->load(std::memory_order_relaxed);
    const bool ends = stopped || failed.load(std::memory_order_relaxed);
    const std::optional<std::uint64_t> unit = ends ? std::nullopt : next();
    if (!unit) control.stop();
    return unit.value_or(0);
  };
  const auto work = [&](std::uint64_t unit) { return Item{unit, evaluate(unit)}; };
  const auto hand_over = [&](Item item) {
    if (!failure.empty()) return;
    Result<void> done;
    if (item.result) {
      done = accept(item.unit, *item.result);
    } else {
      done = tl::unexpected<Diagnostics>(std::move(item.result.error()));
    }
    if (done) {
      ++accepted;
      return;
    }
    failure = std::move(done.error());
    failed.store(true, std::memory_order_relaxed);
  };

  const tbb::global_control allow(tbb::global_control::max_allowed_parallelism, jobs);
  tbb::task_arena arena(static_cast<int>(jobs));
  arena.execute([&] {
    tbb::parallel_pipeline(kItemsPerJob * jobs,
                           tbb::make_filter<void, std::uint64_t>(tbb::filter_mode::serial_in_order, feed) &
                               tbb::make_filter<std::uint64_t, Item>(tbb::filter_mode::parallel, work) &
                               tbb::make_filter<Item, void>(tbb::filter_mode::serial_in_order, hand_over));
  });
  if (!failure.empty()) return tl::unexpected<Diagnostics>(std::move(failure));
  return accepted;
}

}  // namespace redag::experiment
