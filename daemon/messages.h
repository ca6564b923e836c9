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
#include "daemon/outlet.h"
#include "daemon/status.h"
#include "daemon/stream.h"
#include "protocol/channels.h"

namespace stickslip::daemon {

Message status_message(const Status& status, std::int64_t utc_us);
/// The histograms up to the longest duration that any of them has seen.
Message timing_message(const Timing& timing, std::int64_t utc_us);
/// Writes the books into a status message.
void set_ledger(const Balance& ledger, status_t& status);

Message event_message(const Event& event, std::int64_t utc_us);

/// What makes a log stand alone: configuration, model, version, start.
Message recording_info_message(const config::Rig& rig, std::int64_t started_utc_us);

/// Encodes what a stream carries and puts it into an outlet, with buffers that are used again.
/// Frames are stamped with rig time that begins at the wall clock's, so that a log of simulated
/// time plays at the rig's pace.
class MessageSink final : public Sink {
 public:
  /// `outlet` must outlive the sink.
  explicit MessageSink(Outlet& outlet) : outlet_(outlet) {}

  /// Frames, and every 0.1 s of them what was asked of the shaker during each. Done means that the
  /// frames got through.
  Put put_block(std::span<const Sample> block) override;
  Put put_estimate(const Estimate& estimate) override;
  Put put_message(const Message& message) override;
  bool settle() override;
  void finish() override { put_excitation(); }
  bool wants_to_settle() const override { return outlet_.wants_to_settle(); }

 private:
  /// What was asked of the shaker during one frame.
  struct Asked {
    std::int64_t time_ns = 0;
    std::uint64_t sequence = 0;
    double drive = 0.0;
    double amplitude = 0.0;
    double phase_rad = 0.0;
    Limit limited = Limit::none;
    bool amplifier_on = false;
  };
  template <class Type>
  Put put(const std::string& channel, const Type& message, std::int64_t time_us);
  std::int64_t time_us(std::int64_t time_ns);
  void gather(const Sample& sample);
  void put_excitation();

  Outlet& outlet_;
  // Made once: they are too long for a string without memory of its own.
  const std::string frames_channel_ = protocol::frames_channel;
  const std::string excitation_channel_ = protocol::excitation_channel;
  const std::string estimate_channel_ = protocol::estimate_channel;
  std::optional<std::int64_t> origin_us_;  // wall clock at rig time 0
  std::vector<Frame> frames_;
  std::vector<Asked> asked_;             // of the shaker, since the latest message that said so
  std::optional<std::int64_t> told_ns_;  // the latest frame of that message
  double asked_carrier_hz_ = 0.0;        // at the latest of them
  double asked_gain_ = 1.0;
  excitation_t excitation_{};
  friction_estimate_t estimate_{};
  std::vector<std::uint8_t> bytes_;
};

}  // namespace stickslip::daemon
