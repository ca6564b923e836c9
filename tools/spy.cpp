#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <span>
#include <stickslip/event_t.hpp>
#include <stickslip/excitation_t.hpp>
#include <stickslip/frame_block_t.hpp>
#include <stickslip/friction_estimate_t.hpp>
#include <stickslip/recording_info_t.hpp>
#include <stickslip/status_t.hpp>
#include <stickslip/timing_t.hpp>
#include <string>
#include <vector>

#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "tools/command.h"
#include "tools/lcm_client.h"
#include "tools/option_checks.h"
#include "tools/sequence.h"

namespace stickslip::tools {

namespace {

using std::chrono::steady_clock;

struct Arguments {
  std::string url;
  double duration_s = 0.0;
  bool once = false;
};

std::string text(const char* format, double value) {
  std::array<char, 48> out{};
  const int size = std::snprintf(out.data(), out.size(), format, value);
  return {out.data(), static_cast<std::size_t>(std::max(size, 0))};
}

std::span<const std::uint8_t> bytes_of(const lcm::ReceiveBuffer& buffer) {
  return {static_cast<const std::uint8_t*>(buffer.data), buffer.data_size};
}

std::string values_of(const Frame& frame) {
  std::string out;
  for (const Channel channel : all_channels) {
    if (!frame.has(channel)) continue;
    if (!out.empty()) out += ", ";
    out += std::string(info(channel).stem) + " " + text("%.4g", frame[channel]) + " " +
           std::string(info(channel).unit);
  }
  return "t " + text("%.3f", frame.time_s()) + " s: " + (out.empty() ? "nothing measured" : out);
}

std::string words(const friction_estimate_t& estimate) {
  if (!estimate.valid) return "not valid";
  return "mu " + text("%.4g", estimate.mu) + ", theta " + text("%.3f", estimate.theta) +
         ", friction " + text("%.4g", estimate.friction_force_n) + " N, slip " +
         text("%.4g", estimate.slip_velocity_m_s) + " m/s, sticks " +
         text("%.2f", estimate.sticking) + ", NIS " + text("%.3g", estimate.nis) + " of " +
         std::to_string(estimate.nis_freedom);
}

std::string words(const excitation_t& excitation) {
  return "drive " + text("%.4g", excitation.drive) + ", amplitude " +
         text("%.4g", excitation.amplitude) + " at " + text("%.4g", excitation.carrier_hz) +
         " Hz, amplifier " + (excitation.amplifier_on ? "on" : "off");
}

std::string words(const status_t& status) {
  std::string out = status.state + ", produced " + std::to_string(status.produced);
  if (status.publishing) out += ", published " + std::to_string(status.published);
  if (status.recording) out += ", recorded " + std::to_string(status.recorded);
  for (std::size_t i = 0; i < status.publish_loss.size(); ++i) {
    if (status.publish_loss[i] != 0)
      out += ", not published (" + status.publish_loss_name[i] + ") " +
             std::to_string(status.publish_loss[i]);
  }
  for (std::size_t i = 0; i < status.record_loss.size(); ++i) {
    if (status.record_loss[i] != 0)
      out += ", not recorded (" + status.record_loss_name[i] + ") " +
             std::to_string(status.record_loss[i]);
  }
  if (!status.cause.empty()) out += ", " + status.interlock + ": " + status.cause;
  out += ", overruns " + std::to_string(status.overruns);
  return status.degraded ? out + ", timing degraded" : out;
}

std::string words(const timing_t& timing) {
  std::int64_t counted = 0;
  for (const std::int64_t in_bin : timing.lateness) counted += in_bin;
  std::int64_t seen = 0;
  for (std::size_t i = 0; i < timing.lateness.size(); ++i) {
    seen += timing.lateness[i];
    if (counted > 0 && seen * 100 >= counted * 99) {
      return "99 % of wake-ups late by at most " +
             text("%.4g", static_cast<double>(timing.upper_edge_ns[i]) * 1e-3) + " us";
    }
  }
  return std::to_string(timing.cycles) + " cycles";
}

std::string words(const event_t& event) { return event.code + ": " + event.message; }

std::string words(const recording_info_t& info) {
  std::string out = info.rig.empty() ? "rig not named" : "rig \"" + info.rig + "\"";
  if (!info.program.empty()) out += ", " + info.program + " " + info.version;
  return out;
}

// What came in on one channel since the start.
struct Line {
  std::uint64_t messages = 0;
  std::uint64_t messages_before = 0;  // at the last table
  std::uint64_t undecoded = 0;
  std::uint32_t bytes = 0;  // of the last message
  bool is_frames = false;
  Sequence sequence;
  std::uint64_t degraded_blocks = 0;
  std::string last;
};

// Text of others stays one line of a table and no command to the terminal.
std::string printable(std::string line) {
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  }
  return line;
}

class Spy {
 public:
  void take(const lcm::ReceiveBuffer* buffer, const std::string& channel) {
    Line& line = lines_[channel];
    ++line.messages;
    line.bytes = buffer->data_size;
    if (channel == protocol::frames_channel) {
      take_block(*buffer, line);
    } else if (channel == protocol::estimate_channel) {
      take_as<friction_estimate_t>(*buffer, line);
    } else if (channel == protocol::excitation_channel) {
      take_as<excitation_t>(*buffer, line);
    } else if (channel == protocol::status_channel) {
      take_as<status_t>(*buffer, line);
    } else if (channel == protocol::timing_channel) {
      take_as<timing_t>(*buffer, line);
    } else if (channel == protocol::event_channel) {
      take_as<event_t>(*buffer, line);
    } else if (channel == protocol::recording_channel) {
      take_as<recording_info_t>(*buffer, line);
    }
  }

  bool heard_frames() const {
    const auto frames = lines_.find(protocol::frames_channel);
    return frames != lines_.end() && frames->second.sequence.frames > 0;
  }
  bool heard_anything() const { return !lines_.empty(); }

  /// One line a channel, rates over the time since the last table; each cut to `width` where it is
  /// not 0.
  std::string table(double seconds, std::size_t width) {
    std::string out;
    for (auto& [channel, line] : lines_) {
      std::string row = channel;
      row.resize(std::max<std::size_t>(row.size(), 22), ' ');
      const double rate = static_cast<double>(line.messages - line.messages_before) / seconds;
      line.messages_before = line.messages;
      row += " " + std::to_string(line.messages) + " messages, " + text("%.1f", rate) + "/s, " +
             std::to_string(line.bytes) + " B";
      if (line.is_frames) {
        row += ", " + std::to_string(line.sequence.frames) + " frames, lost " +
               std::to_string(line.sequence.lost) + " in " + std::to_string(line.sequence.gaps) +
               " gaps";
        if (line.sequence.restarts > 0) {
          row += ", " + std::to_string(line.sequence.restarts) + " times begun anew";
        }
        if (line.degraded_blocks > 0) {
          row += ", " + std::to_string(line.degraded_blocks) + " blocks of degraded timing";
        }
      }
      if (line.undecoded > 0) row += ", " + std::to_string(line.undecoded) + " not decoded";
      if (!line.last.empty()) row += " | " + line.last;
      row = printable(row);
      if (width > 0 && row.size() > width) row.resize(width);
      out += row + "\n";
    }
    return out;
  }

 private:
  template <class Message>
  static void take_as(const lcm::ReceiveBuffer& buffer, Line& line) {
    Message message{};
    if (protocol::decode(bytes_of(buffer), message)) {
      line.last = words(message);
    } else {
      ++line.undecoded;
    }
  }

  void take_block(const lcm::ReceiveBuffer& buffer, Line& line) {
    line.is_frames = true;
    frames_.clear();
    if (!protocol::decode(bytes_of(buffer), block_) || !protocol::from_block(block_, frames_)) {
      ++line.undecoded;
      return;
    }
    for (const Frame& frame : frames_) line.sequence.add(frame.sequence);
    if ((block_.flags & 1) != 0) ++line.degraded_blocks;
    if (!frames_.empty()) line.last = values_of(frames_.back());
  }

  std::map<std::string, Line> lines_;
  frame_block_t block_{};
  std::vector<Frame> frames_;
};

std::size_t terminal_width() {
  winsize size{};
  return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

int run(const Arguments& arguments) {
  const StopSignals stop;
  const std::unique_ptr<lcm::LCM> lcm = join_lcm(arguments.url);
  Spy spy;
  listen(*lcm, ".*", &Spy::take, &spy);
  const bool terminal = isatty(STDOUT_FILENO) != 0 && !arguments.once;
  const auto start = steady_clock::now();
  const auto period = std::chrono::seconds(1);
  // --once waits for something to show, but not for ever.
  const double patience_s = arguments.duration_s > 0.0 ? arguments.duration_s : 5.0;
  const auto end = after(start, arguments.once ? patience_s : arguments.duration_s);
  auto shown = start;
  auto next = start + period;
  bool stopped = false;
  const auto show = [&](steady_clock::time_point now) {
    const double seconds = std::max(1e-3, std::chrono::duration<double>(now - shown).count());
    shown = now;
    std::string out = spy.table(seconds, terminal ? terminal_width() : 0);
    if (out.empty()) out = "nothing yet at " + arguments.url + "\n";
    if (terminal) {
      std::printf("\033[H\033[J%s  %.0f s (Ctrl-C ends)\n\n%s", arguments.url.c_str(),
                  std::chrono::duration<double>(now - start).count(), out.c_str());
    } else {
      std::fputs(out.c_str(), stdout);
    }
    std::fflush(stdout);
  };
  while (!stopped) {
    const auto now = steady_clock::now();
    if (now >= end) break;
    if (now >= next) {
      if (arguments.once && spy.heard_frames()) break;
      if (!arguments.once) show(now);
      next = std::max(next + period, now);
    }
    switch (wait_for(*lcm, stop, std::min(end, next))) {
      case Woken::stop:
        stopped = true;
        break;
      case Woken::message:
        lcm->handle();
        break;
      case Woken::time_out:
        break;
    }
  }
  const auto now = steady_clock::now();
  if (arguments.once || now - shown > period / 2) show(now);
  // A person who stops it has seen what there is; a script that waited wants to know.
  return spy.heard_anything() || stopped ? 0 : 1;
}

}  // namespace

void add_spy(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "spy", "Show what is on LCM: rates, sizes, losses, last values of every channel");
  add_url_option(*command, arguments->url);
  command->add_option("--duration", arguments->duration_s, "Stop after so many seconds")
      ->check(positive_number());
  command->add_flag("--once", arguments->once,
                    "One table a second after the start, or once frames arrive (within "
                    "--duration, 5 s unless told otherwise)");
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stickslip::tools
