// The machine as the checks see it: every question that they ask of it. Answers are what was tried
// or read at that moment; nothing is guessed. Tests answer instead of a machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace stickslip::doctor {

/// Something that was tried.
struct Tried {
  bool done = false;
  int error = 0;      ///< errno where it was refused
  std::string words;  ///< the same in words
};

/// What stands at a path.
struct Entry {
  enum class Kind { none, file, folder, socket, device, other };
  Kind kind = Kind::none;  ///< none: nothing, or not to be seen by the caller
  unsigned mode = 0;       ///< permission bits
  std::string owner;
  std::string group;
  bool readable = false;  ///< by the caller
  bool writable = false;
  bool searchable = false;  ///< a folder that the caller may enter

  bool there() const { return kind != Kind::none; }
};

struct Caller {
  std::string name;
  bool root = false;
  std::vector<std::string> groups;  ///< of this process, as it is now
};

/// Where packets for an address go.
struct Route {
  bool there = false;
  std::string interface;  ///< "lo"
  std::string words;      ///< where there is none: why
};

/// Messages that were sent and waited for.
struct RoundTrip {
  bool done = false;  ///< LCM could be joined
  std::string words;
  int sent = 0;
  int received = 0;
  std::int64_t median_ns = 0;
  std::int64_t longest_ns = 0;
};

/// Wake-ups of a periodic thread, and the clock meanwhile.
struct Wakeups {
  bool real_time = false;  ///< at SCHED_FIFO; else as an ordinary thread
  std::size_t count = 0;
  std::int64_t p50_ns = 0;  ///< lateness against the deadline
  std::int64_t p99_ns = 0;
  std::int64_t longest_ns = 0;
  std::int64_t clock_step_ns = 0;  ///< by which the wall clock left the monotonic one
};

struct WriteSpeed {
  Tried tried;
  double bytes_per_s = 0.0;  ///< written and forced to the disk
  std::int64_t longest_sync_ns = 0;
};

struct Kernel {
  std::string release;  ///< "6.1.0-18-amd64"
  std::string version;  ///< "#1 SMP PREEMPT_DYNAMIC ..."
  std::string machine;  ///< "x86_64"
};

/// What the kernel says of the wall clock.
struct WallClock {
  bool synchronised = false;
  std::int64_t error_us = 0;  ///< the most by which it may be off
};

enum class Limit { real_time_priority, locked_memory };

class Host {
 public:
  virtual ~Host() = default;

  /// The content of a small file without the white space at its end; nothing where it cannot be
  /// read.
  virtual std::optional<std::string> read(const std::filesystem::path& file) const = 0;
  /// The names in a folder, in order; empty where it cannot be read.
  virtual std::vector<std::string> names_in(const std::filesystem::path& folder) const = 0;
  virtual Entry look_at(const std::filesystem::path& path) const = 0;
  /// Opens for writing and closes again, without writing.
  virtual Tried open_for_writing(const std::filesystem::path& path) const = 0;
  /// Connects to a Unix socket and closes again, without a word.
  virtual Tried connect_to(const std::filesystem::path& socket) const = 0;

  virtual Caller caller() const = 0;
  virtual bool group_exists(const std::string& name) const = 0;
  virtual Kernel kernel() const = 0;
  /// Soft limit of the process; -1: none.
  virtual std::int64_t limit(Limit which) const = 0;

  /// Whether a network interface is up; nothing where there is none of that name.
  virtual std::optional<bool> interface_up(const std::string& name) const = 0;
  virtual Route route_to(const std::string& address) const = 0;
  /// How many messages of a size a UDP socket holds while nobody reads; 0 where none came through.
  /// `receive_buffer_bytes`: as asked for with SO_RCVBUF; 0: the machine's default.
  virtual std::size_t messages_held(std::size_t bytes, int receive_buffer_bytes) const = 0;
  /// Publishes on a channel of its own at `url` and receives it, one message after the other.
  virtual RoundTrip lcm_round_trip(const std::string& url, std::size_t bytes) const = 0;

  /// In a thread of its own.
  virtual Tried take_real_time_priority(int priority) const = 0;
  /// In a process of its own, with room for what the daemon adds later.
  virtual Tried lock_memory() const = 0;
  /// With real-time priority where it is granted. Takes `duration_s`.
  virtual Wakeups measure_wakeups(double rate_hz, double duration_s) const = 0;

  /// Bytes that the caller may still write in a folder; nothing where it cannot be told.
  virtual std::optional<std::uint64_t> free_bytes(const std::filesystem::path& folder) const = 0;
  /// With a file that is gone afterwards.
  virtual WriteSpeed measure_writing(const std::filesystem::path& folder) const = 0;
  virtual std::optional<WallClock> wall_clock() const = 0;
};

}  // namespace stickslip::doctor
