// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/picture.hpp"

#include <utility>
#include <vector>

#include "redag_analysis/metrics/perfetto.hpp"

namespace redag::lab {

Result<void> draw_picture(trace::EventsReader &events, const std::string &picture,
                          const std::function<bool()> &is_stopped) {
  Result<metrics::PerfettoWriter> writer = metrics::PerfettoWriter::create(picture, events.info());
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  std::vector<JobEvent> batch;
  for (;;) {
    if (is_stopped()) return make_error("interrupted: the picture is not complete");
    const Result<bool> more = events.next(batch);
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (!*more) break;
    writer->add(batch);
  }
  return writer->commit(events.info().end);
}

}  // namespace redag::lab
