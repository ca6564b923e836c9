#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <span>
#include <stickslip/frame_block_t.hpp>
#include <string>

#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/frame_block.h"
#include "protocol/recording.h"
#include "protocol/recording_log.h"
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

using namespace command_line;
using namespace telemetry;

namespace {

using std::chrono::steady_clock;

struct Arguments {
  std::string recording;
  std::string url;
  double speed = 1.0;
  std::size_t frames_per_block = 10;
};

template <class Message>
void publish(lcm::LCM& lcm, const char* channel, const Message& message) {
  if (lcm.publish(channel, &message) != 0) {
    throw Failure(std::string("LCM cannot publish on ") + channel +
                  "; is its network up, and does its group have a route?");
  }
}

int run(const Arguments& arguments) {
  const protocol::Recording recording = recording_from(arguments.recording);
  const std::span<const Frame> frames(recording.frames);
  const StopSignals stop;
  const std::unique_ptr<lcm::LCM> lcm = join_lcm(arguments.url);
  publish(
      *lcm, protocol::recording_channel,
      protocol::info_of(recording.description, static_cast<std::int64_t>(recording.frames.size())));

  const auto start = steady_clock::now();
  frame_block_t block{};
  std::size_t done = 0;
  std::size_t blocks = 0;
  double latest_s = 0.0;
  terminal::Progress progress("publishing " + arguments.recording);
  while (done < frames.size()) {
    const auto some =
        frames.subspan(done, std::min(arguments.frames_per_block, frames.size() - done));
    auto due = steady_clock::now();
    if (arguments.speed > 0.0) {
      // As on a rig, a block is complete when its last frame has been measured.
      const double at_s = static_cast<double>(some.back().time_ns - frames.front().time_ns) * 1e-9;
      due = at_s > 0.0 ? after(start, at_s / arguments.speed) : start;
    }
    if (stopped_before(stop, due)) break;
    if (arguments.speed > 0.0) {
      latest_s =
          std::max(latest_s, std::chrono::duration<double>(steady_clock::now() - due).count());
    }
    protocol::to_block(some, block);
    publish(*lcm, protocol::frames_channel, block);
    done += some.size();
    ++blocks;
    progress.at(done, frames.size());
  }
  progress.finish();
  const double took_s = std::chrono::duration<double>(steady_clock::now() - start).count();
  std::string text = "published " + std::to_string(done) + " of " +
                     physics::counted(frames.size(), "frame") + " in " +
                     physics::counted(blocks, "block") + " on " + arguments.url + " in " +
                     physics::fixed_text(took_s, 3) + " s";
  if (arguments.speed > 0.0) {
    text += ", blocks up to " + physics::fixed_text(latest_s * 1e3, 3) + " ms late";
  }
  terminal::print_page(text + (done < frames.size() ? " (stopped)\n" : "\n"));
  return 0;
}

}  // namespace

void add_replay(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("replay", "Publish a recording on LCM like the daemon, at its own rate");
  add_recording(*command, arguments->recording);
  add_url_option(*command, arguments->url);
  command
      ->add_option(
          "--speed", arguments->speed,
          "Speed relative to the recording; 0: as fast as possible, which may lose UDP packets")
      ->check(
          number_that([](double v) { return v >= 0.0 && v <= 1.0e6; }, "a number from 0 to 1e6"))
      ->capture_default_str();
  command->add_option("--block", arguments->frames_per_block, "Frames in a block")
      ->check(whole_number(1, 10000))
      ->capture_default_str();
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command, {.examples = {{"Publish a recording at twice its speed",
                                    "stickslip replay run.log --speed 2"}},
                      .environment = {lcm_url_variable},
                      .files = {recording_files},
                      .see_also = {"stickslip-record(1)", "stickslip-spy(1)"}});
}

}  // namespace stickslip::commands
