// SPDX-License-Identifier: Apache-2.0
// The daemon's data as LCM messages, on the channels and in the types of protocol/.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stickslip/excitation_t.hpp>
#include <stickslip/friction_estimate_t.hpp>
#include <stickslip/status_t.hpp>
#include <string>
#include <vector>

#include "config/rig.h"
#include "daemon/event.h"
#include "daemon/message_writer.h"
#include "daemon/status.h"
#include "daemon/stream.h"
#include "protocol/channels.h"

namespace stickslip::daemon {

Message status_message(const Status& status, std::int64_t utc_us);
/// The histograms, up to the longest duration that any of them counted.
Message timing_message(const Timing& timing, std::int64_t utc_us);
/// Of a daemon that records: `status.recording` is present.
Message recorder_message(const Status& status, std::int64_t utc_us);
/// Enters the ledger into a status message.
void set_ledger(const Balance& ledger, status_t& status);

Message event_message(const Event& event, std::int64_t utc_us);

/// Makes a log self-contained: configuration, model, version, start.
Message recording_info_message(const config::Rig& rig, std::int64_t started_utc_us);

/// Encodes the contents of a stream and passes them to a writer, with buffers that are reused.
/// Frames are stamped with rig time counted from the wall clock at the first frame, so that a log
/// of simulated time plays at the rig's pace.
class MessageSink final : public Sink {
 public:
  /// `writer` must outlive the sink.
  explicit MessageSink(MessageWriter& writer) : writer_(writer) {}

  /// Frames, and every 0.1 s of them the drive during each. The result is that of the frames.
  WriteResult write_block(std::span<const Sample> block) override;
  WriteResult write_estimate(const Estimate& estimate) override;
  WriteResult write_message(const Message& message) override;
  bool flush() override;
  void finish() override { write_excitation(); }
  bool wants_flush() const override { return writer_.wants_flush(); }

 private:
  /// Drive during one frame.
  struct DriveRecord {
    std::int64_t time_ns = 0;
    std::uint64_t sequence = 0;
    double drive = 0.0;
    double amplitude = 0.0;
    double phase_rad = 0.0;
    Limit limited = Limit::none;
    bool amplifier_on = false;
  };
  template <class Type>
  WriteResult write(const std::string& channel, const Type& message, std::int64_t time_us);
  std::int64_t time_us(std::int64_t time_ns);
  void record_drive(const Sample& sample);
  void write_excitation();

  MessageWriter& writer_;
  // Constructed once: too long for the small-string optimisation.
  const std::string frames_channel_ = protocol::frames_channel;
  const std::string excitation_channel_ = protocol::excitation_channel;
  const std::string estimate_channel_ = protocol::estimate_channel;
  std::optional<std::int64_t> origin_us_;  // wall clock at rig time 0
  std::vector<Frame> frames_;
  std::vector<DriveRecord> drive_records_;               // since the latest excitation message
  std::optional<std::int64_t> excitation_published_ns_;  // time of that message
  double carrier_hz_ = 0.0;                              // at the latest record
  double gain_ = 1.0;
  excitation_t excitation_{};
  friction_estimate_t estimate_{};
  std::vector<std::uint8_t> bytes_;
};

}  // namespace stickslip::daemon
