// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why_cause.hpp"

namespace redag::metrics {

const char *to_string(Cause cause) {
  switch (cause) {
    case Cause::ReleaseLate: return "release_late";
    case Cause::HandOver: return "hand_over";
    case Cause::Sampling: return "sampling";
    case Cause::Unreleased: return "unreleased";
    case Cause::Predecessor: return "predecessor";
    case Cause::OwnTask: return "own_task";
    case Cause::MaxActive: return "max_active";
    case Cause::Group: return "group";
    case Cause::NoThread: return "no_thread";
    case Cause::Queued: return "queued";
    case Cause::Blocked: return "blocked";
    case Cause::Demoted: return "demoted";
    case Cause::Wakeup: return "wakeup";
    case Cause::Execution: return "execution";
    case Cause::Overrun: return "overrun";
    case Cause::Overhead: return "overhead";
    case Cause::Preempted: return "preempted";
    case Cause::DeviceQueue: return "device_queue";
    case Cause::Waited: return "waited";
    case Cause::OffProcessor: return "off_processor";
    case Cause::OnWorker: return "on_worker";
    case Cause::Threw: return "threw";
    case Cause::BudgetUsed: return "budget_used";
    case Cause::QueueFull: return "queue_full";
    case Cause::PendingFull: return "pending_full";
    case Cause::Degraded: return "degraded";
    case Cause::Removed: return "removed";
    case Cause::Unknown: return "unknown";
  }
  return "?";
}

}  // namespace redag::metrics
