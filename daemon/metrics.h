// SPDX-License-Identifier: Apache-2.0
// Status for Prometheus: a text file for node_exporter's textfile collector, so that monitoring
// needs no open port.
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

/// Replaces `file` atomically. Readable by everyone, since node_exporter runs as another user; not
/// synced to the disk. Returns the error; empty: written. Not for the real-time thread.
[[nodiscard]] std::string write_metrics(const std::filesystem::path& file, const std::string& text);

}  // namespace stickslip::daemon
