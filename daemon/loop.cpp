#include "daemon/loop.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/deadline.h"

namespace stickslip::daemon {
namespace {

using drivers::Outcome;

constexpr std::size_t notice_room = 1024;
constexpr std::int64_t ring_wait_ns = 50'000;
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
      time_of_frames_(settings.pacing != Pacing::deadlines || driver.description().time_of_its_own),
      safety_(settings.longest_silence_ns),
      notices_(notice_room) {
  why_.message.reserve(sizeof Notice::text);
  if (settings_.frames) {
    const double ramp_frames =
        std::ceil(settings_.ramp_s * 1e9 / static_cast<double>(settings_.period_ns)) + 1.0;
    const auto ramp = static_cast<std::uint64_t>(std::max(0.0, ramp_frames));
    stop_at_frame_ = *settings_.frames > ramp ? *settings_.frames - ramp : 0;
  }
}

const LoopEnd& Loop::run() {
  if (begin()) {
    do {
      wait_for_cycle();
    } while (cycle());
  }
  end();
  return why_;
}

bool Loop::begin() {
  const drivers::Result result = driver_.start();
  if (!result) {
    safety_.trip(is_fault(result.outcome) ? result.outcome : Outcome::fatal, result.message);
    finish(LoopEnd::Reason::fault);
    return false;
  }
  safety_.start();
  excitation_.start();
  publish_state();
  due_ns_ = clock_.now_ns() - settings_.period_ns;
  return true;
}

void Loop::end() {
  // Whatever happened before: the last word to the shaker is "off".
  if (can_drive_) driver_.write({0.0, false});
  driver_.stop();
  safety_.finish_stop();
  publish_state();
}

bool Loop::next_notice(Notice& notice) {
  const Notice* const next = notices_.front();
  if (next == nullptr) return false;
  notice = *next;
  notices_.pop();
  return true;
}

void Loop::wait_for_cycle() {
  late_ = false;
  if (settings_.pacing != Pacing::deadlines) return;
  const Deadline next = next_deadline(due_ns_, settings_.period_ns, clock_.now_ns());
  if (!time_of_frames_) elapsed_ns_ = next.due_ns - due_ns_;
  due_ns_ = next.due_ns;
  // The first cycle has no deadline before it that it could have missed.
  if (next.late_ns > 0 && timing_.cycles.load(std::memory_order_relaxed) > 0) {
    late_ = true;
    count_up(timing_.overruns);
    count_up(timing_.skipped_periods, static_cast<std::uint64_t>(next.skipped));
    if (next.late_ns > timing_.longest_overrun_ns.load(std::memory_order_relaxed)) {
      timing_.longest_overrun_ns.store(next.late_ns, std::memory_order_relaxed);
    }
    notice(Notice::Kind::overrun, static_cast<std::uint64_t>(next.skipped), next.late_ns);
  } else {
    clock_.sleep_until(due_ns_);
  }
  timing_.lateness.add(clock_.now_ns() - due_ns_);
}

bool Loop::cycle() {
  const std::int64_t begun_ns = clock_.now_ns();
  heed_stop_requests();
  const bool at_rest = !amplifier_on_;
  const bool more = read();
  drive();
  count_up(timing_.cycles);
  if (settings_.pacing == Pacing::deadlines) timing_.work.add(clock_.now_ns() - begun_ns);

  if (safety_.faulted()) {
    finish(LoopEnd::Reason::fault);
  } else if (!more) {
    finish(LoopEnd::Reason::end_of_data);
  } else if (settings_.frames && frames_ >= *settings_.frames) {
    finish(LoopEnd::Reason::frames_done);
  } else if (stop_requests_.load(std::memory_order_acquire) > 0 && excitation_.is_off() &&
             at_rest) {
    // Only now: the frame that was just handed over shows the shaker at rest.
    finish(LoopEnd::Reason::asked);
  }
  return why_.reason == LoopEnd::Reason::none;
}

void Loop::heed_stop_requests() {
  const int requests = stop_requests_.load(std::memory_order_acquire);
  if (requests > 0 || (settings_.frames && frames_ >= stop_at_frame_)) {
    if (safety_.state() == RigState::running) {
      safety_.begin_stop();
      excitation_.stop();
      publish_state();
    }
  }
  if (requests > 1) excitation_.cut();
}

/// False at the end of the data.
bool Loop::read() {
  Frame raw;
  const drivers::Result result = driver_.read(raw);
  const std::int64_t now_ns = clock_.now_ns();
  safety_.observe_read(result, now_ns);
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

void Loop::acquire(const Frame& raw) {
  check_sequence(raw);
  const Calibrated si = calibrated(raw, settings_.calibration);
  if (si.not_finite != 0) {
    for (Channel channel : all_channels) {
      const unsigned bit = 1U << index_of(channel);
      if ((si.not_finite & bit) == 0) continue;
      count_up(timing_.not_finite);
      if ((not_finite_ & bit) == 0) notice(Notice::Kind::not_finite, index_of(channel));
    }
  }
  not_finite_ = si.not_finite;

  if (time_of_frames_) {
    const std::int64_t step = previous_ ? si.frame.time_ns - previous_->time_ns : 0;
    elapsed_ns_ = step > 0 ? step : settings_.period_ns;
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
    if (estimate->restarts != restarts_) notice(Notice::Kind::estimate_restarted);
    restarts_ = estimate->restarts;
  }
  const bool due = frames_ % settings_.frames_per_estimate == 0;
  hand_over(sample, due ? estimate : nullptr);
}

void Loop::check_sequence(const Frame& frame) {
  if (!previous_) return;
  if (frame.sequence <= previous_->sequence) {
    notice(Notice::Kind::sequence_repeated, frame.sequence);
  } else if (const std::uint64_t missing = frame.sequence - previous_->sequence - 1; missing > 0) {
    count_up(timing_.missing_at_source, missing);
    notice(Notice::Kind::frames_missing, missing);
  }
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

void Loop::drive() {
  const double elapsed_s = static_cast<double>(elapsed_ns_) * 1e-9;
  if (time_of_frames_) elapsed_ns_ = 0;  // until the next frame says more
  if (safety_.faulted()) {
    excitation_.cut();
  } else {
    excitation_.advance(elapsed_s);
  }
  apply();
  if (!can_drive_ || !safety_.faulted() || !amplifier_on_) return;
  // The write itself tripped: say "off" once more, in the same cycle.
  excitation_.cut();
  apply();
}

void Loop::apply() {
  applied_ = excitation_.now();
  amplifier_on_ = can_drive_ && safety_.amplifier_allowed() && !excitation_.is_off();
  if (!can_drive_) return;
  const drivers::Result result = driver_.write({applied_.value, amplifier_on_});
  safety_.observe_write(result, clock_.now_ns());
  if (is_fault(result.outcome)) {
    count_up(timing_.failed_writes);
    if (!write_failing_) notice(Notice::Kind::write_failed, 0, 0, result.message);
  }
  write_failing_ = is_fault(result.outcome);
}

void Loop::finish(LoopEnd::Reason reason) {
  if (reason == LoopEnd::Reason::fault) {
    notice(Notice::Kind::fault, 0, 0, safety_.fault_cause());
    why_.outcome = safety_.fault_outcome();
    // Room was reserved: no allocation even now.
    why_.message.assign(
        safety_.fault_cause(),
        std::min(std::char_traits<char>::length(safety_.fault_cause()), why_.message.capacity()));
  }
  why_.reason = reason;
  publish_state();
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
  if (!notices_.push(out)) count_up(timing_.lost_events);
}

}  // namespace stickslip::daemon
