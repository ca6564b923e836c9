// SPDX-License-Identifier: Apache-2.0
// The machine as seen by the checks. Properties are attempted or read at the time of the call.
// Tests substitute a simulated machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace stickslip::doctor {

/// Result of an attempted operation.
struct Attempt {
  bool done = false;
  int error = 0;       ///< errno if it was refused
  std::string reason;  ///< description of the error
};

/// Directory entry.
struct Entry {
  enum class Kind { none, file, folder, socket, device, other };
  Kind kind = Kind::none;  ///< none: missing, or hidden from the caller
  unsigned mode = 0;       ///< permission bits
  std::string owner;
  std::string group;
  bool readable = false;  ///< by the caller
  bool writable = false;
  bool searchable = false;  ///< the caller may enter the folder

  bool exists() const { return kind != Kind::none; }
};

struct Caller {
  std::string name;
  bool root = false;
  std::vector<std::string> groups;  ///< of this process
};

/// Route of packets to an address.
struct Route {
  bool found = false;
  std::string interface;  ///< "lo"
  std::string reason;     ///< why there is none
};

/// Round trips of messages, one at a time.
struct RoundTrip {
  bool done = false;  ///< LCM could be joined
  std::string reason;
  int sent = 0;
  int received = 0;
  std::int64_t median_ns = 0;
  std::int64_t longest_ns = 0;
};

/// Wake-ups of a periodic thread, and the step of the clock meanwhile.
struct Wakeups {
  bool real_time = false;  ///< at SCHED_FIFO; otherwise as an ordinary thread
  std::size_t count = 0;
  std::int64_t p50_ns = 0;  ///< lateness with respect to the deadline
  std::int64_t p99_ns = 0;
  std::int64_t longest_ns = 0;
  std::int64_t clock_step_ns = 0;  ///< step of the wall clock with respect to the monotonic one
};

struct WriteSpeed {
  Attempt attempt;
  double bytes_per_s = 0.0;  ///< written and synced
  std::int64_t longest_sync_ns = 0;
};

struct Kernel {
  std::string release;  ///< "6.1.0-18-amd64"
  std::string version;  ///< "#1 SMP PREEMPT_DYNAMIC ..."
  std::string machine;  ///< "x86_64"
};

/// State of the wall clock as reported by the kernel.
struct WallClock {
  bool synchronised = false;
  std::int64_t error_us = 0;  ///< bound of the error
};

enum class Limit { real_time_priority, locked_memory };

class Host {
 public:
  virtual ~Host() = default;

  /// Content of a small file (64 KiB at most) without trailing white space; nullopt if it cannot be
  /// read.
  virtual std::optional<std::string> read(const std::filesystem::path& file) const = 0;
  /// Sorted names in a folder; empty if it cannot be read.
  virtual std::vector<std::string> names_in(const std::filesystem::path& folder) const = 0;
  /// A path without symbolic links; unchanged if it does not exist.
  virtual std::filesystem::path resolved(const std::filesystem::path& path) const = 0;
  virtual Entry entry_at(const std::filesystem::path& path) const = 0;
  /// Opens for writing and closes again, without writing.
  virtual Attempt open_for_writing(const std::filesystem::path& path) const = 0;
  /// Connects to a Unix socket and closes the connection.
  virtual Attempt connect_to(const std::filesystem::path& socket) const = 0;
  /// Connects by TCP, within some seconds, and closes the connection.
  virtual Attempt reach(const std::string& host, int port) const = 0;

  virtual Caller caller() const = 0;
  virtual bool group_exists(const std::string& name) const = 0;
  virtual Kernel kernel() const = 0;
  /// Soft limit of the process; -1: unlimited.
  virtual std::int64_t limit(Limit which) const = 0;

  /// True if a network interface is up; nothing if there is none of that name.
  virtual std::optional<bool> interface_up(const std::string& name) const = 0;
  virtual Route route_to(const std::string& address) const = 0;
  /// Number of messages that the receive buffer of a UDP socket holds; 0 if none is delivered.
  /// `receive_buffer_bytes`: value of SO_RCVBUF; 0: the default.
  virtual std::size_t receive_buffer_messages(std::size_t bytes,
                                              int receive_buffer_bytes) const = 0;
  /// Publishes messages at `url` on a private channel and receives them, one at a time.
  virtual RoundTrip lcm_round_trip(const std::string& url, std::size_t bytes) const = 0;

  /// Attempted in a separate thread.
  virtual Attempt take_real_time_priority(int priority) const = 0;
  /// Attempted in a child process, with a reserve for later allocations of the daemon.
  virtual Attempt lock_memory() const = 0;
  /// With real-time priority if it is granted. Blocks for `duration_s`.
  virtual Wakeups measure_wakeups(double rate_hz, double duration_s) const = 0;

  /// Space in a folder that is available to the caller; nothing if unknown.
  virtual std::optional<std::uint64_t> free_bytes(const std::filesystem::path& folder) const = 0;
  /// Writes a temporary file.
  virtual WriteSpeed measure_writing(const std::filesystem::path& folder) const = 0;
  virtual std::optional<WallClock> wall_clock() const = 0;
};

}  // namespace stickslip::doctor
