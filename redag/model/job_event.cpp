// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/model/job_event.hpp"

namespace redag {

const char *to_string(JobEventKind kind) {
  switch (kind) {
    case JobEventKind::Released: return "released";
    case JobEventKind::Ready: return "ready";
    case JobEventKind::Deferred: return "deferred";
    case JobEventKind::Dispatched: return "dispatched";
    case JobEventKind::Started: return "started";
    case JobEventKind::Preempted: return "preempted";
    case JobEventKind::Resumed: return "resumed";
    case JobEventKind::Finished: return "finished";
    case JobEventKind::Skipped: return "skipped";
    case JobEventKind::Aborted: return "aborted";
    case JobEventKind::Exceeded: return "exceeded";
    case JobEventKind::HighMode: return "high_mode";
    case JobEventKind::LowMode: return "low_mode";
    case JobEventKind::Executed: return "executed";
    case JobEventKind::Waits: return "waits";
    case JobEventKind::Served: return "served";
    case JobEventKind::Woken: return "woken";
  }
  return "?";
}

const char *to_string(Reason reason) {
  switch (reason) {
    case Reason::None: return "none";
    case Reason::Overrun: return "overrun";
    case Reason::Precedence: return "precedence";
    case Reason::QueueFull: return "queue_full";
    case Reason::DagFull: return "dag_full";
    case Reason::Removed: return "removed";
    case Reason::Exception: return "exception";
    case Reason::Budget: return "budget";
    case Reason::NoData: return "no_data";
    case Reason::Degraded: return "degraded";
  }
  return "?";
}

}  // namespace redag
