// GPIO chips as the kernel shows them, for stand-ins of both generations of libgpiod.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <vector>

namespace stickslip::emulated {

enum class Pull { as_is, off, up, down };

/// What is wanted of a line.
struct GpioWish {
  bool output = false;
  bool initially_active = false;
  bool active_low = false;
  bool edges = false;
  Pull pull = Pull::as_is;
  std::string consumer;
};

/// An edge as it is told: logical, after active_low.
struct GpioEdge {
  unsigned offset = 0;
  bool rising = false;
};

/// Functions that can fail return 0, or the system's number of the error. Any thread.
class EmulatedGpio {
 public:
  // For tests.
  /// All chips are gone.
  void clear();
  void add_chip(const std::string& path, const std::string& label,
                std::vector<std::string> line_names);
  void forbid(const std::string& path, bool forbidden);
  void tells_edges(const std::string& path, bool tells);
  void unplug(const std::string& path);
  void fail_next_sets(const std::string& path, int count);
  /// They do nothing and say that it was well, as kernels tell of chips at USB.
  void swallow_next_sets(const std::string& path, int count);
  /// Outputs cannot be read.
  void reads_outputs(const std::string& path, bool reads);
  /// Somebody else has it, or nobody any more (empty).
  void occupy(const std::string& path, unsigned offset, const std::string& consumer);
  /// The voltage at a line that is an input; without `tell` its edge is lost.
  void put(const std::string& path, unsigned offset, bool high, bool tell = true);
  /// A wire at nothing: of every edge that is taken up there is another one.
  void let_float(const std::string& path, unsigned offset, bool floats);
  /// Whoever asks for a level waits until it is let go.
  void hold_gets(bool hold);
  /// Whoever sets a line waits until it is let go.
  void hold_sets(bool hold);
  bool level(const std::string& path, unsigned offset) const;
  /// Every voltage that an output was given, the one that it was requested with first.
  std::vector<bool> history(const std::string& path, unsigned offset) const;
  Pull pull(const std::string& path, unsigned offset) const;
  std::string consumer(const std::string& path, unsigned offset) const;

  // For the stand-ins.
  int open(const std::string& path) const;
  std::string name(const std::string& path) const;
  std::string label(const std::string& path) const;
  unsigned lines(const std::string& path) const;
  int find(const std::string& path, const std::string& line_name) const;  ///< offset, or negative
  /// `edge_file`: where GpioEdges are to be written.
  int request(const std::string& path, unsigned offset, const GpioWish& wish, int edge_file);
  void release(const std::string& path, unsigned offset);
  int set(const std::string& path, unsigned offset, bool active);
  int get(const std::string& path, unsigned offset, bool& active) const;
  void edge_taken(const std::string& path, const GpioEdge& edge);

 private:
  struct Line {
    std::string name;
    std::string consumer;
    GpioWish wish;
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
    bool tells_edges = true;
    int failing_sets = 0;
    int swallowed_sets = 0;
    bool reads_outputs = true;
  };
  Chip* chip(const std::string& path);
  const Chip* chip(const std::string& path) const;

  mutable std::mutex mutex_;
  mutable std::condition_variable let_go_;
  bool holds_gets_ = false;
  bool holds_sets_ = false;
  std::deque<Chip> chips_;
};

/// The one that the stand-ins' C functions know.
EmulatedGpio& emulated_gpio();

}  // namespace stickslip::emulated
