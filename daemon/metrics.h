// The status for Prometheus: a text file that node_exporter's textfile collector reads, so that a
// lab's monitoring sees the rig without a port being opened.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "daemon/status.h"

namespace stickslip::daemon {

/// The status in Prometheus' text format 0.0.4: base units (seconds, frames), every metric with
/// HELP and TYPE, counters named *_total, each sample labelled with the rig's name. `utc_us`: the
/// wall clock, us since 1970.
std::string metrics_text(const Status& status, std::string_view rig, std::int64_t utc_us);

/// Replaces `file` by `text` in one step: a reader sees the whole old file or the whole new one.
/// Everyone may read it, since node_exporter runs as another user; it is not forced to the disk.
/// Returns why it could not; empty: it is written. Opens, writes and renames: not for the loop.
[[nodiscard]] std::string write_metrics(const std::filesystem::path& file, const std::string& text);

}  // namespace stickslip::daemon
