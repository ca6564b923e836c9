// SPDX-License-Identifier: Apache-2.0
// Lines of a GPIO chip. One interface for both generations of libgpiod: gpio_lines_v1.cpp for 1.6,
// gpio_lines_v2.cpp for 2.x; the build selects one.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"

namespace stickslip::drivers::gpio {

/// An accessible chip.
struct Chip {
  std::string path;   ///< "/dev/gpiochip0"
  std::string name;   ///< "gpiochip0"
  std::string label;  ///< of its driver: "cp2112_gpio"
  std::size_t lines = 0;
};

/// The chip at a path. None, with the errno in `error`, if there is no chip or no permission.
std::optional<Chip> chip_at(const std::string& path, int& error);

/// Version of the linked library: "1.6.3", "2.1".
std::string library_version();

enum class Use {
  output,        ///< driven, initially inactive
  input,         ///< read, with edge events if the chip supports them
  sampled_input  ///< read, without edge events
};

/// Further edges wait for the next call. By default the kernel keeps at most 16 per line.
inline constexpr std::size_t max_edges_per_call = 64;

/// Reason why lines could not be requested.
struct Refusal {
  int error = 0;         ///< errno; ENOENT: no such line
  std::string line;      ///< as in the configuration
  std::string consumer;  ///< user of a busy line; may be unknown
};

/// Lines of one chip, all outputs or all inputs. Levels are logical: active as configured, whatever
/// the voltage. One thread at a time.
class Lines {
 public:
  /// Null, with `refusal`, if one of them is not available. `path` is that of a chip.
  static std::unique_ptr<Lines> request(const std::string& path, Use use,
                                        std::span<const config::GpioLine> lines, Refusal& refusal);
  ~Lines();
  Lines(const Lines&) = delete;
  Lines& operator=(const Lines&) = delete;

  /// 0 or errno. Neither allocates nor locks; takes microseconds on a chip of the processor,
  /// milliseconds on a USB chip.
  int set(std::size_t line, bool active) noexcept;
  /// 1: active, 0: inactive, negative: -errno.
  int get(std::size_t line) noexcept;

  /// Readable after an edge; empty if the chip does not support edge events.
  std::span<const int> edge_files() const noexcept;
  /// Reads pending edges, at most `max_edges_per_call` per file: a floating wire can produce them
  /// faster than they are read. Sets `went_active[line]` for lines that became active meanwhile,
  /// even if they are inactive again. 0 or errno.
  int take_edges(std::span<bool> went_active) noexcept;

 private:
  struct Handles;
  explicit Lines(std::unique_ptr<Handles> handles);
  std::unique_ptr<Handles> handles_;
};

}  // namespace stickslip::drivers::gpio
