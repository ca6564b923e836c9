// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <stickslip/frame_block_t.hpp>
#include <stickslip/recording_info_t.hpp>
#include <string>
#include <vector>

#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "protocol/recording.h"
#include "protocol/recording_log.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/spy/sequence.h"
#include "tools/telemetry/lcm_client.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;
using namespace telemetry;

namespace {

using std::chrono::steady_clock;

// Largest loss of a killed recorder, besides data not yet written by the kernel.
constexpr auto flush_period = std::chrono::milliseconds(200);

struct Arguments {
  std::string out;
  std::string url;
  double duration_s = 0.0;
  std::uint64_t frames = 0;
};

// Receiver of LCM messages. A log is written immediately, unaltered; CSV at the end, since its
// header depends on the measured channels. A new log has its name from the start, so that a killed
// recorder leaves it; an existing file is replaced when the first frames arrive.
class Recorder {
 public:
  explicit Recorder(const Arguments& arguments)
      : wanted_(arguments.frames),
        file_(arguments.out),
        replaces_(std::filesystem::exists(file_)),
        output_(arguments.out) {
    recording_.source = arguments.url;
    if (file_.extension() == ".lcm" || file_.extension() == ".log") {
      log_.emplace(output_.path());
      protocol::Description description;
      description.started_utc_us = std::chrono::duration_cast<std::chrono::microseconds>(
                                       std::chrono::system_clock::now().time_since_epoch())
                                       .count();
      description.program = "stickslip record";
      description.version = STICKSLIP_VERSION;
      const recording_info_t info = protocol::info_of(description, -1);
      bytes_.resize(static_cast<std::size_t>(info.getEncodedSize()));
      info.encode(bytes_.data(), 0, static_cast<int>(bytes_.size()));
      append(protocol::recording_channel, bytes_, info.started_utc_us);
      if (!replaces_) output_.keep("");
    } else if (file_.extension() != ".csv") {
      throw InputError(
          Problem{file_.string(), 0, 0, "expected a name that ends with .csv or .log"});
    }
  }

  void take(const lcm::ReceiveBuffer* buffer, const std::string& channel) {
    if (done_) return;
    const std::span<const std::uint8_t> bytes(static_cast<const std::uint8_t*>(buffer->data),
                                              buffer->data_size);
    if (channel == protocol::frames_channel) {
      take_block(bytes, buffer->recv_utime);
    } else if (log_) {
      append(channel, bytes, buffer->recv_utime);
      ++others_;
    }
  }

  bool done() const { return done_; }
  /// Reason to end the recording because a reader would refuse the rest; otherwise empty.
  const std::string& broken_by() const { return broken_by_; }
  const spy::Sequence& sequence() const { return sequence_; }

  void rest() {
    const auto now = steady_clock::now();
    if (!log_ || now - flushed_ < flush_period) return;
    flushed_ = now;
    if (!log_->flush()) refuse_file();
    if (sequence_.frames > 0) output_.keep("");
  }

  void close() {
    if (log_) {
      if (!log_->close()) refuse_file();
    } else {
      protocol::write_recording(recording_, output_.path());
    }
    if (sequence_.frames > 0 || !replaces_) output_.keep("");
  }

  void print_summary() const {
    using physics::counted;
    std::string text = file_.string() + ": " + counted(sequence_.frames, "frame") + " in " +
                       counted(blocks_, "block") + ", " +
                       physics::fixed_text(static_cast<double>(last_ns_ - first_ns_) * 1e-9, 3) +
                       " s; lost " + counted(sequence_.lost, "frame") + " in " +
                       counted(sequence_.gaps, "gap");
    if (others_ > 0) text += "; " + counted(others_, "other message");
    if (undecoded_ > 0) {
      text += "; " + counted(undecoded_, "block") + " discarded that could not be decoded";
    }
    terminal::print_page(text + "\n");
  }

 private:
  void take_block(std::span<const std::uint8_t> bytes, std::int64_t time_us) {
    frames_.clear();
    if (!protocol::decode(bytes, block_) || !protocol::from_block(block_, frames_)) {
      ++undecoded_;
      return;
    }
    if (frames_.empty()) return;
    bool whole = true;
    if (wanted_ > 0 && sequence_.frames + frames_.size() > wanted_) {
      frames_.resize(static_cast<std::size_t>(wanted_ - sequence_.frames));
      whole = false;
    }
    for (const Frame& frame : frames_) {
      if (sequence_.frames > 0 && frame.time_ns <= last_ns_) {
        broken_by_ = "time stamps jumped back from " + std::to_string(last_ns_) + " ns to " +
                     std::to_string(frame.time_ns) +
                     " ns: the source restarted, or there are two sources; the recording ends "
                     "before the jump";
        frames_.resize(static_cast<std::size_t>(&frame - frames_.data()));
        whole = false;
        done_ = true;
        break;
      }
      if (sequence_.frames == 0) first_ns_ = frame.time_ns;
      last_ns_ = frame.time_ns;
      sequence_.add(frame.sequence);
    }
    if (!frames_.empty()) keep(bytes, whole, time_us);
    if (wanted_ > 0 && sequence_.frames >= wanted_) done_ = true;
  }

  void keep(std::span<const std::uint8_t> bytes, bool whole, std::int64_t time_us) {
    ++blocks_;
    if (!log_) {
      recording_.frames.insert(recording_.frames.end(), frames_.begin(), frames_.end());
      return;
    }
    if (whole) {
      append(protocol::frames_channel, bytes, time_us);
      return;
    }
    const std::int32_t flags = block_.flags;
    protocol::to_block(frames_, block_);
    block_.flags = flags;
    bytes_.resize(static_cast<std::size_t>(block_.getEncodedSize()));
    block_.encode(bytes_.data(), 0, static_cast<int>(bytes_.size()));
    append(protocol::frames_channel, bytes_, time_us);
  }

  void append(const std::string& channel, std::span<const std::uint8_t> bytes,
              std::int64_t time_us) {
    if (!log_->append(channel, bytes, time_us)) refuse_file();
  }

  [[noreturn]] void refuse_file() const {
    throw InputError(
        Problem{file_.string(), 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
  }

  std::uint64_t wanted_;
  std::filesystem::path file_;
  bool replaces_;
  OutputFile output_;
  std::optional<protocol::LogWriter> log_;
  protocol::Recording recording_;
  steady_clock::time_point flushed_;
  frame_block_t block_{};
  std::vector<Frame> frames_;
  std::vector<std::uint8_t> bytes_;
  spy::Sequence sequence_;
  std::int64_t first_ns_ = 0;
  std::int64_t last_ns_ = 0;
  std::uint64_t blocks_ = 0;
  std::uint64_t others_ = 0;
  std::uint64_t undecoded_ = 0;
  bool done_ = false;
  std::string broken_by_;
};

int run(const Arguments& arguments) {
  const StopSignals stop;
  const std::unique_ptr<lcm::LCM> lcm = join_lcm(arguments.url);
  Recorder recorder(arguments);
  listen<&Recorder::take>(*lcm, "STICKSLIP_.*", &recorder);
  terminal::print("recording %s into %s\n", arguments.url.c_str(), arguments.out.c_str());
  std::fflush(stdout);
  const auto end = after(steady_clock::now(), arguments.duration_s);
  bool stopped = false;
  terminal::Progress progress("recording");
  if (arguments.frames == 0) progress.set_duration(arguments.duration_s);
  auto shown = steady_clock::now();
  const auto show = [&] {
    if (arguments.frames > 0) {
      progress.at(static_cast<double>(recorder.sequence().frames) /
                  static_cast<double>(arguments.frames));
    }
    if (steady_clock::now() - shown < flush_period) return;
    shown = steady_clock::now();
    progress.set_label("recording, " + physics::counted(recorder.sequence().frames, "frame") +
                       ", lost " + std::to_string(recorder.sequence().lost));
  };
  while (!stopped && !recorder.done() && steady_clock::now() < end) {
    const Wake woken = wait_for(*lcm, stop, std::min(end, steady_clock::now() + flush_period));
    stopped = woken == Wake::stop;
    if (woken == Wake::message) lcm->handle();
    recorder.rest();
    show();
  }
  // Messages that arrived before the stop belong to the recording, including those that LCM's
  // thread is still reading from the socket; a continuing stream does not delay the stop.
  const auto deadline = after(steady_clock::now(), stopped ? 0.2 : 1.0);
  const int quiet_ms = stopped ? 50 : 0;
  while (!recorder.done() && steady_clock::now() < deadline && lcm->handleTimeout(quiet_ms) > 0) {
  }
  recorder.close();
  progress.finish();
  if (!recorder.broken_by().empty()) {
    std::fprintf(stderr, "stickslip: %s\n", recorder.broken_by().c_str());
  }
  recorder.print_summary();
  if (recorder.sequence().frames == 0) {
    std::fprintf(stderr,
                 "stickslip: no frames arrived on %s at %s; does the daemon publish there?\n",
                 protocol::frames_channel, arguments.url.c_str());
    return 1;
  }
  return recorder.broken_by().empty() ? 0 : 1;
}

}  // namespace

void add_record(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "record", "Record LCM messages; UDP may lose some, unlike the daemon's own recording");
  add_output(*command, "OUT", arguments->out,
             "Output: .log, written immediately; .csv, kept in memory until the end")
      ->required()
      ->type_name("FILE");
  add_url_option(*command, arguments->url);
  add_stop_after_option(*command, arguments->duration_s);
  command->add_option("--frames", arguments->frames, "Stop after this number of frames")
      ->check(whole_number(1, 1e15));
  command->callback([&action, arguments, command] {
    action = [arguments, command] {
      outputs_of(*command);
      return run(*arguments);
    };
  });
  describe(*command, {.examples = {{"Record the traffic on LCM for ten seconds",
                                    "stickslip record received.log --duration 10"}},
                      .environment = {lcm_url_variable},
                      .files = {recording_files},
                      .see_also = {"stickslip-replay(1)", "stickslip-spy(1)", "stickslipd(8)"}});
}

}  // namespace stickslip::commands
