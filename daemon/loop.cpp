// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace stickslip::daemon {
namespace {

using drivers::Outcome;

constexpr std::size_t notice_capacity = 1024;
constexpr std::size_t command_capacity = 64;
/// About a thousandth of what a ring holds: frequent wake-ups cost more than the wait itself.
constexpr std::int64_t consumer_wait_ns = 500'000;
constexpr std::int64_t consumer_timeout_ns = 2'000'000'000;

constexpr bool is_fault(Outcome outcome) {
  return outcome != Outcome::ok && outcome != Outcome::no_data && outcome != Outcome::end_of_data;
}

LoopSettings with_defaults(LoopSettings settings) {
  if (settings.lateness_limit_ns <= 0) settings.lateness_limit_ns = settings.period_ns;
  return settings;
}

/// The cycle at which the ramp down has to begin.
std::uint64_t ramp_down_cycle(const LoopSettings& settings) {
  const double frames =
      std::ceil(settings.ramp_s * 1e9 / static_cast<double>(settings.period_ns)) + 1.0;
  const auto ramp = static_cast<std::uint64_t>(std::max(0.0, frames));
  return *settings.frames > ramp ? *settings.frames - ramp : 0;
}

}  // namespace

Loop::Loop(drivers::Driver& driver, Clock& clock, const LoopSettings& settings,
           Excitation excitation, Observer* observer, Ledger& ledger, std::vector<Stream*> streams)
    : driver_(driver),
      clock_(clock),
      settings_(with_defaults(settings)),
      excitation_(std::move(excitation)),
      observer_(observer),
      ledger_(ledger),
      streams_(std::move(streams)),
      can_drive_(driver.description().can_drive),
      pacer_(clock,
             {settings_.pacing, settings_.period_ns, settings_.lateness_limit_ns, can_drive_}),
      frame_time_(!pacer_.has_deadlines() || driver.description().stepped_time),
      sequencer_(settings_.period_ns),
      interlocks_(settings.live.interlocks, driver.description().channels),
      notices_(notice_capacity),
      commands_(command_capacity),
      answers_(command_capacity) {
  end_.message.reserve(sizeof Notice::text);
  if (settings_.frames) stop_at_cycle_ = ramp_down_cycle(settings_);
}

const LoopEnd& Loop::run() {
  if (begin()) {
    do {
      wait();
    } while (cycle());
  }
  end();
  return end_;
}

bool Loop::begin() {
  const drivers::Result result = driver_.start();
  // A device without output needs no operator to clear it.
  if (!can_drive_) apply(RigInput::clear);
  if (settings_.start_at_once) {
    for (const RigInput input : {RigInput::clear, RigInput::arm, RigInput::start}) apply(input);
    excitation_.start();
  }
  read_ns_ = clock_.now_ns();
  const std::int64_t origin_ns = read_ns_ - settings_.period_ns;
  pacer_.start(origin_ns);
  if (!result) {
    const bool fault = is_fault(result.outcome);
    interlocks_.read_result({fault ? result.outcome : Outcome::fatal, result.message}, origin_ns);
    check_interlocks();
    if (settings_.end_on_fault) finish(LoopEnd::Reason::fault);
  }
  publish_snapshot(origin_ns);
  return end_.reason == LoopEnd::Reason::none;
}

void Loop::end() {
  // Whatever the reason: the last command to the shaker is "off".
  if (can_drive_ && device_present()) driver_.write({0.0, false});
  amplifier_on_ = false;
  excitation_.cut();
  apply(RigInput::stop);
  apply(RigInput::at_rest);
  if (device_present()) {
    driver_.stop();
    if (const char* left_on = driver_.left_on()) notify(Notice::Kind::left_on, 0, 0, left_on);
  }
  publish_snapshot(clock_.now_ns());
}

bool Loop::next_answer(Answer& answer) {
  const Answer* const next = answers_.front();
  if (next == nullptr) return false;
  answer = *next;
  answers_.pop();
  return true;
}

bool Loop::next_notice(Notice& notice) {
  const Notice* const next = notices_.front();
  if (next == nullptr) return false;
  notice = *next;
  notices_.pop();
  return true;
}

void Loop::wait() {
  wakeup_ = pacer_.wait(device_present());
  if (!frame_time_) elapsed_ns_ = wakeup_.elapsed_ns;
  if (wakeup_.overrun_ns > 0) {
    const auto skipped = static_cast<std::uint64_t>(wakeup_.skipped);
    count_up(timing_.overruns);
    count_up(timing_.skipped_periods, skipped);
    if (wakeup_.overrun_ns > timing_.longest_overrun_ns.load(std::memory_order_relaxed)) {
      timing_.longest_overrun_ns.store(wakeup_.overrun_ns, std::memory_order_relaxed);
    }
    notify(Notice::Kind::overrun, skipped, wakeup_.overrun_ns);
  }
  if (wakeup_.lateness_ns) timing_.lateness.add(*wakeup_.lateness_ns);
  if (wakeup_.late) count_up(timing_.late);
}

bool Loop::cycle() {
  const std::int64_t start_ns = clock_.now_ns();
  if (device_.load(std::memory_order_acquire) == Device::restored) attach_device();
  handle_stop_requests();
  handle_command();
  const bool at_rest = !amplifier_on_;
  bool more = true;
  interlocks_.observer_restarted(false);
  if (device_present()) {
    more = read();
  } else {
    ++cycles_without_device_;
    sequencer_.skip_cycle();
  }
  check_interlocks();
  drive();
  count_up(timing_.cycles);
  const std::int64_t ended_ns = clock_.now_ns();
  if (pacer_.has_deadlines()) timing_.work.add(ended_ns - start_ns);
  const bool over = is_over(more, at_rest);
  publish_snapshot(ended_ns);
  return !over;
}

bool Loop::is_over(bool more, bool at_rest) {
  if (safety_.faulted() && settings_.end_on_fault) {
    finish(LoopEnd::Reason::fault);
  } else if (!more) {
    finish(LoopEnd::Reason::end_of_data);
  } else if (settings_.frames && cycles_of_rig_time() >= *settings_.frames) {
    finish(LoopEnd::Reason::frames_done);
  } else if (stop_requests_.load(std::memory_order_acquire) > 0 && excitation_.is_off() &&
             at_rest) {
    // Not earlier: the frame that was just handed over shows the shaker at rest.
    finish(LoopEnd::Reason::requested);
  }
  return end_.reason != LoopEnd::Reason::none;
}

void Loop::handle_stop_requests() {
  const int requests = stop_requests_.load(std::memory_order_acquire);
  if (requests > 0 || (settings_.frames && cycles_of_rig_time() >= stop_at_cycle_)) {
    if (apply(RigInput::stop)) excitation_.stop();
  }
  if (requests > 1) excitation_.cut();
}

// One command a cycle: a burst of them takes no more of any cycle than a single one.
void Loop::handle_command() {
  const Command* const command = commands_.front();
  // The command waits while there is no space for its answer.
  if (command == nullptr || answers_.full()) return;
  Answer answer;
  answer.id = command->id;
  answer.accepted = true;
  execute(*command, answer);
  const bool answered_later = command->kind == Command::Kind::average && answer.accepted;
  commands_.pop();
  answer.state = safety_.state();
  if (!answered_later) answers_.push(answer);
}

// Ends the averaging: with the average, or with the reason why there is none.
void Loop::answer_average(const Cause* refusal) {
  Answer answer;
  answer.id = averaging_.id();
  answer.state = safety_.state();
  const Average average = averaging_.take();
  if (refusal == nullptr) {
    answer.accepted = true;
    answer.average = average;
  } else {
    answer.reason = *refusal;
  }
  answers_.push(answer);
}

void Loop::execute(const Command& command, Answer& answer) {
  const auto refuse = [&answer](std::string_view reason) {
    answer.accepted = false;
    answer.reason.add(reason);
  };
  const Interlocks::Broken broken = interlocks_.broken(clock_.now_ns());
  switch (command.kind) {
    case Command::Kind::clear:
      if (!safety_.faulted()) return refuse("there is no fault to clear");
      if (latches_at_rest(broken.interlock) && refuse_if_broken(broken, answer)) return;
      apply(RigInput::clear);
      return;
    case Command::Kind::arm:
      if (safety_.state() != RigState::idle) return refuse("only an idle rig can be armed");
      if (refuse_if_broken(broken, answer)) return;
      if (!can_drive_) return refuse("this device has no output to drive a shaker with");
      apply(RigInput::arm);
      return;
    case Command::Kind::start:
      if (safety_.state() != RigState::armed) return refuse("only an armed rig can be started");
      if (!excitation_.enabled()) return refuse("excitation.enabled is false");
      dead_man_ = command.dead_man;
      apply(RigInput::start);
      excitation_.start();
      return;
    case Command::Kind::disarm:
    case Command::Kind::stop:
      apply(command.kind == Command::Kind::stop ? RigInput::stop : RigInput::disarm);
      excitation_.stop();
      return;
    case Command::Kind::set:
      excitation_.set(command.setting);
      return;
    case Command::Kind::apply:
      settings_.live = command.live;
      interlocks_.set(command.live.interlocks);
      return;
    case Command::Kind::average:
      if (averaging_.active()) return refuse("readings are being averaged for another client");
      if (!device_present()) return refuse("the device is lost");
      averaging_.begin(command.frames, command.id);
      return;
    case Command::Kind::drive:
      if (command.excitation == nullptr) return refuse("there is no drive");
      drive_by(*command.excitation, answer);
      return;
    case Command::Kind::observe:
      if (safety_.faulted()) {
        answer.reason.add("the rig is faulted: ").add(safety_.cause().c_str());
        answer.accepted = false;
        return;
      }
      if (command.observer == nullptr) return refuse("there is no observer");
      if (refuse_if_broken(broken, answer)) return;
      observe_by(*command.observer, answer);
      return;
  }
}

// Between two frames. Everything was allocated elsewhere, where the present observer is freed too.
void Loop::observe_by(Observer& next, Answer& answer) {
  if (observer_ != nullptr) answer.continuation = next.continue_from(*observer_);
  observer_ = &next;
  observer_restarts_ = next.latest().restarts;
  add_latest_frame(answer);
}

// The drive of a rig that moves must not jump.
void Loop::drive_by(Excitation& next, Answer& answer) {
  const RigState state = safety_.state();
  if ((state != RigState::idle && state != RigState::armed) || !excitation_.is_off()) {
    answer.accepted = false;
    answer.reason.add("the drive can be changed only while the rig is idle or armed");
    return;
  }
  std::swap(excitation_, next);
  add_latest_frame(answer);
}

void Loop::add_latest_frame(Answer& answer) const {
  if (!latest_) return;
  answer.time_ns = latest_->time_ns;
  answer.sequence = latest_->sequence;
}

bool Loop::refuse_if_broken(const Interlocks::Broken& broken, Answer& answer) const {
  if (broken.interlock == Interlock::none) return false;
  answer.accepted = false;
  answer.reason.add(name_of(broken.interlock)).add(": ").add(broken.cause.c_str());
  return true;
}

bool Loop::apply(RigInput input) {
  if (!safety_.apply(input)) return false;
  if (safety_.state() == RigState::idle) dead_man_ = false;
  notify(Notice::Kind::state, 0, 0, name_of(safety_.state()));
  return true;
}

void Loop::attach_device() {
  device_.store(Device::present, std::memory_order_relaxed);
  interlocks_.device_restored();
  sequencer_.restart_numbering();
  read_failing_ = false;
  write_failing_ = false;
  notify(Notice::Kind::device_back);
}

/// False at the end of the data.
bool Loop::read() {
  Frame raw;
  const std::int64_t start_ns = clock_.now_ns();
  const drivers::Result result = driver_.read(raw);
  const std::int64_t now_ns = clock_.now_ns();
  read_ns_ = now_ns;
  timing_.read.add(now_ns - start_ns);
  interlocks_.read_result(result, now_ns);
  interlocks_.signals(driver_.signals());
  if (result) {
    read_failing_ = false;
    acquire(raw);
  } else if (is_fault(result.outcome)) {
    count_up(timing_.failed_reads);
    if (!read_failing_) notify(Notice::Kind::read_failed, 0, 0, result.message);
    read_failing_ = true;
  } else if (result.outcome == Outcome::end_of_data) {
    notify(Notice::Kind::end_of_data);
    return false;
  }
  return true;
}

void Loop::acquire(Frame raw) {
  if (!sequence(raw)) return;
  raw_ = raw;
  if (averaging_.active() && averaging_.add(raw)) answer_average(nullptr);
  const Calibrated si = calibrate(raw);
  interlocks_.frame(si.frame, si.not_finite, read_ns_);
  excitation_.observe(si.frame, amplifier_on_);

  Sample sample;
  sample.frame = si.frame;
  sample.drive = applied_;
  sample.amplifier_on = amplifier_on_;
  sample.late = wakeup_.late;
  sample.state = safety_.state();
  sample.number = frames_++;
  latest_ = si.frame;
  const Estimate* const estimate = observe(si.frame);
  const bool due = frames_ % settings_.frames_per_estimate == 0;
  hand_over(sample, due ? estimate : nullptr);
}

/// False for a frame that is to be left out: what has been handed over stays.
bool Loop::sequence(Frame& raw) {
  const FramePlacement placement = sequencer_.place(raw, read_ns_);
  if (!placement.accepted) {
    count_up(timing_.repeated);
    if (placement.first_repeat) notify(Notice::Kind::sequence_repeated, raw.sequence);
    return false;
  }
  if (placement.missing > 0) {
    count_up(timing_.missing_at_source, placement.missing);
    notify(Notice::Kind::frames_missing, placement.missing);
  }
  if (placement.jump_ns != 0) notify(Notice::Kind::clock_jumped, 0, placement.jump_ns);
  if (frame_time_) elapsed_ns_ = placement.step_ns;
  return true;
}

Calibrated Loop::calibrate(const Frame& raw) {
  const Calibrated si = calibrated(raw, settings_.live.calibration);
  if (si.not_finite != 0) {
    count_up(timing_.not_finite, static_cast<std::uint64_t>(std::popcount(si.not_finite)));
    report_new_channels(Notice::Kind::not_finite, si.not_finite, not_finite_);
  }
  report_new_channels(Notice::Kind::beyond_calibration, si.out_of_range, beyond_calibration_);
  beyond_calibration_ = si.out_of_range;
  not_finite_ = si.not_finite;
  return si;
}

/// Null without an observer.
const Estimate* Loop::observe(const Frame& frame) {
  if (observer_ == nullptr) return nullptr;
  const Estimate& estimate = observer_->update(frame);
  if (estimate.restarts != observer_restarts_) {
    notify(Notice::Kind::estimate_restarted);
    interlocks_.observer_restarted(true);
  }
  observer_restarts_ = estimate.restarts;
  return &estimate;
}

// A notice for each channel in `now` that is not in `before`.
void Loop::report_new_channels(Notice::Kind kind, std::uint8_t now, std::uint8_t before) {
  for (const Channel channel : all_channels) {
    const unsigned bit = 1U << index_of(channel);
    if ((now & bit) != 0 && (before & bit) == 0) notify(kind, index_of(channel));
  }
}

void Loop::hand_over(const Sample& sample, const Estimate* estimate) {
  ledger_.produce();
  for (Stream* stream : streams_) {
    if (pacer_.waits_for_consumers()) wait_for_consumer(*stream);
    if (estimate != nullptr) stream->offer({sample.number, *estimate});
    stream->offer(sample);
  }
}

// Simulated time can pause, but a stop must not wait for a consumer that hangs.
void Loop::wait_for_consumer(const Stream& stream) {
  while (stream.full()) {
    const std::int64_t now_ns = clock_.now_ns();
    const int requests = stop_requests_.load(std::memory_order_acquire);
    if (requests > 0 && give_up_ns_ == 0) give_up_ns_ = now_ns + consumer_timeout_ns;
    if (requests > 1 || (requests > 0 && now_ns >= give_up_ns_)) return;
    clock_.sleep_until(now_ns + consumer_wait_ns);
  }
}

// A broken interlock is detected in the cycle in which it breaks, before the next write.
void Loop::check_interlocks() {
  // As of the device's answer: a thread that was delayed since then does not make a channel stale.
  const std::int64_t now_ns = device_present() ? read_ns_ : clock_.now_ns();
  interlocks_.cycle_late(wakeup_.overrun_ns);
  if (settings_.recorder != nullptr) interlocks_.recorder(settings_.recorder->failing());
  interlocks_.dead_man(dead_man_ ? std::optional(kept_alive_ns_.load(std::memory_order_acquire))
                                 : std::nullopt);
  broken_ = interlocks_.broken(now_ns);
  if (broken_.interlock != Interlock::none) trip(broken_);
}

void Loop::trip(const Interlocks::Broken& broken) {
  if (safety_.trip(broken.interlock, broken.cause, broken.outcome)) {
    dead_man_ = false;
    notify(Notice::Kind::fault, static_cast<std::uint64_t>(broken.interlock), 0,
           broken.cause.c_str());
  }
}

void Loop::drive() {
  const double elapsed_s = static_cast<double>(elapsed_ns_) * 1e-9;
  if (frame_time_) elapsed_ns_ = 0;  // until the next frame
  if (safety_.amplifier_allowed()) {
    excitation_.advance(elapsed_s);
    const bool finite = std::isfinite(excitation_.now().value);
    interlocks_.drive(finite);
    if (!finite) check_interlocks();
    // At rest after a stop, or at the end of a drive file.
    if (excitation_.is_off() && excitation_.enabled()) {
      apply(RigInput::stop);
      apply(RigInput::at_rest);
    }
  }
  if (!safety_.amplifier_allowed()) excitation_.cut();
  interlocks_.drive(true);
  const bool was_faulted = safety_.faulted();
  apply_drive();
  if (can_drive_ && safety_.faulted() && !was_faulted) {
    // The write itself tripped: repeat "off" in the same cycle.
    excitation_.cut();
    apply_drive();
  }
  release_lost_device();
}

// Independent of more serious interlocks: an emergency stop at the same time does not bring a lost
// device back.
void Loop::release_lost_device() {
  const Interlocks::Broken device = interlocks_.device_broken(read_ns_);
  if (device.interlock == Interlock::none || !device_present() || settings_.end_on_fault) return;
  device_failed_.store(device.outcome == Outcome::fatal, std::memory_order_release);
  device_.store(Device::lost, std::memory_order_release);
  if (averaging_.active()) answer_average(&device.cause);
}

void Loop::apply_drive() {
  applied_ = excitation_.now();
  amplifier_on_ = can_drive_ && safety_.amplifier_allowed() && !excitation_.is_off();
  if (!can_drive_ || !device_present()) return;
  const drivers::Result result = driver_.write({applied_.value, amplifier_on_});
  interlocks_.write_result(result, clock_.now_ns());
  if (is_fault(result.outcome)) {
    count_up(timing_.failed_writes);
    if (!write_failing_) notify(Notice::Kind::write_failed, 0, 0, result.message);
    check_interlocks();
  }
  write_failing_ = is_fault(result.outcome);
}

void Loop::finish(LoopEnd::Reason reason) {
  if (safety_.faulted() && reason == LoopEnd::Reason::fault) {
    end_.outcome = safety_.outcome();
    // Capacity was reserved: no allocation even here.
    const std::string_view cause(safety_.cause().c_str());
    end_.message.assign(cause.data(), std::min(cause.size(), end_.message.capacity()));
  }
  end_.reason = reason;
}

void Loop::publish_snapshot(std::int64_t now_ns) {
  Snapshot out;
  out.clock_ns = now_ns;
  out.state = safety_.state();
  out.interlock = safety_.interlock();
  out.cause = safety_.cause();
  out.broken = broken_.interlock;
  out.broken_cause = broken_.cause;
  out.amplifier_on = amplifier_on_;
  out.device_present = device_present();
  out.late = wakeup_.late;
  // A lost device is closed and opened by another thread.
  if (device_present()) signals_ = driver_.signals();
  out.signals = signals_;
  out.drive = applied_;
  out.raw = raw_;
  if (latest_) out.frame = *latest_;
  out.frames = frames_;
  snapshot_.write(out);
}

void Loop::notify(Notice::Kind kind, std::uint64_t count, std::int64_t duration_ns,
                  const char* text) {
  Notice out;
  out.kind = kind;
  if (latest_) {
    out.time_ns = latest_->time_ns;
    out.sequence = latest_->sequence;
  }
  out.count = count;
  out.duration_ns = duration_ns;
  out.set_text(text);
  if (!notices_.push(out)) count_up(timing_.lost_events);
}

}  // namespace stickslip::daemon
