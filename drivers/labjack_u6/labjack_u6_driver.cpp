#include "drivers/labjack_u6/labjack_u6_driver.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "drivers/labjack_u6/board_link.h"
#include "drivers/labjack_u6/protocol.h"
#include "drivers/labjack_u6/stream_session.h"
#include "physics/number_text.h"

namespace stickslip::drivers {

namespace u6 = labjack_u6;

namespace {

constexpr std::int64_t read_patience_ns = 20'000'000;
constexpr std::int64_t slice_ns = 500'000;  // of that, while a set-point waits to be sent
constexpr std::int64_t line_period_ns = 20'000'000;
// Older levels are no levels: a wire that may have been cut meanwhile counts as cut.
constexpr std::int64_t oldest_lines_ns = 100'000'000;
// A set-point is waited for longer than that. One answer that is lost shall not stop a rig: they
// are asked for by themselves, in time to be answered.
constexpr std::int64_t ask_lines_after_ns = oldest_lines_ns / 2;
// "On" may reach the board so long after it was sent; by then the watchdog must not have acted.
constexpr std::int64_t on_the_way_ns = std::int64_t{u6::leaving_patience_ms} * 1'000'000;
constexpr std::int64_t second_ns = 1'000'000'000;
constexpr double rate_tolerance = 50e-6;
// Of the 5 to 10 ms that a sample may travel, the part that it waits for its transfer to be full.
constexpr double transfer_s = 0.005;
constexpr int most_packets_per_transfer = 32;

std::string trouble_with_line(const char* key, const std::optional<int>& line) {
  if (!line || (*line >= 0 && *line < u6::digital_lines)) return {};
  return std::string(key) + " = " + std::to_string(*line) +
         ": the board has the lines 0 to 19 (FIO0-7, EIO0-7, CIO0-3)";
}

std::string trouble_with_range(const char* key, int value, int low, int high) {
  if (value >= low && value <= high) return {};
  return std::string(key) + " = " + std::to_string(value) + ": it has to be " +
         std::to_string(low) + " to " + std::to_string(high);
}

std::string trouble_with_input(Channel channel, const config::BenchInput& input) {
  const std::string where =
      "inputs." + std::string(info(channel).stem) + " = labjack_u6/" + input.input + ": ";
  const auto place = u6::input_named(input.input);
  if (!place) return where + "the board's inputs are AIN0 to AIN13";
  if (input.differential && *place % 2 != 0) {
    return where + "a differential pair begins with an even input (AIN0 against AIN1)";
  }
  if (!u6::gain_of(input.range_v)) {
    return where + "range_v = " + physics::number_text(input.range_v, 9) +
           ": it has to be 10, 1, 0.1 or 0.01";
  }
  return {};
}

std::string trouble_with_rate(double rate_hz, std::size_t channels) {
  if (!(rate_hz > 0.0) || !std::isfinite(rate_hz)) {
    return "loop.rate_hz = " + physics::number_text(rate_hz, 9) + ": it has to be positive";
  }
  const double samples_hz = rate_hz * static_cast<double>(channels);
  if (samples_hz > u6::highest_sample_rate_hz) {
    return "loop.rate_hz = " + physics::number_text(rate_hz, 9) + " with " +
           std::to_string(channels) +
           " inputs: the board takes 50000 samples/s together, so at most " +
           physics::number_text(u6::highest_sample_rate_hz / static_cast<double>(channels), 9) +
           " Hz";
  }
  const u6::ScanClock clock = u6::nearest_clock(rate_hz);
  if (u6::deviation(clock, rate_hz) > rate_tolerance) {
    return "loop.rate_hz = " + physics::number_text(rate_hz, 9) +
           ": the board's clocks cannot make it within 50 parts in a million. The nearest is " +
           physics::number_text(clock.rate_hz(), 9);
  }
  return {};
}

/// What was asked for, or as many as come in the time that a sample may wait: fewer inputs, or a
/// slower clock, fill a packet too late for a drive that follows the frames.
int samples_per_packet(const config::LabjackU6& settings, std::size_t inputs, double rate_hz) {
  if (settings.samples_per_packet) return *settings.samples_per_packet;
  const double in_time = transfer_s * rate_hz * static_cast<double>(inputs);
  return static_cast<int>(std::clamp(in_time, 1.0, double{u6::most_samples_per_packet}));
}

u6::StreamPlan plan_of(const config::LabjackU6& settings, const config::BenchInputs& inputs,
                       double rate_hz) {
  u6::StreamPlan plan;
  for (const Channel channel : all_channels) {
    const auto& input = inputs[index_of(channel)];
    if (!input) continue;
    plan.scan.push_back({u6::input_named(input->input).value_or(0), input->differential,
                         u6::gain_of(input->range_v).value_or(0)});
    plan.channel.push_back(channel);
  }
  plan.clock = u6::nearest_clock(rate_hz);
  plan.samples_per_packet = samples_per_packet(settings, plan.scan.size(), rate_hz);
  plan.transfers = settings.transfers;
  // A packet that is not full ends its transfer.
  if (plan.samples_per_packet == u6::most_samples_per_packet) {
    const double packets_hz =
        rate_hz * static_cast<double>(plan.scan.size()) / u6::most_samples_per_packet;
    plan.packets_per_transfer =
        std::clamp(static_cast<int>(packets_hz * transfer_s), 1, most_packets_per_transfer);
  }
  return plan;
}

}  // namespace

struct LabjackU6Driver::Board {
  u6::BoardLink link;
  u6::Calibration calibration;
  std::unique_ptr<u6::StreamSession> session;
};

LabjackU6Driver::LabjackU6Driver(const config::LabjackU6& settings,
                                 const config::BenchInputs& inputs, double rate_hz,
                                 HostClock& clock)
    : settings_(settings),
      inputs_(inputs),
      rate_hz_(rate_hz),
      clock_(clock),
      lines_(std::make_unique<u6::Lines>()),
      counts_(std::make_unique<u6::StreamCounts>()),
      rest_v_(settings.rest_v) {
  description_.name = "LabJack U6";
  description_.paced = true;
  description_.own_clock = true;
  description_.can_drive = true;
  description_.unit.fill("V");
  for (std::size_t i = 0; i < channel_count; ++i) {
    if (inputs_[i]) {
      description_.channels = static_cast<std::uint8_t>(description_.channels | (1U << i));
    }
  }
}

LabjackU6Driver::~LabjackU6Driver() { close(); }

Result LabjackU6Driver::refuse(Outcome outcome, std::string text) {
  refusal_ = std::move(text);
  return {outcome, refusal_.c_str()};
}

bool LabjackU6Driver::has_watchdog() const {
  return settings_.watchdog_s > 0 && settings_.enable_line.has_value();
}

std::string LabjackU6Driver::trouble_with_settings() const {
  std::size_t channels = 0;
  for (const Channel channel : all_channels) {
    const auto& input = inputs_[index_of(channel)];
    if (!input) continue;
    ++channels;
    if (std::string trouble = trouble_with_input(channel, *input); !trouble.empty()) return trouble;
  }
  if (channels == 0) {
    return "no channel comes from labjack_u6: its scans pace the loop, so [inputs] has to name one "
           "of AIN0 to AIN13";
  }
  for (const std::string& trouble :
       {trouble_with_rate(rate_hz_, channels),
        trouble_with_range("labjack_u6.resolution_index", settings_.resolution_index, 0, 8),
        trouble_with_range("labjack_u6.settling", settings_.settling, 0, 255),
        trouble_with_range("labjack_u6.samples_per_packet",
                           settings_.samples_per_packet.value_or(1), 1, 25),
        trouble_with_range("labjack_u6.transfers", settings_.transfers, 1, 64),
        trouble_with_range("labjack_u6.dac", settings_.dac, 0, 1),
        trouble_with_range("labjack_u6.watchdog_s", settings_.watchdog_s, 0, 65535),
        trouble_with_line("labjack_u6.enable_line", settings_.enable_line),
        trouble_with_line("labjack_u6.amplifier_fault_line", settings_.amplifier_fault_line),
        trouble_with_line("labjack_u6.emergency_stop_line", settings_.emergency_stop_line)}) {
    if (!trouble.empty()) return trouble;
  }
  if (has_watchdog() && *settings_.enable_line >= u6::watchdog_lines) {
    return "labjack_u6.enable_line = " + std::to_string(*settings_.enable_line) +
           ": the board's watchdog reaches the lines 0 to 15 only. Take one of those, or set "
           "watchdog_s = 0";
  }
  const auto same = [](const std::optional<int>& one, const std::optional<int>& other) {
    return one && other && *one == *other;
  };
  if (same(settings_.enable_line, settings_.amplifier_fault_line) ||
      same(settings_.enable_line, settings_.emergency_stop_line)) {
    return "labjack_u6.enable_line = " + std::to_string(*settings_.enable_line) +
           " is an input as well. It needs a line of its own";
  }
  return {};
}

Result LabjackU6Driver::open() {
  if (board_) return {};
  if (std::string trouble = trouble_with_settings(); !trouble.empty()) {
    return refuse(Outcome::needs_attention, std::move(trouble));
  }
  board_ = std::make_unique<Board>();
  rest_v_ = settings_.rest_v;
  // A dead process may have left the line high. What comes later may fail; this needs nothing.
  const u6::Command line_low = enable_line_low();
  if (u6::Trouble trouble =
          board_->link.open(settings_.serial, settings_.enable_line ? &line_low : nullptr)) {
    board_.reset();
    return refuse(trouble->outcome, std::move(trouble->text));
  }
  hold_enable_line_low();
  if (const Result prepared = prepare(); !prepared) {
    hold_enable_line_low();
    board_.reset();
    return prepared;
  }
  description_.name = u6::name_of(board_->link.identity());
  left_on_.clear();
  return {};
}

u6::Command LabjackU6Driver::enable_line_low() {
  u6::Feedback feedback(++echo_);
  if (settings_.enable_line) feedback.set_line(*settings_.enable_line, false);
  return feedback.command();
}

/// As well as it can be done; needs no calibration, and a stream may run.
void LabjackU6Driver::hold_enable_line_low() noexcept {
  if (!settings_.enable_line) return;
  try {
    const u6::Command command = enable_line_low();
    const auto check = [this](std::span<const std::uint8_t> reply) { return answered(reply); };
    static_cast<void>(board_->link.ask("make its enable line low", command, check));
  } catch (...) {  // without memory for a sentence
  }
}

/// The verdict on a Feedback that reads no lines, among late replies to others.
u6::Verdict LabjackU6Driver::answered(std::span<const std::uint8_t> reply) const {
  u6::FeedbackReply out{echo_, 0};
  const u6::Verdict verdict = u6::parse_feedback(reply, false, out);
  if (out.echo != echo_) return u6::Verdict{u6::Verdict::Kind::command};
  return verdict;
}

/// What a board needs before it may be used: silence, its constants, safe outputs.
Result LabjackU6Driver::prepare() {
  u6::BoardLink& link = board_->link;
  constexpr std::uint8_t not_running = 52;
  if (u6::Trouble trouble =
          link.ask("stop a stream", u6::stop_stream(), u6::check_stream_stopped)) {
    if (link.verdict().code != not_running) {
      return refuse(trouble->outcome, std::move(trouble->text));
    }
  }
  link.drain();
  std::array<u6::CalibrationBlock, u6::calibration_blocks> blocks{};
  for (int i = 0; i < u6::calibration_blocks; ++i) {
    auto& block = blocks[static_cast<std::size_t>(i)];
    const auto parse = [&block](std::span<const std::uint8_t> reply) {
      return u6::parse_calibration(reply, block);
    };
    if (u6::Trouble trouble = link.ask("read its calibration", u6::ask_calibration(i), parse)) {
      return refuse(trouble->outcome, std::move(trouble->text));
    }
  }
  board_->calibration = u6::calibration_of(blocks);
  if (const std::string absurd = u6::trouble_with(board_->calibration); !absurd.empty()) {
    return refuse(Outcome::needs_attention,
                  u6::name_of(link.identity()) + ": its calibration memory is empty or damaged: " +
                      absurd + ". Have it calibrated by the vendor, or use another board");
  }
  if (u6::Trouble trouble = link.ask("set its lines", u6::plain_lines(), u6::check_plain_lines)) {
    return refuse(trouble->outcome, std::move(trouble->text));
  }
  if (!make_safe()) return {Outcome::needs_attention, refusal_.c_str()};
  return {};
}

/// Enable line low, the lines that are read inputs, DAC at rest, watchdog asleep. What failed is in
/// refusal_.
bool LabjackU6Driver::make_safe() noexcept {
  try {
    u6::BoardLink& link = board_->link;
    u6::Feedback feedback(++echo_);
    if (settings_.enable_line) feedback.set_line(*settings_.enable_line, false);
    if (settings_.amplifier_fault_line) feedback.make_input(*settings_.amplifier_fault_line);
    if (settings_.emergency_stop_line) feedback.make_input(*settings_.emergency_stop_line);
    feedback.dac(settings_.dac, u6::dac_counts(board_->calibration, settings_.dac, rest_v_));
    const auto check = [this](std::span<const std::uint8_t> reply) { return answered(reply); };
    u6::Trouble trouble = link.ask("switch the amplifier off", feedback.command(), check);
    if (!trouble && has_watchdog()) {
      trouble = link.ask("set its watchdog (watchdog_s = 0 does without)", u6::disarm_watchdog(),
                         u6::check_watchdog);
    }
    if (trouble) refusal_ = std::move(trouble->text);
    return !trouble;
  } catch (...) {
    return false;
  }
}

Result LabjackU6Driver::start() {
  if (!board_) return {Outcome::fatal, "start of a LabJack U6 that is not open"};
  if (running_) return {};
  return begin_stream();
}

Result LabjackU6Driver::begin_stream() {
  u6::BoardLink& link = board_->link;
  u6::StreamPlan plan = plan_of(settings_, inputs_, rate_hz_);
  plan.calibration = board_->calibration;
  const u6::Command configure =
      u6::configure_stream(plan.scan, settings_.resolution_index, plan.samples_per_packet,
                           settings_.settling, plan.clock);
  u6::Trouble trouble =
      link.ask("configure the stream (resolution_index or settling may be too large for this rate)",
               configure, u6::check_stream_configured);
  std::uint32_t lines = 0;
  if (!trouble) {
    const auto check = [&lines](std::span<const std::uint8_t> reply) {
      u6::FeedbackReply out{};
      const u6::Verdict verdict = u6::parse_feedback(reply, true, out);
      lines = out.lines;
      return verdict;
    };
    trouble = link.ask("read its lines", u6::Feedback(++echo_).read_lines().command(), check);
  }
  if (!trouble) {
    trouble = link.ask("start the stream", u6::start_stream(), u6::check_stream_started);
  }
  if (trouble) return refuse(trouble->outcome, std::move(trouble->text));

  auto session = std::make_unique<u6::StreamSession>(link.context(), link.handle(), std::move(plan),
                                                     *lines_, *counts_);
  const bool begun = session->begin();
  board_->session = std::move(session);
  if (!begun) {
    wind_down();
    return refuse(Outcome::temporary,
                  description_.name +
                      ": the transfers of its stream cannot be submitted. Is "
                      "/sys/module/usbcore/parameters/usbfs_memory_mb large enough?");
  }
  power_ = Power::off;
  off_unconfirmed_ = watchdog_armed_ = let_go_ = sent_on_ = false;
  resend_ = true;
  sent_counts_ = u6::dac_counts(board_->calibration, settings_.dac, rest_v_);
  failure_[0] = '\0';
  failure_told_ = false;
  failed_ = 0;
  sent_ns_ = confirmed_ns_ = clock_.now_ns();
  lines_->tell(lines, sent_ns_);  // the grace before the first reply
  running_ = true;
  return {};
}

Result LabjackU6Driver::read(Frame& frame) {
  if (!running_) return {Outcome::fatal, "read of a LabJack U6 that is not started"};
  const u6::StreamSession& session = *board_->session;
  const bool came = wait_for(frame);
  if (power_ == Power::off && session.ended() == u6::StreamEnd::not_ended) {
    const std::int64_t now_ns = clock_.now_ns();
    // So that the lines are known before anybody drives. While the amplifier is on, only write
    // speaks: the watchdog shall see whether it is still called.
    if (worth_sending(sent_counts_, false, now_ns)) {
      collect(now_ns);
      ask_for_lines(now_ns);
      keep_off(sent_counts_, now_ns);
    }
  }
  if (came) return {};
  return session.ended() == u6::StreamEnd::not_ended ? Result{Outcome::no_data} : ended();
}

/// Frames come in bursts, one packet at a time, and so do the set-points of a loop that waits for
/// them: the newest goes out while it waits, as soon as the one before has arrived.
bool LabjackU6Driver::wait_for(Frame& frame) {
  u6::StreamSession& session = *board_->session;
  std::int64_t patience_ns = read_patience_ns;
  while (power_ == Power::on && !let_go_ && wanted_counts_ != sent_counts_ && patience_ns > 0) {
    if (session.next(frame, slice_ns)) return true;
    if (session.ended() != u6::StreamEnd::not_ended) return false;
    patience_ns -= slice_ns;
    const std::int64_t now_ns = clock_.now_ns();
    if (let_go_by_watchdog(now_ns)) let_go_ = true;
    collect(now_ns);
    if (!let_go_) send_set_point(wanted_counts_, true, now_ns);
  }
  return patience_ns > 0 && session.next(frame, patience_ns);
}

Result LabjackU6Driver::ended() {
  const auto say = [this](const char* format, auto... values) {
    std::snprintf(end_text_.data(), end_text_.size(), format, description_.name.c_str(), values...);
    return end_text_.data();
  };
  const u6::StreamSession& session = *board_->session;
  switch (session.ended()) {
    case u6::StreamEnd::not_ended:
      break;
    case u6::StreamEnd::unplugged:
      return {Outcome::lost, say("%s was unplugged")};
    case u6::StreamEnd::usb_error:
      return {Outcome::lost, say("%s: the USB connection failed. Look at cable and hub")};
    case u6::StreamEnd::uncountable:
      return {Outcome::lost, say("%s lost scans and nobody knows how many; its stream has to be "
                                 "started again. Was the machine too busy to read it?")};
    case u6::StreamEnd::board_error: {
      const std::uint8_t code = session.board_error();
      return {Outcome::needs_attention,
              say("%s ended the stream with error %d (%s). A lower loop.rate_hz or "
                  "resolution_index may do",
                  static_cast<int>(code), u6::error_name(code))};
    }
  }
  return {};
}

Result LabjackU6Driver::write(const Actuation& actuation) {
  if (!running_) {
    // Off is what it is already.
    if (!actuation.amplifier_on) return {};
    return {Outcome::fatal, "write to a LabJack U6 that is not started"};
  }
  if (board_->session->ended() == u6::StreamEnd::unplugged) return ended();
  const bool finite = std::isfinite(actuation.drive);
  const bool on = actuation.amplifier_on && finite;
  const std::int64_t now_ns = clock_.now_ns();
  if (let_go_by_watchdog(now_ns)) let_go_ = true;
  if (!actuation.amplifier_on) let_go_ = false;
  if (!on && finite) rest_v_ = actuation.drive;
  const std::uint16_t counts =
      u6::dac_counts(board_->calibration, settings_.dac, finite ? actuation.drive : rest_v_);
  // What is to be off is off before anything else is looked at.
  if ((!on || let_go_) && power_ != Power::off) turn_off(counts, now_ns);
  collect(now_ns);
  ask_for_lines(now_ns);
  if (on && !let_go_) {
    keep_on(counts, now_ns);
  } else {
    keep_off(counts, now_ns);
  }
  if (board_->session->ended() == u6::StreamEnd::unplugged) return ended();
  if (!finite) return {Outcome::fatal, "the commanded drive is not finite"};
  if (let_go_) {
    return {
        Outcome::temporary,
        "no command was confirmed for as long as watchdog_s, so the board's watchdog has let the "
        "amplifier go; it stays off until it was switched off"};
  }
  forget_what_is_over();
  if (failure_[0] == '\0') return {};
  failure_told_ = true;
  return {Outcome::temporary, failure_.data()};
}

/// A failure stands until it was told and a command was confirmed since.
void LabjackU6Driver::forget_what_is_over() {
  if (failed_ == 0 && failure_told_) failure_[0] = '\0';
}

/// The board had no command for so long that its watchdog has, or should have, acted.
bool LabjackU6Driver::let_go_by_watchdog(std::int64_t now_ns) const {
  return has_watchdog() && power_ == Power::on &&
         now_ns - confirmed_ns_ > settings_.watchdog_s * second_ns - on_the_way_ns;
}

void LabjackU6Driver::collect(std::int64_t now_ns) {
  collect_set_point(now_ns);
  collect_off(now_ns);
  collect_watchdog(now_ns);
}

namespace {

using Progress = u6::StreamSession::Progress;

bool failed(const Progress& progress) {
  return progress.kind == Progress::Kind::failed || progress.kind == Progress::Kind::timed_out;
}

constexpr const char* off_failed =
    "switching the amplifier off was not confirmed and is said again";
constexpr const char* not_sent = "the command could not be sent";

unsigned bit_of(u6::Slot slot) { return 1U << static_cast<unsigned>(slot); }

const char* why(const Progress& progress) {
  if (progress.kind == Progress::Kind::timed_out) return "no answer within 0.25 s";
  switch (progress.verdict.kind) {
    case u6::Verdict::Kind::error:
      return u6::error_name(progress.verdict.code);
    case u6::Verdict::Kind::checksum:
      return "the answer was damaged on the way";
    case u6::Verdict::Kind::refused:
      return "the command was damaged on the way";
    default:
      return "the command could not be sent, or the answer was of another shape";
  }
}

}  // namespace

void LabjackU6Driver::note_failure(u6::Slot slot, const char* what, const char* why) {
  failed_ = static_cast<std::uint8_t>(failed_ | bit_of(slot));
  failure_told_ = false;
  std::snprintf(failure_.data(), failure_.size(), "%s: %s: %s", description_.name.c_str(), what,
                why);
}

/// An "off" that was confirmed settles all that went before. A set-point says nothing of an "off",
/// nor of a watchdog that has to be armed first.
void LabjackU6Driver::note_success(u6::Slot slot, std::int64_t sent_ns) {
  confirmed_ns_ = std::max(confirmed_ns_, sent_ns);
  unsigned over = bit_of(slot);
  if (slot == u6::Slot::off) over = ~0U;
  if (slot == u6::Slot::set_point && power_ == Power::off) over |= bit_of(u6::Slot::watchdog);
  failed_ = static_cast<std::uint8_t>(failed_ & ~over);
}

void LabjackU6Driver::collect_set_point(std::int64_t now_ns) {
  const Progress progress = board_->session->progress(u6::Slot::set_point, now_ns);
  if (progress.kind == Progress::Kind::done) note_success(u6::Slot::set_point, progress.sent_ns);
  if (!failed(progress)) return;
  resend_ = true;
  note_failure(u6::Slot::set_point, "a set-point did not arrive", why(progress));
}

void LabjackU6Driver::collect_off(std::int64_t now_ns) {
  const Progress progress = board_->session->progress(u6::Slot::off, now_ns);
  if (progress.kind == Progress::Kind::done) {
    off_unconfirmed_ = false;
    note_success(u6::Slot::off, progress.sent_ns);
  }
  if (!failed(progress)) return;
  note_failure(u6::Slot::off, off_failed, why(progress));
}

void LabjackU6Driver::collect_watchdog(std::int64_t now_ns) {
  const Progress progress = board_->session->progress(u6::Slot::watchdog, now_ns);
  if (progress.kind == Progress::Kind::done) {
    watchdog_armed_ = arming_;
    note_success(u6::Slot::watchdog, progress.sent_ns);
  }
  if (!failed(progress)) return;
  watchdog_armed_ = !arming_;  // as far as is known; it is told once more
  note_failure(u6::Slot::watchdog, "its watchdog was not set", why(progress));
}

bool LabjackU6Driver::reads_lines() const {
  return settings_.amplifier_fault_line || settings_.emergency_stop_line;
}

/// Nothing else hangs on the answer, so nothing is told where it stays away as well.
void LabjackU6Driver::ask_for_lines(std::int64_t now_ns) {
  if (!reads_lines()) return;
  u6::StreamSession& session = *board_->session;
  session.progress(u6::Slot::lines, now_ns);
  if (now_ns - lines_->asked_ns() < ask_lines_after_ns || !session.free(u6::Slot::lines)) return;
  u6::Feedback feedback(++echo_);
  session.send(u6::Slot::lines, feedback.read_lines().command(), echo_, now_ns);
}

void LabjackU6Driver::turn_off(std::uint16_t counts, std::int64_t now_ns) {
  power_ = Power::off;
  sent_on_ = false;
  off_unconfirmed_ = true;
  u6::StreamSession& session = *board_->session;
  // While an "off" is under way no "on" has been sent, so it is the last word already.
  if (!session.free(u6::Slot::off)) return;
  u6::Feedback feedback(++echo_);
  if (settings_.enable_line) feedback.set_line(*settings_.enable_line, false);
  feedback.dac(settings_.dac, counts).read_lines();
  if (session.send(u6::Slot::off, feedback.command(), echo_, now_ns)) {
    sent_ns_ = now_ns;
    sent_counts_ = counts;
  } else {
    note_failure(u6::Slot::off, off_failed, not_sent);
  }
}

void LabjackU6Driver::keep_off(std::uint16_t counts, std::int64_t now_ns) {
  u6::StreamSession& session = *board_->session;
  if (off_unconfirmed_) {
    if (session.free(u6::Slot::off)) turn_off(counts, now_ns);
    return;
  }
  if (watchdog_armed_ && session.free(u6::Slot::watchdog)) {
    arming_ = false;
    session.send(u6::Slot::watchdog, u6::disarm_watchdog(), 0, now_ns);
  }
  if (worth_sending(counts, false, now_ns)) send_set_point(counts, false, now_ns);
}

void LabjackU6Driver::keep_on(std::uint16_t counts, std::int64_t now_ns) {
  if (off_unconfirmed_) {  // first that is settled
    keep_off(counts, now_ns);
    return;
  }
  if (!guarded(now_ns)) return;
  power_ = Power::on;
  wanted_counts_ = counts;
  if (worth_sending(counts, true, now_ns)) send_set_point(counts, true, now_ns);
}

/// Whether the watchdog is known to be armed; else it is told to be.
bool LabjackU6Driver::guarded(std::int64_t now_ns) {
  if (!has_watchdog() || power_ == Power::on) return true;
  if (power_ == Power::arming && watchdog_armed_) return true;
  // Where a disarming is under way, that comes first: what counts is what was said last.
  if (board_->session->free(u6::Slot::watchdog)) {
    power_ = Power::arming;
    watchdog_armed_ = false;
    arming_ = true;
    const u6::Command arm =
        u6::arm_watchdog(static_cast<std::uint16_t>(settings_.watchdog_s), *settings_.enable_line);
    board_->session->send(u6::Slot::watchdog, arm, 0, now_ns);
  }
  return false;
}

bool LabjackU6Driver::worth_sending(std::uint16_t counts, bool on, std::int64_t now_ns) const {
  if (resend_ || counts != sent_counts_ || on != sent_on_) return true;
  std::int64_t quiet_ns = second_ns;
  if (reads_lines()) quiet_ns = line_period_ns;
  if (has_watchdog()) quiet_ns = std::min(quiet_ns, settings_.watchdog_s * second_ns / 3);
  return now_ns - sent_ns_ >= quiet_ns;
}

void LabjackU6Driver::send_set_point(std::uint16_t counts, bool on, std::int64_t now_ns) {
  u6::StreamSession& session = *board_->session;
  if (!session.free(u6::Slot::set_point)) return;  // the next write brings a newer one
  u6::Feedback feedback(++echo_);
  feedback.dac(settings_.dac, counts);
  if (settings_.enable_line) feedback.set_line(*settings_.enable_line, on);
  feedback.read_lines();
  if (!session.send(u6::Slot::set_point, feedback.command(), echo_, now_ns)) {
    note_failure(u6::Slot::set_point, "a set-point did not arrive", not_sent);
    return;
  }
  resend_ = false;
  sent_on_ = on;
  sent_counts_ = counts;
  sent_ns_ = now_ns;
}

Signals LabjackU6Driver::signals() const noexcept {
  if (!running_) return {};
  const std::int64_t asked_ns = lines_->asked_ns();
  const std::uint32_t lines = lines_->levels();
  const bool old = clock_.now_ns() - asked_ns > oldest_lines_ns;
  const auto low = [lines, old](const std::optional<int>& line) {
    return line && (old || ((lines >> static_cast<unsigned>(*line)) & 1U) == 0);
  };
  return {low(settings_.emergency_stop_line), low(settings_.amplifier_fault_line)};
}

Counts LabjackU6Driver::counts() const noexcept {
  const auto value = [](const auto& count) { return count.load(std::memory_order_relaxed); };
  constexpr const char* board = "LabJack U6";
  Counts all;
  all.add({board, "packets_lost", value(counts_->packets_lost)});
  all.add({board, "packets_damaged", value(counts_->packets_damaged)});
  all.add({board, "overflows", value(counts_->overflows)});
  all.add({board, "scans_thrown_away", value(counts_->scans_thrown_away)});
  all.add({board, "scans_lost", value(counts_->scans_lost)});
  all.add({board, "fullest_backlog_of_256", value(counts_->fullest_backlog), Count::Kind::level});
  return all;
}

void LabjackU6Driver::stop() noexcept {
  if (!running_) return;
  running_ = false;
  if (board_->session->ended() != u6::StreamEnd::unplugged) {
    turn_off(u6::dac_counts(board_->calibration, settings_.dac, rest_v_), clock_.now_ns());
  }
  wind_down();
}

/// Ends the session and, where the board is still there, its stream.
void LabjackU6Driver::wind_down() noexcept {
  const bool unplugged = board_->session->ended() == u6::StreamEnd::unplugged;
  if (!board_->session->end()) {
    // The kernel still writes into this memory. Better lost than used twice.
    static_cast<void>(board_->session.release());
    board_->link.abandon();
    board_.reset();
    if (!unplugged) note_left_on("the kernel kept its transfers");
    return;
  }
  board_->session.reset();
  // Without its USB the board is without power: its lines let go.
  if (unplugged) return;
  bool safe = make_safe();
  try {
    static_cast<void>(
        board_->link.ask("stop the stream", u6::stop_stream(), u6::check_stream_stopped));
  } catch (...) {  // without memory for a sentence
  }
  board_->link.drain();
  // What was in the way may have been the stream, or a reply to something else.
  if (!safe) safe = make_safe();
  if (!safe) note_left_on(refusal_.c_str());
}

void LabjackU6Driver::note_left_on(const char* why) noexcept {
  try {
    left_on_ = description_.name +
               ": its enable line may still be high: press the emergency stop, then look at cable "
               "and board. The last \"off\" was not confirmed: " +
               why;
  } catch (...) {  // without memory for a sentence
  }
}

void LabjackU6Driver::close() noexcept {
  stop();
  board_.reset();
}

std::vector<Attached> find_labjack_u6() { return u6::find_boards(); }

}  // namespace stickslip::drivers
