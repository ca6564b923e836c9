// SPDX-License-Identifier: Apache-2.0
// Protocol of the USB-1208FS-Plus: requests, scan settings, samples and calibration memory, as pure
// functions of bytes. The numbers are those of the vendor's open Linux drivers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/driver.h"

namespace stickslip::drivers::usb_1208fs_plus {

inline constexpr std::uint16_t vendor_id = 0x09DB;
inline constexpr std::uint16_t product_id = 0x00E8;
inline constexpr std::uint8_t input_endpoint = 0x81;
inline constexpr std::uint8_t output_endpoint = 0x02;
inline constexpr std::size_t packet_bytes = 64;
inline constexpr double clock_hz = 60e6;

/// Vendor control requests.
enum class Request : std::uint8_t {
  input_scan_start = 0x11,
  input_scan_stop = 0x12,
  input_config = 0x14,
  input_clear_fifo = 0x15,
  output = 0x18,
  output_scan_start = 0x1A,
  output_scan_stop = 0x1B,
  output_clear_fifo = 0x1C,
  calibration_memory = 0x30,
  status = 0x44,
  serial = 0x48,
};

/// Reply to Request::status.
struct Status {
  bool input_running = false;
  bool input_overrun = false;
  bool output_running = false;
  bool output_underrun = false;
};
Status status_of(std::uint16_t word);

/// Ranges of differential inputs by code, 0 to 7 [V]; single-ended ones have only +-10 V, code 0.
inline constexpr std::array<double, 8> differential_ranges_v = {20.0, 10.0, 5.0,  4.0,
                                                                2.5,  2.0,  1.25, 1.0};

/// calibrated code = code * slope + offset.
struct Correction {
  float slope = 1.0F;
  float offset = 0.0F;
};

struct Calibration {
  std::array<std::array<Correction, 4>, 8> differential{};  ///< [range code][channel]
  std::array<Correction, 8> single_ended{};
};
inline constexpr std::size_t calibration_bytes = 0x140;

/// None if the memory holds implausible constants: not finite, a slope far from 1, or an offset of
/// more than an eighth of the range.
std::optional<Calibration> parse_calibration(std::span<const std::uint8_t> memory);

/// Voltage of a 12-bit code, 0 to 4095.
double input_volts(std::uint16_t code, double range_v, Correction correction);

/// Counts for an output of 0 to 5 V, saturated; 0 for NaN.
std::uint16_t output_counts(double volts);

/// One input of a scan.
struct ScanChannel {
  std::uint8_t channel = 0;
  std::uint8_t range_code = 0;
  double range_v = 10.0;
  /// Index of the channel in the frame; none: the input reads an output back, or fills packets.
  std::optional<std::size_t> frame_index;
  std::optional<double> OutputReadings::*output = nullptr;  ///< the output that it reads back
};

/// Scan settings for a configuration.
struct ScanPlan {
  std::vector<ScanChannel> channels;  ///< ascending, as the board samples them
  bool differential = false;
  bool immediate = false;          ///< one packet per scan, else full packets
  std::uint32_t input_pacer = 0;   ///< one conversion every (input_pacer + 1) ticks of 60 MHz
  std::uint32_t output_pacer = 0;  ///< one value every (output_pacer + 1) ticks: the scan period
  std::size_t transfer_bytes = packet_bytes;
  double period_s = 0.0;  ///< scan period
  double conversion_s() const { return static_cast<double>(input_pacer + 1) / clock_hz; }
};

/// Of the inputs of the channels and those that read the outputs back. None if the configuration is
/// invalid; `refusal` then holds the message. Packets hold 32 samples:
/// if the configured inputs take more than 10 ms to fill one, further inputs are scanned and their
/// samples discarded. Up to 100 scans per second, each scan has a separate packet.
std::optional<ScanPlan> plan_scan(const config::BenchInputs& inputs,
                                  const config::ReadbackInputs& outputs, double rate_hz,
                                  std::string& refusal);

/// The 14 bytes of Request::input_scan_start: continuous, stalling on overrun.
std::array<std::uint8_t, 14> input_scan(const ScanPlan& plan);
/// The 8 bytes of Request::input_config.
std::array<std::uint8_t, 8> input_ranges(const ScanPlan& plan);
/// The 9 bytes of Request::output_scan_start: continuous, one output.
std::array<std::uint8_t, 9> output_scan(const ScanPlan& plan, int output);

/// Assembles scans from a stream of bytes whose packets may end anywhere, even within a sample.
class ScanDecoder {
 public:
  explicit ScanDecoder(std::size_t channels) : channels_(channels) {}

  /// Discards an incomplete scan.
  void restart() { have_ = 0; }

  /// Consumes bytes until a scan is complete; the rest remains in `bytes`. The scan is valid until
  /// the next call. Bits 12 to 15 of a sample are masked.
  std::optional<std::span<const std::uint16_t>> next(std::span<const std::uint8_t>& bytes);

 private:
  std::size_t channels_;
  std::size_t have_ = 0;  // bytes
  std::array<std::uint8_t, 16> bytes_{};
  std::array<std::uint16_t, 8> codes_{};
};

}  // namespace stickslip::drivers::usb_1208fs_plus
