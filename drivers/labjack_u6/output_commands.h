// SPDX-License-Identifier: Apache-2.0
// The commands of a LabJack U6 to its output, while it streams.
#pragma once

#include <cstdint>

#include "config/bench.h"
#include "drivers/labjack/streaming_output.h"
#include "drivers/labjack_u6/stream_session.h"

namespace stickslip::drivers::labjack_u6 {

/// A set-point is in counts of the DAC.
class OutputCommands final : public labjack::OutputPort {
 public:
  /// `echo` numbers the commands of all users of the board. The references must outlive the object.
  OutputCommands(const config::LabjackU6& settings, StreamSession& session, std::uint8_t& echo)
      : settings_(settings), session_(session), echo_(echo) {}

  Progress progress(Slot slot, std::int64_t now_ns) override {
    return session_.progress(slot, now_ns);
  }
  bool free(Slot slot) const override { return session_.free(slot); }
  bool send_output(Slot slot, labjack::SetPoint set_point, bool on, std::int64_t now_ns) override;
  bool send_request_of_lines(std::int64_t now_ns) override;
  const char* reason(const Progress& failed) const override;

 private:
  const config::LabjackU6& settings_;
  StreamSession& session_;
  std::uint8_t& echo_;
};

/// The watchdog and the inputs of these settings.
labjack::OutputRules output_rules(const config::LabjackU6& settings);

}  // namespace stickslip::drivers::labjack_u6
