// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/variant.hpp"

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/base/nearest.hpp"
#include "redag/base/text.hpp"
#include "redag/loader/validate.hpp"
#include "redag_analysis/executors/executors.hpp"

namespace redag::lab {

const std::vector<std::string> &variant_names() {
  static const std::vector<std::string> kNames = [] {
    std::vector<std::string> names = {"redag", "redag-none", "redag-cooperative", "redag-os"};
    for (const char *threads : {"", "-fifo"}) {
      for (const executors::ExecutorKind &kind : executors::all()) {
        if (!kind.ours) names.push_back(std::string(kind.name) + threads);
      }
    }
    return names;
  }();
  return kNames;
}

Result<Variant> parse_variant(const std::string &name) {
  const std::vector<std::string> &names = variant_names();
  if (std::find(names.begin(), names.end(), name) == names.end()) {
    return make_error("there is no executor " + in_quotes(name), suggestion(name, names));
  }
  const std::size_t dash = name.find('-');
  Variant variant{name, name.substr(0, dash), std::nullopt, false};
  const std::string detail = dash == std::string::npos ? "" : name.substr(dash + 1);
  // rclcpp's executors cannot preempt: a callback runs to its end in every mode of the workload.
  if (!variant.is_redag()) variant.preemption = PreemptionMode::None;
  for (const PreemptionMode mode : {PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Os}) {
    if (to_string(mode) == detail) variant.preemption = mode;
  }
  variant.realtime_threads = detail == "fifo";
  return variant;
}

Result<std::vector<Variant>> parse_variants(std::string_view list) {
  std::vector<Variant> variants;
  while (true) {
    const std::size_t comma = list.find(',');
    Result<Variant> variant = parse_variant(std::string(list.substr(0, comma)));
    if (!variant) return tl::unexpected<Diagnostics>(std::move(variant.error()));
    const auto same = [&](const Variant &other) { return other.name == variant->name; };
    if (std::any_of(variants.begin(), variants.end(), same)) {
      return make_error("executor '" + variant->name + "' is listed twice");
    }
    variants.push_back(*std::move(variant));
    if (comma == std::string_view::npos) return variants;
    list.remove_prefix(comma + 1);
  }
}

Result<Workload> configure(const Workload &workload, const Variant &variant) {
  const executors::ExecutorKind *kind = executors::find_executor(variant.executor);
  REDAG_CHECK(kind != nullptr, "an executor that variant_names() lists is unknown");
  Workload configured = workload;
  if (variant.preemption) configured.platform.preemption = *variant.preemption;
  if (kind->single_worker) {
    // One instance of the executor serves each cluster.
    std::vector<Cluster> &clusters = configured.platform.clusters;
    for (Cluster &cluster : clusters) cluster.workers = 1;
    configured.platform.workers = static_cast<std::uint32_t>(std::max<std::size_t>(1, clusters.size()));
  }
  Diagnostics mistakes = validate(configured, {.waits = variant.is_redag()});
  std::erase_if(mistakes, [](const Diagnostic &mistake) { return mistake.severity != Severity::Error; });
  if (mistakes.empty()) return configured;
  for (Diagnostic &mistake : mistakes) mistake.message = variant.name + ": " + mistake.message;
  return tl::unexpected<Diagnostics>(std::move(mistakes));
}

}  // namespace redag::lab
