// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/input.hpp"

#include <filesystem>
#include <iterator>
#include <utility>

#include "redag/model/text_file.hpp"
#include "redag/model/workload_yaml_node.hpp"
#include "redag/runtime/setup.hpp"
#include "redag_lab/robot/assigned_order.hpp"
#include "redag_lab/robot/union.hpp"

namespace redag::robot {
namespace {

Result<Input> input_of(Result<LoadedWorkload> loaded) {
  if (!loaded) return tl::unexpected<Diagnostics>(std::move(loaded.error()));
  return Input{std::nullopt, {}, std::move(loaded)};
}

// Returns nothing for text that is no robot: YAML that cannot be read, too.
std::optional<Result<Input>> parse_robot(std::string_view text, const std::string &file, LoadOptions options) {
  if (text.size() > kMaxWorkloadBytes || text.find("robot") == std::string_view::npos) return std::nullopt;
  const Result<yaml::Node> root = yaml::parse(text, file);
  if (!root || !is_robot(*root)) return std::nullopt;
  options.waits = false;  // a union has no devices
  Result<LoadedRobot> loaded = read_robot(*root, file, options);
  if (!loaded) return tl::unexpected<Diagnostics>(std::move(loaded.error()));
  if (loaded->robot.by_bounds) {
    Result<OrderSearch> search = search_order(loaded->robot);
    if (!search) {
      return Input{std::move(loaded->robot), std::move(loaded->warnings),
                   tl::unexpected<Diagnostics>(std::move(search.error()))};
    }
    loaded->robot.assigned = std::move(search->order);
    loaded->warnings.insert(loaded->warnings.end(), search->warnings.begin(), search->warnings.end());
  }
  Result<LoadedWorkload> workload =
      union_of(loaded->robot, runtime::band_up_to(runtime::kHighestPriority).levels(), options);
  return Input{std::move(loaded->robot), std::move(loaded->warnings), std::move(workload)};
}

}  // namespace

Result<Input> load_input(const std::string &path, LoadOptions options) {
  const Result<std::string> text = read_text_file(path, "a workload file", kMaxWorkloadBytes);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  if (std::optional<Result<Input>> robot = parse_robot(*text, path, options)) return *std::move(robot);
  Result<LoadedWorkload> loaded = parse_workload(*text, path, options);
  if (loaded) name_after(path, loaded->workload);
  return input_of(std::move(loaded));
}

Result<Input> parse_input(std::string_view text, const std::string &file, LoadOptions options) {
  if (std::optional<Result<Input>> robot = parse_robot(text, file, options)) return *std::move(robot);
  return input_of(parse_workload(text, file, options));
}

Result<LoadedWorkload> as_workload(Input input) {
  if (!input.workload) {
    Diagnostics all = std::move(input.warnings);
    all.insert(all.end(), input.workload.error().begin(), input.workload.error().end());
    return tl::unexpected<Diagnostics>(std::move(all));
  }
  Diagnostics &found = input.workload->warnings;
  found.insert(found.begin(), std::make_move_iterator(input.warnings.begin()),
               std::make_move_iterator(input.warnings.end()));
  return std::move(input.workload);
}

}  // namespace redag::robot
