// SPDX-License-Identifier: Apache-2.0
// A USB-1208FS-Plus in operation: a thread converts its scans to frames and refills its output.
#pragma once

#include <libusb-1.0/libusb.h>
#include <readerwriterqueue/readerwriterqueue.h>
#include <semaphore.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <thread>
#include <vector>

#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"
#include "drivers/usb/usb_events.h"
#include "drivers/usb_1208fs_plus/numbering.h"
#include "drivers/usb_1208fs_plus/protocol.h"
#include "drivers/usb_1208fs_plus/session.h"
#include "physics/frame.h"

namespace stickslip::drivers::usb_1208fs_plus {

/// Bounded queues without allocation or lock connect the board's thread with the loop: frames to
/// the loop, output values to the board. Each has one producer and one consumer.
class Board {
 public:
  static constexpr std::size_t frame_capacity = 4096;
  static constexpr std::size_t value_capacity = 4096;

  /// `clock`, `overruns` and `underruns` must outlive the board.
  Board(Session session, const ScanPlan& plan, const Calibration& calibration, int output,
        double output_ahead_s, double rest_v, HostClock& clock,
        std::atomic<std::uint64_t>& overruns, std::atomic<std::uint64_t>& underruns);
  /// Not allowed while has_stuck_transfers().
  ~Board();
  Board(const Board&) = delete;
  Board& operator=(const Board&) = delete;

  /// Sets the inputs and starts the thread. Negative: libusb's error.
  int start();
  void stop();
  bool running() const { return thread_.joinable(); }
  bool lost() const { return gone() || has_stuck_transfers(); }
  /// The kernel did not return transfers: it may still write into their memory, so this object must
  /// not be destroyed.
  bool has_stuck_transfers() const { return stuck_.load(std::memory_order_relaxed); }
  void release() const { session_.release(); }
  /// After stop: true if the board has accepted the rest voltage, or is disconnected and so has no
  /// power.
  bool at_rest() const { return gone() || resting_at_ == rest_.load(std::memory_order_relaxed); }

  // For the loop's thread.

  /// The next frame and the outputs as read back with it; waits at most 20 ms. Neither allocates
  /// nor locks.
  bool next(Frame& frame, OutputReadings& outputs);
  /// Queues an output value `copies` times. False: the queue is full.
  bool drive(std::uint16_t counts, std::size_t copies);
  /// Ends the output and sets the rest value.
  void rest(std::uint16_t counts);
  /// Number of values that are queued ahead of the output.
  std::size_t ahead() const { return ahead_; }
  /// True if the loop is behind: frames wait to be read.
  bool has_frames() const { return frames_.peek() != nullptr; }
  bool ran_dry() const { return refill_.load(std::memory_order_acquire) == Refill::awaited; }
  /// The values queued from now on are current: the output may begin again.
  void refill() { refill_.store(Refill::started, std::memory_order_release); }

  /// True once after an overrun, an underrun.
  bool take_overrun() { return overrun_.exchange(false, std::memory_order_acq_rel); }
  bool take_underrun() { return underrun_.exchange(false, std::memory_order_acq_rel); }
  /// True while the board refuses to scan.
  bool refuses_scan() const { return refused_; }

 private:
  struct FreeTransfer {
    void operator()(libusb_transfer* transfer) const { libusb_free_transfer(transfer); }
  };
  struct Transfer {
    Board* board = nullptr;
    std::unique_ptr<libusb_transfer, FreeTransfer> transfer;
    std::vector<std::uint8_t> buffer;
    bool in_flight = false;
  };
  using Transfers = std::vector<std::unique_ptr<Transfer>>;
  struct Received {
    Frame frame;
    OutputReadings outputs;
  };

  void add(Transfers& transfers, std::uint8_t endpoint, std::size_t bytes);
  static void LIBUSB_CALL transfer_ended(libusb_transfer* transfer);
  void input_ended(Transfer& transfer);
  void output_ended(const Transfer& transfer);
  void submit(Transfer& transfer, std::size_t bytes);
  void handle_events(int milliseconds);
  bool gone() const { return gone_.load(std::memory_order_relaxed); }
  bool cancel(Transfers& transfers);
  bool succeeded(int result);

  void run();
  void poll_status();
  bool begin_input();
  bool begin_scan();
  void restart_input();
  void decode(std::span<const std::uint8_t> bytes);
  bool is_complete(std::size_t bytes);
  double volts_of(const ScanChannel& channel, std::uint16_t code) const;
  void publish(std::span<const std::uint16_t> codes);

  void serve_output();
  void recover_output();
  void begin_output();
  void submit_fill();
  void end_output();
  void send_values();
  void discard_values();

  Session session_;
  ScanPlan plan_;
  Calibration calibration_;
  int output_;
  std::size_t ahead_;  // values
  HostClock& clock_;
  ScanDecoder decoder_;
  Numbering numbering_;
  std::atomic<std::uint64_t>& overruns_;
  std::atomic<std::uint64_t>& underruns_;
  std::vector<std::uint16_t> fill_;  // the values queued ahead when the output begins
  Transfers inputs_;
  Transfers outputs_;
  UsbEvents events_;
  std::thread thread_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> gone_ = false;
  std::atomic<bool> stuck_ = false;
  std::atomic<bool> overrun_ = false;
  std::atomic<bool> underrun_ = false;
  std::atomic<bool> refused_ = false;

  moodycamel::ReaderWriterQueue<Received> frames_{frame_capacity};
  sem_t available_{};  // counts the frames
  moodycamel::ReaderWriterQueue<std::uint16_t> values_{value_capacity};
  std::atomic<std::uint16_t> rest_;
  std::atomic<bool> driving_ = false;
  /// After an underrun the output begins again with the values that the loop writes once it has
  /// caught up: earlier ones would delay all later ones permanently.
  enum class Refill : std::uint8_t { none, awaited, started };
  std::atomic<Refill> refill_ = Refill::none;

  // Of the board's thread.
  bool input_failed_ = false;
  bool output_failed_ = false;
  bool output_running_ = false;
  std::int64_t poll_status_at_ns_ = 0;
  int resting_at_ = -1;  // output value at rest [counts]; -1: unknown
};

}  // namespace stickslip::drivers::usb_1208fs_plus
