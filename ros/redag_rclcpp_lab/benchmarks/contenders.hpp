// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The executors that the benchmarks compare: ReDAGExecutor in each preemption mode that this process may use, and its
// peers.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "peers.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp::lab {

struct Contender {
  std::string name;
  std::function<std::unique_ptr<rclcpp::Executor>()> make;
};

inline std::unique_ptr<rclcpp::Executor> make_redag(redag::PreemptionMode mode, std::uint32_t workers,
                                                    bool raise_middleware = true) {
  ReDAGOptions options;
  options.workers = workers;
  options.preemption = mode;
  options.raise_middleware = raise_middleware;
  return std::make_unique<ReDAGExecutor>(options);
}

/// All contenders, with this many threads or workers where they can have more than one.
inline std::vector<Contender> contenders(std::uint32_t workers = 2) {
  std::vector<Contender> all;
  for (const std::string &name : peer_names()) {
    if (check_peer(name)) all.push_back({name, [=] { return make_peer(name, workers); }});
  }
  all.push_back({"redag-none", [=] { return make_redag(redag::PreemptionMode::None, workers); }});
  all.push_back({"redag-coop", [=] { return make_redag(redag::PreemptionMode::Cooperative, workers); }});
  if (redag::runtime::probe_priority_band().top_job > 0) {
    all.push_back({"redag-os", [=] { return make_redag(redag::PreemptionMode::Os, workers); }});
  }
  return all;
}

}  // namespace redag_rclcpp::lab
