// SPDX-License-Identifier: Apache-2.0
// An emulated LabJack T7 on the loopback interface: Modbus TCP with function 76, and the
// spontaneous stream. Written from the vendor's register map and datasheet, independently of the
// driver.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "tests/emulated/labjack_t7/registers.h"
#include "tests/emulated/wires.h"

namespace stickslip::emulated {

struct T7Options {
  std::uint32_t serial = 470012345;
  float product = 7.0F;
  float firmware = 1.0297F;
  std::uint64_t seed = 1;  ///< of its constants
  /// Where the amplifier is wired; -1: not.
  int enable_line = 2;
  int amplifier_fault_line = 3;
  int emergency_stop_line = 4;
  int dac = 0;
};

enum class T7ReplyFault { none, missing, exception, wrong_transaction, wrong_length };
enum class T7StreamFault {
  none,
  wrong_transaction,  ///< a number far from the expected one
  missing,            ///< the packet is not sent
  no_packet,          ///< bytes of another protocol
  overlap,            ///< status 2942
  cut                 ///< half a packet, then the connection is closed
};

class EmulatedLabjackT7 {
 public:
  using Now = std::function<std::int64_t()>;

  EmulatedLabjackT7(Wires& wires, Now now, const T7Options& options = {});
  ~EmulatedLabjackT7();
  EmulatedLabjackT7(const EmulatedLabjackT7&) = delete;
  EmulatedLabjackT7& operator=(const EmulatedLabjackT7&) = delete;

  void wire(int input, const Sensor& sensor);
  int port() const { return ports_[0]; }
  int stream_port() const { return ports_[1]; }

  /// Closes all connections and accepts none, with power; and back, at the same ports.
  void unplug();
  /// Closes all connections; new ones are accepted.
  void hang_up();
  void plug();
  /// Another board at the same address.
  void become(std::uint32_t serial);

  /// Of the next `count` replies; -1: of all until changed.
  void fault_replies(T7ReplyFault fault, int count = -1);
  void fault_next_packet(T7StreamFault fault);
  /// Requests that access this address fail with the error; 0: none.
  void refuse_address(int address, std::uint16_t error = 0);
  /// Nothing is sent until the buffer, now a small one, has overflowed by that many scans.
  void overflow_by(std::uint64_t scans);
  /// No packet is sent, and none is kept: a board without its converter.
  void stop_scanning(bool stopped);
  /// Deviation of the scan rate that it reports.
  void misreport_rate(double factor);
  void set_constant(int gain, int place, float value);

  struct Write {
    int address = 0;
    std::uint32_t value = 0;
    friend bool operator==(const Write&, const Write&) = default;
  };
  std::vector<Write> writes() const;
  std::uint32_t number(int address) const;
  float real(int address) const;
  bool streaming() const;
  bool watchdog_armed() const { return number(61600) != 0; }
  std::uint64_t watchdog_trips() const;
  std::uint64_t scans_skipped() const;
  std::uint64_t overflows() const;
  std::uint64_t requests() const;

 private:
  struct Client {
    int file = -1;
    bool stream = false;
    std::vector<std::uint8_t> in;
    std::vector<std::uint8_t> out;
  };
  using Bytes = std::vector<std::uint8_t>;

  void listen();
  void run();
  void accept_one(int listener, bool stream);
  bool receive(Client& client);
  void answer(Client& client, const Bytes& message);
  bool execute(const Bytes& message, Bytes& data, std::uint8_t& exception);
  bool write(int address, const Bytes& value);
  bool may_write(int address);
  bool start_stream(bool enable);
  Bytes read(int address, int registers);
  void advance();
  void scan(std::uint64_t index);
  void send_packets();
  void packet(Client& client);
  void watch();
  void show_outputs();
  std::uint32_t levels() const;
  std::uint16_t fail(std::uint16_t error);
  void flush();
  void close_clients();
  void close_all();

  Wires& wires_;
  Now now_;
  T7Options options_;
  std::map<int, Sensor> sensors_;

  mutable std::mutex mutex_;
  T7Registers registers_;
  T7Constants constants_;
  std::uint32_t outputs_ = 0;  // directions
  std::uint32_t states_ = 0;   // of the outputs
  std::vector<Write> writes_;
  std::uint64_t requests_ = 0;
  int ports_[2] = {0, 0};
  int listeners_[2] = {-1, -1};
  std::list<Client> clients_;

  bool streaming_ = false;
  std::int64_t started_ns_ = 0;
  std::int64_t interval_ns_ = 1;
  std::uint64_t next_scan_ = 0;
  std::deque<std::uint16_t> buffer_;
  bool recovering_ = false;
  std::uint64_t skipped_ = 0;  // in this recovery
  std::optional<std::uint16_t> report_;
  std::uint16_t next_packet_ = 0;
  std::uint64_t all_skipped_ = 0;
  std::uint64_t overflows_ = 0;
  std::uint64_t hold_until_skipped_ = 0;  // 0: sends
  bool stopped_ = false;
  double misreport_ = 1.0;

  std::int64_t cleared_ns_ = 0;
  std::uint64_t trips_ = 0;
  T7ReplyFault reply_fault_ = T7ReplyFault::none;
  int faulty_replies_ = 0;
  T7StreamFault stream_fault_ = T7StreamFault::none;
  std::map<int, std::uint16_t> refused_;

  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace stickslip::emulated
