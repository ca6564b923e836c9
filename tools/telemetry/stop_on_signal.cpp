// SPDX-License-Identifier: Apache-2.0
#include "tools/telemetry/stop_on_signal.h"

#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <utility>

namespace stickslip::telemetry {

StopOnSignal::StopOnSignal(const StopSignals& signals)
    : watcher_([this, &signals](const std::stop_token& ended) {
        while (!ended.stop_requested()) {
          const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(100);
          if (!stopped_before(signals, until)) continue;
          source_.request_stop();
          return;
        }
      }) {}

TypedLine typed_line(const std::stop_token& stop) {
  std::string text;
  for (;;) {
    if (stop.stop_requested()) return {TypedLine::Kind::stopped, std::move(text)};
    pollfd file{STDIN_FILENO, POLLIN, 0};
    if (::poll(&file, 1, 100) <= 0) continue;
    char next = 0;
    if (::read(STDIN_FILENO, &next, 1) <= 0) return {TypedLine::Kind::end, std::move(text)};
    if (next == '\n') return {TypedLine::Kind::line, std::move(text)};
    text += next;
  }
}

}  // namespace stickslip::telemetry
