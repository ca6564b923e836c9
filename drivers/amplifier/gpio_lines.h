// Lines of a GPIO chip. One interface for both generations of libgpiod: gpio_lines_v1.cpp is for
// 1.6, gpio_lines_v2.cpp for 2.x, and the build takes the one that fits.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"

namespace stickslip::drivers::gpio {

/// A chip that could be looked at.
struct Chip {
  std::string path;   ///< "/dev/gpiochip0"
  std::string name;   ///< "gpiochip0"
  std::string label;  ///< of its driver: "cp2112_gpio"
  std::size_t lines = 0;
};

/// The chip behind a path. Nothing, and `error` the system's number, where that is none or may not
/// be opened.
std::optional<Chip> chip_at(const std::string& path, int& error);

/// "1.6.3", "2.1": of the library that is linked.
std::string library_version();

enum class Use {
  output,  ///< driven, at first inactive
  input    ///< read, with edges where the chip can tell them
};

/// The rest waits for the next call. The kernel keeps no more than 16 of a line unless it is asked
/// to.
inline constexpr std::size_t edges_at_a_call = 64;

/// Why lines could not be had.
struct Refusal {
  int error = 0;         ///< the system's number; ENOENT: no such line
  std::string line;      ///< as the configuration says it
  std::string consumer;  ///< of a line that is busy: by whom; may be unknown
};

/// Some lines of one chip, all outputs or all inputs. Levels are logical: active is what the
/// configuration calls so, whatever the voltage. Only one thread at a time.
class Lines {
 public:
  /// Null, and `refusal`, where one of them cannot be had. `path` is that of a chip.
  static std::unique_ptr<Lines> request(const std::string& path, Use use,
                                        std::span<const config::GpioLine> lines, Refusal& refusal);
  ~Lines();
  Lines(const Lines&) = delete;
  Lines& operator=(const Lines&) = delete;

  /// 0, or the system's number of the error. Allocates nothing and takes no lock; on a chip of the
  /// processor some microseconds, on one at USB some milliseconds.
  int set(std::size_t line, bool active) noexcept;
  /// 1: active, 0: not, negative: the system's number of the error.
  int get(std::size_t line) noexcept;

  /// Readable once there was an edge; none where the chip tells no edges.
  std::span<const int> edge_files() const noexcept;
  /// Takes up the edges that there were, at most `edges_at_a_call` of a file: a wire that floats
  /// can make them faster than they are taken. Sets `went_active[line]` of the lines that have
  /// become active in the meantime, even if they are not any more. 0, or the system's number of
  /// the error.
  int take_edges(std::span<bool> went_active) noexcept;

 private:
  struct Held;
  explicit Lines(std::unique_ptr<Held> held);
  std::unique_ptr<Held> held_;
};

}  // namespace stickslip::drivers::gpio
