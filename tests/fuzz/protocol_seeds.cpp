// SPDX-License-Identifier: Apache-2.0
// Writes the seeds of fuzz_log and fuzz_message, which are binary and depend on the current types.
//   protocol_seeds FOLDER
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "protocol/recording.h"
#include "protocol/recording_log.h"

namespace {

using namespace stickslip;

template <class Message>
void write(const std::filesystem::path& file, const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  // Seeds must be accepted by the target.
  Message again{};
  if (!protocol::decode(bytes, again)) throw std::runtime_error(file.string() + ": no message");
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()),
            static_cast<std::streamsize>(bytes.size()));
}

/// All messages of a daemon, and an unrelated one.
void write_log_of_a_daemon(const protocol::Recording& recording,
                           const std::filesystem::path& file) {
  protocol::LogWriter writer(file);
  const auto append = [&](const char* channel, const auto& message) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    if (!writer.append(channel, bytes, 1)) throw std::runtime_error("no log");
  };
  append(protocol::recording_channel, protocol::info_of(recording.description, -1));
  frame_block_t block;
  protocol::to_block(recording.frames, block);
  append(protocol::frames_channel, block);
  append(protocol::excitation_channel, excitation_t{});
  append("CAMERA", event_t{});
  append(protocol::event_channel, event_t{});
  status_t status{};
  status.recording = 1;
  status.recorded = status.produced = 12;
  append(protocol::status_channel, status);
  if (!writer.close()) throw std::runtime_error("no log");
}

protocol::Recording some_recording() {
  protocol::Recording recording;
  for (int i = 0; i < 12; ++i) {
    Frame frame;
    frame.time_ns = 1'000'000 * i;
    frame.sequence = static_cast<std::uint64_t>(i);
    frame.set(Channel::displacement, 0.001 * i);
    if (i % 2 == 0) frame.set(Channel::drive_force, -0.5);
    recording.frames.push_back(frame);
  }
  recording.description = {1, "bench", "stickslipd", "0.1.0", "[rig]\n", "schema = 1\n"};
  return recording;
}

void write_logs(const protocol::Recording& recording, const std::filesystem::path& logs) {
  std::filesystem::create_directories(logs);
  protocol::write_log(recording, logs / "good.log", 4);
  protocol::write_log(recording, logs / "one_frame_blocks.log", 1);
  write_log_of_a_daemon(recording, logs / "daemon.log");
}

void write_messages(const protocol::Recording& recording, const std::filesystem::path& messages) {
  std::filesystem::create_directories(messages);
  frame_block_t block;
  protocol::to_block(recording.frames, block);
  write(messages / "frame_block", block);
  friction_estimate_t estimate{};
  estimate.state_count = 2;
  estimate.state_name = {"displacement_m", "mu"};
  estimate.state = {0.1, 0.8};
  estimate.covariance = {{1.0, 0.0}, {0.0, 1.0}};
  write(messages / "estimate", estimate);
  excitation_t excitation{};
  excitation.earlier = 2;
  excitation.earlier_by = {2, 1};
  excitation.earlier_drive = {0.001, 0.002};
  excitation.earlier_amplitude = {0.008F, 0.008F};
  excitation.earlier_phase_rad = {0.1F, 0.2F};
  excitation.earlier_state = {0x80, 0x81};
  write(messages / "excitation", excitation);
  status_t status{};
  status.state = "running";
  status.publish_loss_count = 2;
  status.publish_loss_name = {"ring full", "socket"};
  status.publish_loss = {1, 2};
  status.record_loss_count = 1;
  status.record_loss_name = {"disk"};
  status.record_loss = {3};
  write(messages / "status", status);
  timing_t timing{};
  timing.bins = 1;
  timing.upper_edge_ns = timing.lateness = timing.cycle = timing.read = {1000};
  write(messages / "timing", timing);
  event_t event{};
  event.code = "overrun";
  event.message = "a cycle took 1.2 ms";
  write(messages / "event", event);
  recording_info_t info{};
  info.configuration = "[rig]\n";
  write(messages / "recording_info", info);
  recorder_t recorder{};
  recorder.file = "run.log";
  write(messages / "recorder", recorder);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: protocol_seeds FOLDER\n");
    return 2;
  }
  try {
    const std::filesystem::path folder = argv[1];
    const protocol::Recording recording = some_recording();
    write_logs(recording, folder / "logs");
    write_messages(recording, folder / "messages");
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "protocol_seeds: %s\n", error.what());
    return 1;
  }
}
