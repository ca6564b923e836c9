// SPDX-License-Identifier: Apache-2.0
// A LabJack U6 while it streams: samples arrive in a separate thread and become frames, and short
// commands are exchanged asynchronously.
#pragma once

#include <libusb-1.0/libusb.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "drivers/driver.h"
#include "drivers/labjack/command_slot.h"
#include "drivers/labjack/frame_queue.h"
#include "drivers/labjack/lines.h"
#include "drivers/labjack_u6/board_link.h"
#include "drivers/labjack_u6/protocol.h"
#include "drivers/labjack_u6/stream_decoder.h"
#include "drivers/labjack_u6/stream_plan.h"
#include "drivers/usb/usb_events.h"
#include "physics/frame.h"

namespace stickslip::drivers::labjack_u6 {

/// Reason for the end of a stream.
enum class StreamEnd : std::uint8_t {
  not_ended,
  unplugged,
  usb_error,    ///< stalled, or the bus failed
  uncountable,  ///< an unknown number of scans was lost
  board_error,  ///< a packet holds an error code
};

/// A command that the board has not accepted by then is withdrawn.
inline constexpr unsigned send_timeout_ms = 100;

using labjack::Lines;
using labjack::Progress;
using labjack::Slot;
using labjack::slot_count;

/// Counters of a board over all its streams; for any thread. One thread writes at a time.
struct StreamCounts {
  std::atomic<std::uint64_t> packets_lost{0};
  std::atomic<std::uint64_t> packets_damaged{0};
  std::atomic<std::uint64_t> overflows{0};  ///< of the board's buffer, each with its recovery
  std::atomic<std::uint64_t> scans_thrown_away{0};  ///< by the board, while its buffer was full
  std::atomic<std::uint64_t> scans_lost{0};         ///< for any reason
  std::atomic<std::uint8_t> fullest_backlog{0};     ///< highest fill level of the buffer, of 256
};

/// Called from the loop's thread only; data shared with the event thread are atomic.
class StreamSession {
 public:
  StreamSession(libusb_context* context, libusb_device_handle* handle, StreamPlan plan,
                Lines& lines, StreamCounts& counts);
  ~StreamSession() = default;
  StreamSession(const StreamSession&) = delete;
  StreamSession& operator=(const StreamSession&) = delete;

  /// Submits the transfers and starts the thread. The board streams already, or begins immediately.
  /// False on failure; no transfer is then in flight, unless end() returns false.
  bool begin();
  /// Cancels all transfers and waits for their return. False: the kernel kept some, and this object
  /// must not be destroyed.
  bool end() noexcept;

  /// The next frame and the outputs as read back with it, in volts; waits for it at most that long.
  /// Does not allocate or lock.
  bool next(Frame& frame, OutputReadings& outputs, std::int64_t timeout_ns) {
    return frames_.next(frame, outputs, timeout_ns);
  }
  bool has_ended() const { return ended() != StreamEnd::not_ended; }
  StreamEnd ended() const { return end_.load(std::memory_order_acquire); }
  std::uint8_t board_error() const { return board_error_.load(std::memory_order_relaxed); }

  Progress progress(Slot slot, std::int64_t now_ns) { return at(slot).slot.progress(now_ns); }
  /// True if no command of that slot is in progress.
  bool free(Slot slot) const;
  /// Only where free(). A Feedback carries `echo` and reads the lines. False: it was not sent.
  bool send(Slot slot, const Command& command, std::uint8_t echo, std::int64_t now_ns);

 private:
  struct FreeTransfer {
    void operator()(libusb_transfer* transfer) const noexcept { libusb_free_transfer(transfer); }
  };
  using Transfer = std::unique_ptr<libusb_transfer, FreeTransfer>;
  struct Incoming {
    Transfer transfer;
    std::vector<std::uint8_t> bytes;
  };
  struct Outgoing {
    StreamSession* session = nullptr;
    Transfer transfer;
    Command command;
    labjack::CommandSlot slot;
    std::atomic<bool> leaving{false};  // its buffer is in use by the kernel
  };

  static void LIBUSB_CALL samples_received(libusb_transfer* transfer);
  static void LIBUSB_CALL reply_received(libusb_transfer* transfer);
  static void LIBUSB_CALL command_sent(libusb_transfer* transfer);

  bool allocate();
  bool submit(libusb_transfer* transfer);
  void run();
  void reap() noexcept;
  void finish(StreamEnd reason);
  bool usable(libusb_transfer_status status);
  void decode(std::span<const std::uint8_t> bytes);
  void update_counts();
  void put(const Scan& scan);
  void dispatch(std::span<const std::uint8_t> reply);
  void settle(Outgoing& outgoing, const Verdict& verdict);
  void settle_all(const Verdict& verdict);
  Outgoing& at(Slot slot) { return outgoing_[static_cast<std::size_t>(slot)]; }
  const Outgoing& at(Slot slot) const { return outgoing_[static_cast<std::size_t>(slot)]; }

  libusb_context* context_;
  libusb_device_handle* handle_;
  StreamPlan plan_;
  StreamDecoder decoder_;
  std::vector<Incoming> stream_;
  std::vector<Incoming> replies_;
  std::array<Outgoing, slot_count> outgoing_;
  labjack::FrameQueue frames_;
  std::atomic<StreamEnd> end_{StreamEnd::not_ended};
  std::atomic<std::uint8_t> board_error_{0};
  Lines& lines_;
  StreamCounts& counts_;
  StreamDecoder::Counts counted_;  // of this stream, already added to counts_
  std::atomic<int> in_flight_{0};
  std::atomic<bool> finishing_{false};
  UsbEvents events_;
  std::thread thread_;
};

}  // namespace stickslip::drivers::labjack_u6
