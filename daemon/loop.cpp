#include "daemon/loop.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "daemon/deadline.h"

namespace stickslip::daemon {
namespace {

using drivers::Outcome;

constexpr std::size_t notice_room = 1024;
constexpr std::size_t command_room = 64;
/// A step of the source's time that is longer is a gap, or a clock that was set: nothing to drive
/// by.
constexpr std::int64_t longest_step_ns = 1'000'000'000;
/// A thousandth or so of what a ring holds: waking up often costs more than what it waits for.
constexpr std::int64_t ring_wait_ns = 500'000;
constexpr std::int64_t ring_patience_ns = 2'000'000'000;

constexpr bool is_fault(Outcome outcome) {
  return outcome != Outcome::ok && outcome != Outcome::no_data && outcome != Outcome::end_of_data;
}

}  // namespace

Loop::Loop(drivers::Driver& driver, Clock& clock, const LoopSettings& settings,
           Excitation excitation, Observer* observer, Ledger& ledger, std::vector<Stream*> streams)
    : driver_(driver),
      clock_(clock),
      settings_(settings),
      excitation_(std::move(excitation)),
      observer_(observer),
      ledger_(ledger),
      streams_(std::move(streams)),
      can_drive_(driver.description().can_drive),
      own_clock_(driver.description().own_clock),
      time_of_frames_(settings.pacing != Pacing::deadlines || driver.description().time_of_its_own),
      interlocks_(settings.live.interlocks, driver.description().channels),
      notices_(notice_room),
      commands_(command_room),
      answers_(command_room) {
  why_.message.reserve(sizeof Notice::text);
  if (settings_.lateness_limit_ns <= 0) settings_.lateness_limit_ns = settings_.period_ns;
  if (settings_.frames) {
    const double ramp_frames =
        std::ceil(settings_.ramp_s * 1e9 / static_cast<double>(settings_.period_ns)) + 1.0;
    const auto ramp = static_cast<std::uint64_t>(std::max(0.0, ramp_frames));
    stop_at_cycle_ = *settings_.frames > ramp ? *settings_.frames - ramp : 0;
  }
}

const LoopEnd& Loop::run() {
  if (begin()) {
    do {
      wait();
    } while (cycle());
  }
  end();
  return why_;
}

bool Loop::begin() {
  const drivers::Result result = driver_.start();
  // There is nothing to be careful with.
  if (!can_drive_) change(RigInput::clear);
  if (settings_.start_at_once) {
    for (const RigInput input : {RigInput::clear, RigInput::arm, RigInput::start}) change(input);
    excitation_.start();
  }
  answered_ns_ = clock_.now_ns();
  due_ns_ = answered_ns_ - settings_.period_ns;
  if (!result) {
    const bool fault = is_fault(result.outcome);
    interlocks_.read_answered({fault ? result.outcome : Outcome::fatal, result.message}, due_ns_);
    judge();
    if (settings_.end_on_fault) finish(LoopEnd::Reason::fault);
  }
  publish(due_ns_);
  return why_.reason == LoopEnd::Reason::none;
}

void Loop::end() {
  // Whatever happened before: the last word to the shaker is "off".
  if (can_drive_ && device_here()) driver_.write({0.0, false});
  amplifier_on_ = false;
  excitation_.cut();
  change(RigInput::stop);
  change(RigInput::at_rest);
  if (device_here()) {
    driver_.stop();
    if (const char* left_on = driver_.left_on()) notice(Notice::Kind::left_on, 0, 0, left_on);
  }
  publish(clock_.now_ns());
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
  late_ = false;
  overrun_ns_ = 0;
  if (!device_here() && settings_.pacing != Pacing::deadlines) return wait_without_device();
  if (settings_.pacing == Pacing::driver && can_drive_) look_for_a_stall();
  if (settings_.pacing != Pacing::deadlines) return;
  const Deadline next = next_deadline(due_ns_, settings_.period_ns, clock_.now_ns());
  if (!time_of_frames_) elapsed_ns_ = next.due_ns - due_ns_;
  due_ns_ = next.due_ns;
  // The first cycle has no deadline before it that it could have missed.
  if (next.late_ns > 0 && timing_.cycles.load(std::memory_order_relaxed) > 0) {
    overrun_ns_ = next.late_ns;
    count_up(timing_.overruns);
    count_up(timing_.skipped_periods, static_cast<std::uint64_t>(next.skipped));
    if (next.late_ns > timing_.longest_overrun_ns.load(std::memory_order_relaxed)) {
      timing_.longest_overrun_ns.store(next.late_ns, std::memory_order_relaxed);
    }
    notice(Notice::Kind::overrun, static_cast<std::uint64_t>(next.skipped), next.late_ns);
  } else {
    clock_.sleep_until(due_ns_);
  }
  const std::int64_t lateness_ns = clock_.now_ns() - due_ns_;
  timing_.lateness.add(lateness_ns);
  late_ = overrun_ns_ > 0 || lateness_ns > settings_.lateness_limit_ns;
  if (late_) count_up(timing_.late);
}

// A board goes on sampling while the loop is held up, and hands over at once what has waited: then
// the drive would be played faster than it was meant.
void Loop::look_for_a_stall() {
  const std::int64_t now_ns = clock_.now_ns();
  const std::int64_t allowed_ns = drivers::longest_paced_wait_ns + settings_.lateness_limit_ns;
  if (begun_ns_ && now_ns - *begun_ns_ > allowed_ns) {
    overrun_ns_ = now_ns - *begun_ns_ - drivers::longest_paced_wait_ns;
    late_ = true;
    count_up(timing_.late);
    count_up(timing_.overruns);
    if (overrun_ns_ > timing_.longest_overrun_ns.load(std::memory_order_relaxed)) {
      timing_.longest_overrun_ns.store(overrun_ns_, std::memory_order_relaxed);
    }
    notice(Notice::Kind::overrun, 0, overrun_ns_);
  }
  begun_ns_ = now_ns;
}

// A driver that paces the loop is gone: somebody has to.
void Loop::wait_without_device() {
  begun_ns_.reset();
  const std::int64_t now_ns = clock_.now_ns();
  due_ns_ = now_ns + settings_.period_ns;
  clock_.sleep_until(due_ns_);
}

bool Loop::cycle() {
  const std::int64_t begun_ns = clock_.now_ns();
  if (device_.load(std::memory_order_acquire) == Device::back) welcome_device();
  heed_stop_requests();
  heed_command();
  const bool at_rest = !amplifier_on_;
  bool more = true;
  interlocks_.observer_restarted(false);
  if (device_here()) {
    more = read();
  } else {
    ++cycles_without_device_;
    ++cycles_away_;
  }
  judge();
  drive();
  count_up(timing_.cycles);
  const std::int64_t ended_ns = clock_.now_ns();
  if (settings_.pacing == Pacing::deadlines) timing_.work.add(ended_ns - begun_ns);
  const bool over = is_over(more, at_rest);
  publish(ended_ns);
  return !over;
}

bool Loop::is_over(bool more, bool at_rest) {
  const std::uint64_t cycles = frames_ + cycles_without_device_;
  if (safety_.faulted() && settings_.end_on_fault) {
    finish(LoopEnd::Reason::fault);
  } else if (!more) {
    finish(LoopEnd::Reason::end_of_data);
  } else if (settings_.frames && cycles >= *settings_.frames) {
    finish(LoopEnd::Reason::frames_done);
  } else if (stop_requests_.load(std::memory_order_acquire) > 0 && excitation_.is_off() &&
             at_rest) {
    // Only now: the frame that was just handed over shows the shaker at rest.
    finish(LoopEnd::Reason::asked);
  }
  return why_.reason != LoopEnd::Reason::none;
}

void Loop::heed_stop_requests() {
  const int requests = stop_requests_.load(std::memory_order_acquire);
  const std::uint64_t cycles = frames_ + cycles_without_device_;
  if (requests > 0 || (settings_.frames && cycles >= stop_at_cycle_)) {
    if (change(RigInput::stop)) excitation_.stop();
  }
  if (requests > 1) excitation_.cut();
}

// One a cycle: a burst of commands takes no more of any cycle than one of them does.
void Loop::heed_command() {
  const Command* const command = commands_.front();
  // An answer that finds no room would be lost: the command waits.
  if (command == nullptr || !answers_.has_room()) return;
  Answer answer;
  answer.id = command->id;
  answer.accepted = true;
  obey(*command, answer);
  const bool later = command->kind == Command::Kind::average && answer.accepted;
  commands_.pop();
  answer.state = safety_.state();
  if (!later) answers_.push(answer);
}

// What was summed, or, with a reason, that there is no average. Either ends it.
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

void Loop::obey(const Command& command, Answer& answer) {
  const auto refused = [&answer](std::string_view words) {
    answer.accepted = false;
    answer.reason.add(words);
  };
  const Interlocks::Broken broken = interlocks_.broken(clock_.now_ns());
  switch (command.kind) {
    case Command::Kind::clear:
      if (!safety_.faulted()) return refused("there is no fault to clear");
      if (latches_at_rest(broken.interlock) && refuse(broken, answer)) return;
      change(RigInput::clear);
      return;
    case Command::Kind::arm:
      if (safety_.state() != RigState::idle) return refused("only an idle rig can be armed");
      if (refuse(broken, answer)) return;
      if (!can_drive_) return refused("this device drives nothing");
      change(RigInput::arm);
      return;
    case Command::Kind::start:
      if (safety_.state() != RigState::armed) return refused("only an armed rig can be started");
      if (!excitation_.enabled()) return refused("excitation.enabled is false");
      dead_man_ = command.dead_man;
      change(RigInput::start);
      excitation_.start();
      return;
    case Command::Kind::disarm:
    case Command::Kind::stop:
      change(command.kind == Command::Kind::stop ? RigInput::stop : RigInput::disarm);
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
      if (averaging_.active()) return refused("readings are being averaged for another client");
      if (!device_here()) return refused("the device is gone");
      averaging_.begin(command.frames, command.id);
      return;
  }
}

bool Loop::refuse(const Interlocks::Broken& broken, Answer& answer) const {
  if (broken.interlock == Interlock::none) return false;
  answer.accepted = false;
  answer.reason.add(name_of(broken.interlock)).add(": ").add(broken.cause.c_str());
  return true;
}

bool Loop::change(RigInput input) {
  if (!safety_.apply(input)) return false;
  if (safety_.state() == RigState::idle) dead_man_ = false;
  notice(Notice::Kind::state, 0, 0, name_of(safety_.state()));
  return true;
}

void Loop::welcome_device() {
  device_.store(Device::here, std::memory_order_relaxed);
  interlocks_.device_is_back();
  device_clock_ = drivers::DeviceClock();
  // What it yields now has nothing to do with what it yielded before but that time goes on.
  numbering_is_new_ = true;
  read_failing_ = false;
  write_failing_ = false;
  notice(Notice::Kind::device_back);
}

/// False at the end of the data.
bool Loop::read() {
  Frame raw;
  const std::int64_t asked_ns = clock_.now_ns();
  const drivers::Result result = driver_.read(raw);
  const std::int64_t now_ns = clock_.now_ns();
  answered_ns_ = now_ns;
  timing_.read.add(now_ns - asked_ns);
  interlocks_.read_answered(result, now_ns);
  interlocks_.signals(driver_.signals());
  if (result) {
    read_failing_ = false;
    acquire(raw);
  } else if (is_fault(result.outcome)) {
    count_up(timing_.failed_reads);
    if (!read_failing_) notice(Notice::Kind::read_failed, 0, 0, result.message);
    read_failing_ = true;
  } else if (result.outcome == Outcome::end_of_data) {
    notice(Notice::Kind::end_of_data);
    return false;
  }
  return true;
}

void Loop::acquire(Frame raw) {
  if (!place_in_time(raw)) return;
  raw_ = raw;
  if (averaging_.active() && averaging_.add(raw)) answer_average(nullptr);
  const Calibrated si = calibrated(raw, settings_.live.calibration);
  if (si.not_finite != 0) {
    count_up(timing_.not_finite, static_cast<std::uint64_t>(std::popcount(si.not_finite)));
    tell_new(Notice::Kind::not_finite, si.not_finite, not_finite_);
  }
  tell_new(Notice::Kind::beyond_calibration, si.out_of_range, beyond_calibration_);
  beyond_calibration_ = si.out_of_range;
  not_finite_ = si.not_finite;
  interlocks_.frame(si.frame, si.not_finite, answered_ns_);
  excitation_.observe(si.frame, amplifier_on_);

  if (time_of_frames_) {
    const std::int64_t step = previous_ ? si.frame.time_ns - previous_->time_ns : 0;
    elapsed_ns_ = step > 0 && step <= longest_step_ns ? step : settings_.period_ns;
  }

  Sample sample;
  sample.frame = si.frame;
  sample.drive = applied_;
  sample.amplifier_on = amplifier_on_;
  sample.late = late_;
  sample.state = safety_.state();
  sample.number = frames_++;
  previous_ = si.frame;
  const Estimate* estimate = nullptr;
  if (observer_ != nullptr) {
    estimate = &observer_->update(si.frame);
    if (estimate->restarts != restarts_) {
      notice(Notice::Kind::estimate_restarted);
      interlocks_.observer_restarted(true);
    }
    restarts_ = estimate->restarts;
    check_model(*estimate);
  }
  const bool due = frames_ % settings_.frames_per_estimate == 0;
  hand_over(sample, due ? estimate : nullptr);
}

void Loop::check_model(const Estimate& estimate) {
  ModelCheck* const check = settings_.model_check;
  if (check == nullptr || !check->update(estimate)) return;
  const ModelVerdict& verdict = check->verdict();
  const bool broken = verdict.standing == observer::ModelStanding::broken;
  // That it has learnt enough is no news.
  if (broken || verdict.alarms > 0) {
    notice(broken ? Notice::Kind::model_broken : Notice::Kind::model_follows);
  }
}

// A notice for each channel of `now` that was not among those `before`.
void Loop::tell_new(Notice::Kind kind, std::uint8_t now, std::uint8_t before) {
  for (const Channel channel : all_channels) {
    const unsigned bit = 1U << index_of(channel);
    if ((now & bit) != 0 && (before & bit) == 0) notice(kind, index_of(channel));
  }
}

// Sequence and time of what goes on from here increase strictly, whatever the source does.
bool Loop::place_in_time(Frame& frame) {
  if (own_clock_) {
    const std::uint64_t restarts = device_clock_.restarts();
    frame.time_ns = device_clock_.host_time(frame.time_ns, answered_ns_);
    if (device_clock_.restarts() != restarts) notice(Notice::Kind::clock_parted);
  }
  if (numbering_is_new_) {
    sequence_offset_ = last_sequence_ + 1 + cycles_away_ - frame.sequence;
    cycles_away_ = 0;
    numbering_is_new_ = false;
  }
  frame.sequence += sequence_offset_;
  if (previous_ && frame.sequence <= previous_->sequence) {
    // The same sample again, or one that was overtaken: what has been handed over stays.
    count_up(timing_.repeated);
    if (!repeating_) notice(Notice::Kind::sequence_repeated, frame.sequence);
    repeating_ = true;
    return false;
  }
  repeating_ = false;
  frame.time_ns += time_offset_ns_;
  std::uint64_t missing = 0;
  if (previous_) {
    missing = frame.sequence - previous_->sequence - 1;
    if (missing > 0) {
      count_up(timing_.missing_at_source, missing);
      notice(Notice::Kind::frames_missing, missing);
    }
    if (frame.time_ns <= previous_->time_ns) {
      const std::int64_t periods = static_cast<std::int64_t>(missing) + 1;
      const std::int64_t back_ns =
          previous_->time_ns + periods * settings_.period_ns - frame.time_ns;
      time_offset_ns_ += back_ns;
      frame.time_ns += back_ns;
      notice(Notice::Kind::clock_parted);
    }
  }
  last_sequence_ = frame.sequence;
  return true;
}

void Loop::hand_over(const Sample& sample, const Estimate* estimate) {
  ledger_.produce();
  for (Stream* stream : streams_) {
    if (settings_.pacing == Pacing::free) wait_for_room(*stream);
    if (estimate != nullptr) stream->offer({sample.number, *estimate});
    stream->offer(sample);
  }
}

// Simulated time can stand still. But a stop must not wait for a consumer that is stuck.
void Loop::wait_for_room(const Stream& stream) {
  while (!stream.has_room()) {
    const std::int64_t now_ns = clock_.now_ns();
    const int requests = stop_requests_.load(std::memory_order_acquire);
    if (requests > 0 && give_up_ns_ == 0) give_up_ns_ = now_ns + ring_patience_ns;
    if (requests > 1 || (requests > 0 && now_ns >= give_up_ns_)) return;
    clock_.sleep_until(now_ns + ring_wait_ns);
  }
}

// Whatever is wrong is seen here, in the cycle in which it came, and answered before the next
// write.
void Loop::judge() {
  // As of the device's answer: a thread that was held up since then did not make a channel stale.
  const std::int64_t now_ns = device_here() ? answered_ns_ : clock_.now_ns();
  interlocks_.cycle_late(overrun_ns_);
  if (settings_.recorder != nullptr) interlocks_.recorder(settings_.recorder->failing());
  interlocks_.dead_man(dead_man_ ? std::optional(touched_ns_.load(std::memory_order_acquire))
                                 : std::nullopt);
  broken_ = interlocks_.broken(now_ns);
  if (broken_.interlock != Interlock::none) trip(broken_);
}

void Loop::trip(const Interlocks::Broken& broken) {
  if (safety_.trip(broken.interlock, broken.cause, broken.outcome)) {
    dead_man_ = false;
    notice(Notice::Kind::fault, static_cast<std::uint64_t>(broken.interlock), 0,
           broken.cause.c_str());
  }
}

void Loop::drive() {
  const double elapsed_s = static_cast<double>(elapsed_ns_) * 1e-9;
  if (time_of_frames_) elapsed_ns_ = 0;  // until the next frame says more
  if (safety_.amplifier_allowed()) {
    excitation_.advance(elapsed_s);
    const bool finite = std::isfinite(excitation_.now().value);
    interlocks_.drive(finite);
    if (!finite) judge();
    // The drive has come down, after a stop or because there was no more of it.
    if (excitation_.is_off() && excitation_.enabled()) {
      change(RigInput::stop);
      change(RigInput::at_rest);
    }
  }
  if (!safety_.amplifier_allowed()) excitation_.cut();
  interlocks_.drive(true);
  const bool was_faulted = safety_.faulted();
  apply_drive();
  if (can_drive_ && safety_.faulted() && !was_faulted) {
    // The write itself tripped: say "off" once more, in the same cycle.
    excitation_.cut();
    apply_drive();
  }
  // An emergency stop that is pressed as well does not bring the device back.
  const Interlocks::Broken device = interlocks_.device_broken(answered_ns_);
  if (device.interlock != Interlock::none && device_here() && !settings_.end_on_fault) {
    beyond_help_.store(device.outcome == Outcome::fatal, std::memory_order_release);
    device_.store(Device::gone, std::memory_order_release);
    if (averaging_.active()) answer_average(&device.cause);
  }
}

void Loop::apply_drive() {
  applied_ = excitation_.now();
  amplifier_on_ = can_drive_ && safety_.amplifier_allowed() && !excitation_.is_off();
  if (!can_drive_ || !device_here()) return;
  const drivers::Result result = driver_.write({applied_.value, amplifier_on_});
  interlocks_.write_answered(result, clock_.now_ns());
  if (is_fault(result.outcome)) {
    count_up(timing_.failed_writes);
    if (!write_failing_) notice(Notice::Kind::write_failed, 0, 0, result.message);
    judge();
  }
  write_failing_ = is_fault(result.outcome);
}

void Loop::finish(LoopEnd::Reason reason) {
  if (safety_.faulted() && reason == LoopEnd::Reason::fault) {
    why_.outcome = safety_.outcome();
    // Room was reserved: no allocation even now.
    const std::string_view cause(safety_.cause().c_str());
    why_.message.assign(cause.data(), std::min(cause.size(), why_.message.capacity()));
  }
  why_.reason = reason;
}

void Loop::publish(std::int64_t now_ns) {
  Snapshot out;
  out.clock_ns = now_ns;
  out.state = safety_.state();
  out.interlock = safety_.interlock();
  out.cause = safety_.cause();
  out.broken = broken_.interlock;
  out.broken_cause = broken_.cause;
  out.amplifier_on = amplifier_on_;
  out.device_here = device_here();
  out.late = late_;
  // While it is gone, another thread closes and opens it.
  if (device_here()) signals_ = driver_.signals();
  out.signals = signals_;
  out.drive = applied_;
  out.raw = raw_;
  if (previous_) out.frame = *previous_;
  out.frames = frames_;
  if (settings_.model_check != nullptr) {
    out.model_checked = true;
    out.model = settings_.model_check->verdict();
  }
  snapshot_.write(out);
}

void Loop::notice(Notice::Kind kind, std::uint64_t count, std::int64_t duration_ns,
                  const char* text) {
  Notice out;
  out.kind = kind;
  if (previous_) {
    out.time_ns = previous_->time_ns;
    out.sequence = previous_->sequence;
  }
  out.count = count;
  out.duration_ns = duration_ns;
  out.set_text(text);
  if (kind == Notice::Kind::model_broken) out.verdict = settings_.model_check->verdict();
  if (!notices_.push(out)) count_up(timing_.lost_events);
}

}  // namespace stickslip::daemon
