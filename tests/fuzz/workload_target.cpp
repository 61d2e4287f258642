// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <string>

#include "redag/base/check.hpp"
#include "redag/loader/callback_match.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/loader/workload_yaml_edit.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {
namespace {

// An accepted workload must be free of errors, and writing it must lose nothing.
void load(std::string_view input, LoadOptions options) {
  const Result<LoadedWorkload> loaded = parse_workload(input, "fuzz.yaml", options);
  if (!loaded) {
    REDAG_CHECK(!loaded.error().empty(), "a refusal says why");
    for (const Diagnostic &diagnostic : loaded.error()) {
      REDAG_CHECK(!diagnostic.message.empty(), "a diagnostic says something");
      (void)diagnostic.to_string();
    }
    return;
  }
  const Workload &workload = loaded->workload;
  REDAG_CHECK(!has_errors(validate(workload, options)), "what is accepted has no mistakes");
  const std::string text = to_yaml(workload);
  const Result<LoadedWorkload> again = parse_workload(text, "again.yaml", options);
  REDAG_CHECK(again.has_value(), "what was written can be read");
  REDAG_CHECK(again->workload == workload, "what was written is read as it was");
  REDAG_CHECK(edit_yaml(input, workload, options) == input, "an unchanged file stays as it is");
  Workload changed = workload;
  changed.policy = PolicyKind::Fixed;
  for (Dag &dag : changed.dags) {
    dag.max_active = dag.max_active == 0 ? 3 : 0;
    for (Task &task : dag.tasks) task.priority = 7;
  }
  const Result<LoadedWorkload> edited = parse_workload(edit_yaml(input, changed, options), "edited.yaml", options);
  REDAG_CHECK(edited.has_value() && edited->workload == changed, "an edited file states what it has to");
  CallbackMatcher matcher(workload);
  for (const TaskRef &ref : flatten(workload)) {
    if (!ref.task->callback) continue;
    const Callback &callback = *ref.task->callback;
    (void)matcher.find(CallbackId{callback.kind, callback.node, callback.name, callback.period, 0});
    (void)matcher.find(CallbackId{callback.kind, callback.node + "x", "/other", callback.period, 1});
  }
  (void)matcher.unmatched();
}

}  // namespace

void workload_target(std::string_view input) {
  load(input, {});
  load(input, {.wcet_optional = true});
  load(input, {.waits = true});
}

}  // namespace redag::fuzz
