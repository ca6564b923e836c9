// SPDX-License-Identifier: Apache-2.0
// A LabJack T7 while it streams: packets arrive in a separate thread and become frames, and short
// commands are exchanged asynchronously.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <span>
#include <thread>

#include "config/bench.h"
#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"
#include "drivers/labjack/command_slot.h"
#include "drivers/labjack/frame_queue.h"
#include "drivers/labjack/lines.h"
#include "drivers/labjack/streaming_output.h"
#include "drivers/labjack_t7/board_link.h"
#include "drivers/labjack_t7/stream_decoder.h"
#include "drivers/labjack_t7/stream_plan.h"
#include "physics/frame.h"

namespace stickslip::drivers::labjack_t7 {

/// Reason for the end of a stream.
enum class StreamEnd : std::uint8_t {
  not_ended,
  disconnected,  ///< the board or the network closed a connection
  silent,        ///< no packet for a time
  garbled,       ///< bytes that are no messages of the board
  uncountable,   ///< an unknown number of scans was lost
  board_error,   ///< a packet holds an error code
};

/// Counters of a board over all its streams; for any thread. One thread writes at a time.
struct StreamCounts {
  std::atomic<std::uint64_t> packets_lost{0};
  std::atomic<std::uint64_t> overflows{0};  ///< of the board's buffer, each with its recovery
  std::atomic<std::uint64_t> scans_thrown_away{0};  ///< by the board, while its buffer was full
  std::atomic<std::uint64_t> scans_lost{0};         ///< for any reason
  std::atomic<std::uint64_t> fullest_backlog{0};    ///< highest fill level of the buffer [bytes]
};

/// Called from the loop's thread only; data shared with the receiving thread are atomic.
class StreamSession final : public labjack::OutputPort {
 public:
  /// The references must outlive the object; `link` is connected to both ports.
  StreamSession(BoardLink& link, const config::LabjackT7& settings, StreamPlan plan,
                labjack::Lines& lines, StreamCounts& counts, HostClock& clock);
  ~StreamSession() override { end(); }

  /// Starts the thread. The board streams already, or begins immediately. False on failure.
  bool begin();
  /// Ends the thread; the link can be used again.
  void end() noexcept;

  /// The next frame and the outputs as read back with it, in volts; waits for it at most that long.
  /// Does not allocate or lock.
  bool next(Frame& frame, OutputReadings& outputs, std::int64_t timeout_ns) {
    return frames_.next(frame, outputs, timeout_ns);
  }
  StreamEnd ended() const { return end_.load(std::memory_order_acquire); }
  bool has_ended() const { return ended() != StreamEnd::not_ended; }
  std::uint16_t board_error() const { return board_error_.load(std::memory_order_relaxed); }

  labjack::Progress progress(labjack::Slot slot, std::int64_t now_ns) override {
    return at(slot).progress(now_ns);
  }
  bool free(labjack::Slot slot) const override {
    return slots_[static_cast<std::size_t>(slot)].idle();
  }
  bool send_output(labjack::Slot slot, labjack::SetPoint set_point, bool on,
                   std::int64_t now_ns) override;
  bool send_request_of_lines(std::int64_t now_ns) override;
  const char* reason(const labjack::Progress& failed) const override;

 private:
  labjack::CommandSlot& at(labjack::Slot slot) { return slots_[static_cast<std::size_t>(slot)]; }
  bool send(labjack::Slot slot, Feedback& request, std::int64_t now_ns);
  void run();
  void receive_samples();
  void receive_replies();
  void take(std::span<const std::uint8_t> message);
  void dispatch(std::span<const std::uint8_t> message);
  void update_counts(const StreamPacket& packet);
  void put(const Scan& scan);
  void finish(StreamEnd reason);

  BoardLink& link_;
  const config::LabjackT7& settings_;
  StreamPlan plan_;
  StreamDecoder decoder_;
  MessageReader packets_;
  std::array<labjack::CommandSlot, labjack::slot_count> slots_;
  labjack::FrameQueue frames_;
  std::atomic<StreamEnd> end_{StreamEnd::not_ended};
  std::atomic<std::uint16_t> board_error_{0};
  labjack::Lines& lines_;
  StreamCounts& counts_;
  StreamDecoder::Counts counted_;  // of this stream, already added to counts_
  HostClock& clock_;
  std::int64_t last_packet_ns_ = 0;
  bool commands_ended_ = false;  // of the receiving thread
  std::atomic<bool> finishing_{false};
  std::thread thread_;
};

/// A voltage as the DAC takes it, limited to its range.
labjack::SetPoint set_point_of(double volts);
/// DAC at a voltage, enable line low, in this order or its reverse for "on".
void add_output(Feedback& request, const config::LabjackT7& settings, labjack::SetPoint set_point,
                bool on);
labjack::OutputRules output_rules(const config::LabjackT7& settings);

}  // namespace stickslip::drivers::labjack_t7
