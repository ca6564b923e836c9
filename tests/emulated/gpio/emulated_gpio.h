// SPDX-License-Identifier: Apache-2.0
// Emulated GPIO chips of the kernel, for replacements of both generations of libgpiod.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <vector>

namespace stickslip::emulated {

enum class Pull { as_is, off, up, down };

/// Requested configuration of a line.
struct GpioRequest {
  bool output = false;
  bool initially_active = false;
  bool active_low = false;
  bool edges = false;
  Pull pull = Pull::as_is;
  std::string consumer;
};

/// An edge event: logical, after active_low.
struct GpioEdge {
  unsigned offset = 0;
  bool rising = false;
};

/// Functions that can fail return 0 or errno. Any thread.
class EmulatedGpio {
 public:
  // For tests.
  /// Removes all chips.
  void clear();
  void add_chip(const std::string& path, const std::string& label,
                std::vector<std::string> line_names);
  void forbid(const std::string& path, bool forbidden);
  void set_edge_support(const std::string& path, bool supported);
  void unplug(const std::string& path);
  void fail_next_sets(const std::string& path, int count);
  /// The next sets succeed without effect, as kernels report for USB chips.
  void swallow_next_sets(const std::string& path, int count);
  /// Enables or disables reading of outputs.
  void set_read_back(const std::string& path, bool supported);
  /// Sets the user of a line; empty: none.
  void occupy(const std::string& path, unsigned offset, const std::string& consumer);
  /// Sets the level at an input line; without `notify` its edge is lost.
  void put(const std::string& path, unsigned offset, bool high, bool notify = true);
  /// A floating wire: every edge that is read produces another.
  void let_float(const std::string& path, unsigned offset, bool floats);
  /// Blocks reads of levels until released.
  void hold_gets(bool hold);
  /// Blocks sets until released.
  void hold_sets(bool hold);
  /// Low without a chip.
  bool level(const std::string& path, unsigned offset) const;
  /// All levels of an output, beginning with the requested one; none without a chip.
  std::vector<bool> history(const std::string& path, unsigned offset) const;
  Pull pull(const std::string& path, unsigned offset) const;
  std::string consumer(const std::string& path, unsigned offset) const;

  // For the library replacements.
  int open(const std::string& path) const;
  std::string name(const std::string& path) const;
  std::string label(const std::string& path) const;
  unsigned lines(const std::string& path) const;
  int find(const std::string& path, const std::string& line_name) const;  ///< offset, or negative
  /// `edge_file`: receives GpioEdges.
  int request(const std::string& path, unsigned offset, const GpioRequest& request, int edge_file);
  void release(const std::string& path, unsigned offset);
  int set(const std::string& path, unsigned offset, bool active);
  int get(const std::string& path, unsigned offset, bool& active) const;
  void edge_taken(const std::string& path, const GpioEdge& edge);

 private:
  struct Line {
    std::string name;
    std::string consumer;
    GpioRequest request;
    bool high = false;
    bool floats = false;
    int edge_file = -1;
    std::vector<bool> history;
  };
  struct Chip {
    std::string path;
    std::string label;
    std::vector<Line> lines;
    bool forbidden = false;
    bool gone = false;
    bool has_edges = true;
    int failing_sets = 0;
    int swallowed_sets = 0;
    bool has_read_back = true;
  };
  Chip* chip(const std::string& path);
  const Chip* chip(const std::string& path) const;

  mutable std::mutex mutex_;
  mutable std::condition_variable released_;
  bool holds_gets_ = false;
  bool holds_sets_ = false;
  std::deque<Chip> chips_;
};

/// The instance of the library replacements' C functions.
EmulatedGpio& emulated_gpio();

}  // namespace stickslip::emulated
