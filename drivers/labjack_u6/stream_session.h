// A LabJack U6 while it streams: samples arrive in a thread of their own and become frames, and
// short commands travel beside them without anybody waiting.
#pragma once

#include <libusb-1.0/libusb.h>
#include <semaphore.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "drivers/labjack_u6/board_link.h"
#include "drivers/labjack_u6/protocol.h"
#include "drivers/labjack_u6/stream_decoder.h"
#include "drivers/usb_events.h"
#include "physics/frame.h"

namespace stickslip::drivers::labjack_u6 {

/// What a scan is made of.
struct StreamPlan {
  std::vector<StreamChannel> scan;  ///< in the order in which they are sampled
  std::vector<Channel> channel;     ///< what each of them measures
  ScanClock clock;
  Calibration calibration;
  int samples_per_packet = 25;
  int transfers = 8;
  int packets_per_transfer = 1;
};

/// What ended a stream.
enum class StreamEnd : std::uint8_t {
  not_ended,
  unplugged,
  usb_error,    ///< stalled, or the bus failed
  uncountable,  ///< scans were lost and nobody knows how many
  board_error,  ///< the board put an error code in a packet
};

/// The commands that may be under way at the same time, one of each.
enum class Slot : std::uint8_t { set_point, off, watchdog, lines };
inline constexpr std::size_t slot_count = 4;
/// A command that the board has not taken by then is withdrawn.
inline constexpr unsigned leaving_patience_ms = 100;

/// The digital lines as the board told them last; for any thread. One thread writes at a time.
class Lines {
 public:
  /// `asked_ns`: when the command was sent that this answers. They are no older than that.
  void tell(std::uint32_t levels, std::int64_t asked_ns) {
    levels_.store(levels, std::memory_order_relaxed);
    asked_ns_.store(asked_ns, std::memory_order_release);
  }
  /// First the time, then the levels, so that these are never older than it says.
  std::int64_t asked_ns() const { return asked_ns_.load(std::memory_order_acquire); }
  std::uint32_t levels() const { return levels_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint32_t> levels_{0};
  std::atomic<std::int64_t> asked_ns_{0};
};

/// What befell the streams of a board, of all times that one ran; for any thread. One thread writes
/// at a time.
struct StreamCounts {
  std::atomic<std::uint64_t> packets_lost{0};
  std::atomic<std::uint64_t> packets_damaged{0};
  std::atomic<std::uint64_t> overflows{0};  ///< of the board's buffer, each with its recovery
  std::atomic<std::uint64_t> scans_thrown_away{0};  ///< by the board, while its buffer was full
  std::atomic<std::uint64_t> scans_lost{0};         ///< for whatever reason
  std::atomic<std::uint8_t> fullest_backlog{0};     ///< how full the buffer ever was, of 256
};

/// Calls come from one thread, that of the loop; what the event thread shares with it is atomic.
class StreamSession {
 public:
  StreamSession(libusb_context* context, libusb_device_handle* handle, StreamPlan plan,
                Lines& lines, StreamCounts& counts);
  ~StreamSession();
  StreamSession(const StreamSession&) = delete;
  StreamSession& operator=(const StreamSession&) = delete;

  /// Submits the transfers and starts the thread. The board streams already, or does so at once.
  /// False: it could not, and nothing is under way any more, unless end() says otherwise.
  bool begin();
  /// Cancels everything and waits until it has come back. False: the kernel kept something, and
  /// this object must not be destroyed.
  bool end() noexcept;

  /// The next frame, in volts; waits for it at most that long. Does not allocate or lock.
  bool next(Frame& frame, std::int64_t patience_ns);
  StreamEnd ended() const { return end_.load(std::memory_order_acquire); }
  std::uint8_t board_error() const { return board_error_.load(std::memory_order_relaxed); }

  /// What became of the command in a slot. Takes the result away: the next call says `none`.
  struct Progress {
    enum class Kind : std::uint8_t { none, under_way, done, failed, timed_out };
    Kind kind = Kind::none;
    Verdict verdict;           ///< failed; where the command could not be sent, of Kind::length
    std::int64_t sent_ns = 0;  ///< done, failed: when the command was sent
  };
  Progress progress(Slot slot, std::int64_t now_ns);
  /// Nothing of that slot is under way.
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
    // Phase, echo, and what was wrong: in one word, so that a reply and a time-out cannot both win.
    std::atomic<std::uint64_t> word{0};
    std::atomic<bool> leaving{false};  // its bytes are with the kernel
    std::atomic<std::int64_t> sent_ns{0};
  };

  static void LIBUSB_CALL samples_came(libusb_transfer* transfer);
  static void LIBUSB_CALL reply_came(libusb_transfer* transfer);
  static void LIBUSB_CALL command_left(libusb_transfer* transfer);

  bool allocate();
  bool submit(libusb_transfer* transfer);
  void run();
  void reap() noexcept;
  void finish(StreamEnd why);
  bool usable(libusb_transfer_status status);
  void decode(std::span<const std::uint8_t> bytes);
  void count();
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
  // A ring from the event thread to the loop's. Each of both counts what it has done.
  std::vector<Frame> frames_;
  std::atomic<std::uint64_t> frames_made_{0};
  std::atomic<std::uint64_t> frames_taken_{0};
  sem_t available_{};
  std::atomic<StreamEnd> end_{StreamEnd::not_ended};
  std::atomic<std::uint8_t> board_error_{0};
  Lines& lines_;
  StreamCounts& counts_;
  StreamDecoder::Counts counted_;  // of this stream, and told already
  std::atomic<int> in_flight_{0};
  std::atomic<bool> finishing_{false};
  UsbEvents events_;
  std::thread thread_;
};

}  // namespace stickslip::drivers::labjack_u6
