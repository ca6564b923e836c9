// Numbers for the scans of a board that numbers nothing.
#pragma once

#include <cstdint>
#include <optional>

namespace stickslip::drivers::usb_1208fs_plus {

/// Scans that come one after the other have numbers one after the other. Where a scan has to be
/// begun anew, the host's clock says how many periods passed meanwhile, from the one start command
/// to the other; the drift of the board's crystal against it is taken out by how late scans come to
/// the host, the earliest of each second. What remains is how unevenly commands travel: less than a
/// millisecond on a host that is not busy.
class Numbering {
 public:
  explicit Numbering(double period_s) : period_ns_(period_s * 1e9) {}

  /// The board was told to begin at that time on the host's clock. The first time numbers begin
  /// with 0; later there is a gap of one scan at least.
  void begin(std::int64_t host_ns);

  /// The number of the next scan that came, or that is known to be lost.
  std::uint64_t take() { return next_++; }

  /// All that were taken had come by that time.
  void arrived(std::int64_t host_ns);

 private:
  /// How much later than at first the scans come [ns].
  double drift_ns() const;

  double period_ns_;
  bool begun_ = false;
  std::uint64_t next_ = 0;
  std::uint64_t first_ = 0;     // of this run
  double first_exact_ = 0.0;    // where it would be between whole numbers
  std::int64_t begun_ns_ = 0;   // of this run
  std::int64_t window_ns_ = 0;  // when the second began
  double earliest_ns_ = 0.0;    // lateness, in this second
  std::optional<double> at_first_ns_;
  double lately_ns_ = 0.0;  // in the last whole second
};

}  // namespace stickslip::drivers::usb_1208fs_plus
