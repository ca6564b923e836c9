// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <optional>
#include <span>
#include <stickslip/frame_block_t.hpp>
#include <string>

#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/frame_block.h"
#include "protocol/recording.h"
#include "protocol/recording_events.h"
#include "protocol/recording_log.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/telemetry/lcm_client.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace telemetry;

namespace {

using std::chrono::steady_clock;

struct Arguments {
  std::string recording;
  std::string url;
  double speed = 1.0;
  std::size_t frames_per_block = 0;  // 0: the blocks of a log, 10 frames of a CSV file
};

/// Publishes messages when they are due and counts them.
class Player {
 public:
  Player(const Arguments& arguments, lcm::LCM& lcm, const StopSignals& stop)
      : speed_(arguments.speed), lcm_(lcm), stop_(stop) {}

  /// Waits until `at_s` seconds of the recording have passed; false if a stop signal arrived. A
  /// time before that of the message before is due at once.
  bool wait(double at_s) {
    auto due = steady_clock::now();
    if (speed_ > 0.0) due = at_s > 0.0 ? after(start_, at_s / speed_) : start_;
    if (stopped_before(stop_, due)) return false;
    if (speed_ > 0.0) {
      const std::chrono::duration<double> late = steady_clock::now() - due;
      if (at_s >= latest_at_s_) latest_s_ = std::max(latest_s_, late.count());
      latest_at_s_ = std::max(latest_at_s_, at_s);
    }
    return true;
  }

  void publish(const std::string& channel, std::span<const std::uint8_t> bytes) {
    check(lcm_.publish(channel, bytes.data(), static_cast<unsigned>(bytes.size())), channel);
    ++others_;
  }

  void publish(std::span<const Frame> frames) {
    protocol::to_block(frames, block_);
    check(lcm_.publish(protocol::frames_channel, &block_), protocol::frames_channel);
    count_block(frames.size());
  }

  /// A block of frames as it is in the log.
  void publish_block(std::span<const std::uint8_t> bytes, std::size_t frames) {
    publish(protocol::frames_channel, bytes);
    --others_;
    count_block(frames);
  }

  void publish(const recording_info_t& info) {
    check(lcm_.publish(protocol::recording_channel, &info), protocol::recording_channel);
    ++others_;
  }

  std::size_t frames() const { return frames_; }

  void print_summary(const Arguments& arguments, std::size_t all, bool stopped) const {
    const double took_s = std::chrono::duration<double>(steady_clock::now() - start_).count();
    std::string text =
        "published " + std::to_string(frames_) + " of " + physics::counted(all, "frame") + " in " +
        physics::counted(blocks_, "block") + " and " + physics::counted(others_, "other message") +
        " on " + arguments.url + " in " + physics::fixed_text(took_s, 3) + " s";
    if (speed_ > 0.0) text += ", up to " + physics::fixed_text(latest_s_ * 1e3, 3) + " ms late";
    terminal::print_page(text + (stopped ? " (stopped)\n" : "\n"));
  }

 private:
  static void check(int status, const std::string& channel) {
    if (status == 0) return;
    throw Failure("LCM cannot publish on " + channel +
                  "; is its network up, and does its group have a route?");
  }

  void count_block(std::size_t frames) {
    frames_ += frames;
    ++blocks_;
  }

  double speed_;
  lcm::LCM& lcm_;
  const StopSignals& stop_;
  steady_clock::time_point start_ = steady_clock::now();
  frame_block_t block_{};
  std::size_t frames_ = 0;
  std::size_t blocks_ = 0;
  std::size_t others_ = 0;
  double latest_s_ = 0.0;
  double latest_at_s_ = 0.0;
};

/// Publishes blocks of frames, each when its last frame has been measured, as on a rig. False if
/// stopped.
bool play_frames(Player& player, std::span<const Frame> frames, std::size_t per_block,
                 terminal::Progress& progress) {
  for (std::size_t done = 0; done < frames.size();) {
    const auto some = frames.subspan(done, std::min(per_block, frames.size() - done));
    const auto passed_ns = some.back().time_ns - frames.front().time_ns;
    if (!player.wait(static_cast<double>(passed_ns) * 1e-9)) return false;
    player.publish(some);
    done += some.size();
    progress.at(done, frames.size());
  }
  return true;
}

/// Publishes every message of a log in its order, at the times of the log's events. `per_block`: as
/// in the arguments. False if stopped.
bool play_log(Player& player, const Arguments& arguments, std::span<const Frame> frames,
              terminal::Progress& progress) {
  std::ifstream in(arguments.recording, std::ios::binary);
  protocol::EventReader reader(in, arguments.recording);
  protocol::LogEvent event;
  std::optional<std::int64_t> first_us;
  std::size_t read = 0;  // frames in the blocks so far
  while (reader.next(event) == protocol::EventReader::Found::event) {
    if (!first_us) first_us = event.time_us;
    if (!player.wait((static_cast<double>(event.time_us) - static_cast<double>(*first_us)) * 1e-6))
      return false;
    if (event.channel != protocol::frames_channel) {
      player.publish(event.channel, event.data);
      continue;
    }
    const auto count =
        static_cast<std::size_t>(std::max<std::int64_t>(0, protocol::frames_in(event.data)));
    read = std::min(read + count, frames.size());
    if (arguments.frames_per_block == 0) {
      player.publish_block(event.data, count);
    } else {
      while (read - player.frames() >= arguments.frames_per_block) {
        player.publish(frames.subspan(player.frames(), arguments.frames_per_block));
      }
    }
    progress.at(player.frames(), frames.size());
  }
  if (player.frames() < read)
    player.publish(frames.subspan(player.frames(), read - player.frames()));
  return true;
}

bool is_log(const std::string& file) {
  std::array<char, 4> head{};
  std::ifstream in(file, std::ios::binary);
  in.read(head.data(), head.size());
  return protocol::is_log({head.data(), static_cast<std::size_t>(in.gcount())});
}

int run(const Arguments& arguments) {
  const protocol::Recording recording = recording_from(arguments.recording);
  const StopSignals stop;
  const std::unique_ptr<lcm::LCM> lcm = join_lcm(arguments.url);
  Player player(arguments, *lcm, stop);
  terminal::Progress progress("publishing " + arguments.recording);
  bool complete = false;
  if (is_log(arguments.recording)) {
    complete = play_log(player, arguments, recording.frames, progress);
  } else {
    constexpr std::size_t usual_block = 10;
    const std::size_t block = arguments.frames_per_block;
    player.publish(protocol::info_of(recording.description,
                                     static_cast<std::int64_t>(recording.frames.size())));
    complete = play_frames(player, recording.frames, block == 0 ? usual_block : block, progress);
  }
  progress.finish();
  player.print_summary(arguments, recording.frames.size(), !complete);
  return 0;
}

}  // namespace

void add_replay(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "replay", "Publish everything in a recording on LCM, in its order and at its pace");
  add_recording(*command, arguments->recording);
  add_url_option(*command, arguments->url);
  command
      ->add_option(
          "--speed", arguments->speed,
          "Speed relative to the recording; 0: as fast as possible, which may lose UDP packets")
      ->check(
          number_that([](double v) { return v >= 0.0 && v <= 1.0e6; }, "a number from 0 to 1e6"))
      ->capture_default_str();
  command
      ->add_option("--block", arguments->frames_per_block,
                   "Frames in a block (default: the blocks of a log, 10 frames of a CSV file)")
      ->check(whole_number(1, 10000));
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command, {.examples = {{"Publish a recording at twice its speed",
                                    "stickslip replay run.log --speed 2"}},
                      .environment = {lcm_url_variable},
                      .files = {recording_files},
                      .see_also = {"stickslip-record(1)", "stickslip-spy(1)"}});
}

}  // namespace stickslip::commands
