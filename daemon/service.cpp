#include "daemon/service.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "config/settings.h"
#include "daemon/burst_watch.h"
#include "daemon/clock.h"
#include "daemon/control.h"
#include "daemon/device_keeper.h"
#include "daemon/event.h"
#include "daemon/examiner.h"
#include "daemon/ledger.h"
#include "daemon/loss_watch.h"
#include "daemon/messages.h"
#include "daemon/metrics.h"
#include "daemon/outlet.h"
#include "daemon/realtime.h"
#include "daemon/status.h"
#include "daemon/stream.h"
#include "daemon/utc_clock.h"
#include "drivers/make_driver.h"
#include "physics/problem.h"
#include "protocol/recording.h"

namespace stickslip::daemon {
namespace {

using namespace std::chrono_literals;

/// More than the loop ever uses of either stack or heap.
constexpr std::size_t loop_memory = 512UL << 10U;
constexpr auto housekeeping_period = 50ms;
constexpr std::int64_t status_period_ns = 1'000'000'000;
// Patience at the end: the network takes what it takes at once; a disk may be busy.
constexpr auto examine_patience = 5s;
constexpr auto publish_patience = 5s;
constexpr auto record_patience = 30s;

std::int64_t wall_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// The signals that the daemon heeds, as something to wait for.
class Signals {
 public:
  Signals() {
    const sigset_t signals = heeded_signals();
    file_ = signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK);
    if (file_ < 0) throw std::system_error(errno, std::generic_category(), "signalfd");
  }
  ~Signals() { ::close(file_); }
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;

  int file() const { return file_; }

  /// The next one that has come; 0 where none has.
  int next() const {
    signalfd_siginfo info{};
    if (::read(file_, &info, sizeof info) != sizeof info) return 0;
    return static_cast<int>(info.ssi_signo);
  }

 private:
  int file_ = -1;
};

/// One consumer of frames: where they end, what encodes them, and the ring before it.
struct Consumer {
  Consumer(const char* called, std::unique_ptr<Outlet> where, Account& account,
           const StreamSettings& settings)
      : name(called), outlet(std::move(where)), sink(*outlet), stream(sink, account, settings) {}

  const char* name;
  std::unique_ptr<Outlet> outlet;
  MessageSink sink;
  Stream stream;
};

/// The examiner, as a consumer whose losses are in no ledger: it owes nobody a frame.
struct Examination {
  Examination(const config::Rig& rig, const StreamSettings& settings)
      : examiner(rig.model, 1.0 / rig.loop.rate_hz), stream(examiner, account, settings) {}

  Examiner examiner;
  Account account;
  Stream stream;
};

void log_event(const Event& event) {
  switch (event.severity) {
    case Severity::info:
      spdlog::info("{}", event.message);
      break;
    case Severity::warning:
      spdlog::warn("{}", event.message);
      break;
    case Severity::error:
      spdlog::error("{}", event.message);
      break;
  }
}

std::unique_ptr<Observer> observer_for(const config::Rig& rig) {
  if (!rig.observer.enabled) return nullptr;
  auto observer = std::make_unique<Observer>(rig.model, 1.0 / rig.loop.rate_hz);
  if (observer->supported()) return observer;
  spdlog::warn("no estimates: {}", observer->unsupported());
  return nullptr;
}

std::unique_ptr<ModelCheck> model_check_for(const config::Rig& rig, const Observer* observer) {
  if (observer == nullptr || !rig.observer.model_check) return nullptr;
  return std::make_unique<ModelCheck>(
      rig.model, 1.0 / rig.loop.rate_hz,
      observer::ModelCheckSettings{rig.observer.days_between_false_alarms});
}

std::int64_t ns_of(double seconds) { return std::llround(seconds * 1e9); }

InterlockSettings interlocks_of(const config::Rig& rig, const drivers::Description& device) {
  const config::Safety& safety = rig.safety;
  InterlockSettings out;
  // A recording may have gaps; a device may not. A rig whose time waits for the host misses nothing
  // while the host is late.
  const double silence_s = rig.driver == config::DriverKind::replay ? 0.0 : 0.1;
  const double overrun_s = device.time_of_its_own ? 0.0 : 0.05;
  out.longest_silence_ns = ns_of(safety.longest_silence_s.value_or(silence_s));
  out.longest_overrun_ns = ns_of(safety.longest_overrun_s.value_or(overrun_s));
  out.stale_after_ns = ns_of(safety.stale_after_s);
  out.dead_man_ns = ns_of(safety.dead_man_s);
  out.not_finite = safety.not_finite;
  out.observer_diverged = safety.observer_diverged;
  out.recorder_failing = safety.recorder_failing;
  for (std::size_t i = 0; i < channel_count; ++i) {
    out.range[i] = {safety.range[i].low, safety.range[i].high};
  }
  return out;
}

LiveSettings live_settings(const config::Rig& rig, const drivers::Description& device) {
  return {Calibration(rig.calibration), interlocks_of(rig, device)};
}

/// A change of a key that is a knob of the excitation, as the turn of it.
std::optional<Setting> knob_change(const config::Change& change, const config::Rig& now) {
  constexpr std::string_view table = "excitation.";
  if (!change.key.starts_with(table)) return std::nullopt;
  const auto knob = knob_named(std::string_view(change.key).substr(table.size()));
  if (!knob) return std::nullopt;
  switch (*knob) {
    case Knob::carrier_hz:
      return Setting{*knob, now.excitation.carrier_hz};
    case Knob::amplitude:
      return Setting{*knob, now.excitation.amplitude};
    case Knob::modulation_hz:
      return Setting{*knob, now.excitation.modulation_hz};
    case Knob::modulation_depth:
      return Setting{*knob, now.excitation.modulation_depth};
  }
  return std::nullopt;
}

/// Where clients find the daemon; empty: nowhere.
std::filesystem::path control_socket(const config::Rig& rig) {
  if (!rig.control.socket.empty()) return rig.control.socket;
  const char* const folder = std::getenv("RUNTIME_DIRECTORY");  // set by systemd
  return folder == nullptr ? std::filesystem::path()
                           : std::filesystem::path(folder) / "control.sock";
}

/// Everything around the loop while it runs, and the order in which it ends.
class Service {
 public:
  explicit Service(const config::Rig& rig) : in_effect_(rig), rig_(rig) {}

  int run();

 private:
  std::vector<Frame> frames_to_replay() const;
  void open_consumers();
  std::vector<Stream*> streams();
  LoopSettings loop_settings(const drivers::Description& device) const;
  void say_grants(const std::vector<Grant>& grants) const;
  std::unique_ptr<Control> open_control(Loop& loop, const drivers::Description& device);
  SettingBounds setting_bounds(const Loop& loop) const;
  void housekeeping(Loop& loop, Control* control, const drivers::Description& device);
  void heed(int signal, Loop& loop, const drivers::Description& device);
  std::vector<std::string> reload(Loop& loop, const drivers::Description& device);
  void ask(Loop& loop, const Command& command);
  void tell(const Event& event);
  std::int64_t utc_us() { return utc_.utc_us(clock_.now_ns(), wall_us()); }
  void tell_and_log(const Event& event);
  void drain_notices(Loop& loop);
  void tell_findings();
  Status status(const Loop& loop);
  void send_status(const Loop& loop);
  void write_metrics_of(const Status& status);
  void send(const Message& message);
  int finish(Loop& loop);

  Ledger ledger_;
  const config::Rig in_effect_;  // as the daemon began
  config::Rig rig_;              // with what has changed since
  MonotonicClock clock_;
  UtcClock utc_;
  Signals signals_;
  Control* control_ = nullptr;  // while it is there
  int stop_requests_ = 0;
  Pacing pacing_ = Pacing::deadlines;
  std::unique_ptr<Consumer> publisher_;
  std::unique_ptr<Consumer> recorder_;
  std::unique_ptr<Examination> examination_;  // where the model is checked
  std::string model_explained_;
  ProcessorLatencyRequest latency_request_;
  std::atomic<bool> loop_ended_{false};
  std::int64_t started_ns_ = 0;
  std::uint64_t cycles_fed_ = 0;
  std::uint64_t late_told_ = 0;
  std::int64_t longest_untold_ns_ = 0;
  BurstWatch bursts_;
  LossWatch losses_;
  std::string metrics_trouble_;
};

std::vector<Frame> Service::frames_to_replay() const {
  if (rig_.driver != config::DriverKind::replay) return {};
  const protocol::Recording recording = protocol::read_recording(rig_.replay.recording);
  if (recording.cut_off_bytes > 0) spdlog::warn("{}", protocol::cut_off_warning(recording));
  return recording.frames;
}

void Service::open_consumers() {
  StreamSettings settings;
  settings.frames_per_block = static_cast<std::size_t>(std::max(1, rig_.loop.frames_per_block));
  settings.ring_frames =
      std::max<std::size_t>(16384, static_cast<std::size_t>(std::ceil(rig_.loop.rate_hz * 10.0)));
  // As fast as it goes, a frame never waits long, and blocks are the same at every run.
  if (pacing_ == Pacing::free) settings.longest_wait = std::chrono::hours(1);
  if (rig_.recording.enabled) {
    const RecorderSettings log{.rotate_s = rig_.recording.rotate_s,
                               .rotate_mb = rig_.recording.rotate_mb,
                               .sync_s = rig_.recording.sync_s,
                               .ledger = &ledger_};
    recorder_ = std::make_unique<Consumer>("recorder", open_log(rig_.recording.file, log),
                                           ledger_.recorded(), settings);
  }
  if (rig_.lcm.enabled) {
    publisher_ = std::make_unique<Consumer>("publisher", open_lcm(rig_.lcm.url),
                                            ledger_.published(), settings);
  }
  if (rig_.observer.enabled && rig_.observer.model_check) {
    examination_ = std::make_unique<Examination>(rig_, settings);
  }
}

std::vector<Stream*> Service::streams() {
  std::vector<Stream*> out;
  if (recorder_) out.push_back(&recorder_->stream);
  if (publisher_) out.push_back(&publisher_->stream);
  if (examination_) out.push_back(&examination_->stream);
  return out;
}

LoopSettings Service::loop_settings(const drivers::Description& device) const {
  LoopSettings settings;
  settings.period_ns = std::llround(1e9 / rig_.loop.rate_hz);
  settings.pacing = pacing_;
  if (rig_.loop.duration_s) {
    settings.frames =
        static_cast<std::uint64_t>(std::llround(*rig_.loop.duration_s * rig_.loop.rate_hz));
  }
  settings.ramp_s = rig_.excitation.enabled ? rig_.excitation.ramp_s : 0.0;
  settings.frames_per_estimate =
      static_cast<std::uint64_t>(std::max(1, rig_.loop.frames_per_block));
  settings.live = live_settings(rig_, device);
  settings.start_at_once = rig_.control.start_at_once;
  settings.end_on_fault = rig_.safety.exit_on_fault;
  if (rig_.loop.lateness_limit_s) settings.lateness_limit_ns = ns_of(*rig_.loop.lateness_limit_s);
  if (recorder_) settings.recorder = &recorder_->stream;
  return settings;
}

void Service::say_grants(const std::vector<Grant>& grants) const {
  for (const Grant& grant : grants) {
    if (grant.granted) {
      spdlog::info("{}: granted", grant.wish);
    } else {
      spdlog::warn("{}: not granted, {}", grant.wish, grant.words);
    }
  }
}

int Service::run() {
  const std::unique_ptr<drivers::Driver> driver = drivers::make_driver(rig_, frames_to_replay());
  if (const drivers::Result opened = driver->open(); !opened) {
    spdlog::error("{} does not open: {}", driver->description().name, opened.message);
    return 1;
  }
  pacing_ = pacing_of(rig_, driver->description());
  for (const std::string& sentence : unit_disagreements(rig_.calibration, driver->description())) {
    spdlog::warn("{}", sentence);
  }
  open_consumers();

  const std::unique_ptr<Observer> observer = observer_for(rig_);
  const std::unique_ptr<ModelCheck> model_check = model_check_for(rig_, observer.get());
  LoopSettings settings = loop_settings(driver->description());
  settings.model_check = model_check.get();
  Loop loop(*driver, clock_, settings, Excitation(rig_.excitation, driven_rig(rig_)),
            observer.get(), ledger_, streams());
  const std::unique_ptr<Control> control = open_control(loop, driver->description());

  const bool real_time = rig_.loop.real_time_scheduling && pacing_ != Pacing::free;
  if (real_time) say_grants({lock_memory(), latency_request_.request()});
  spdlog::info("{}: {}, {} frames/s{}", rig_.name, driver->description().name, rig_.loop.rate_hz,
               pacing_ == Pacing::free ? ", as fast as it goes" : "");
  if (publisher_) spdlog::info("publishing at {}", rig_.lcm.url);
  if (recorder_) spdlog::info("recording into {}", rig_.recording.file.string());

  send(recording_info_message(rig_, utc_us()));
  for (Stream* stream : streams()) stream->start();

  started_ns_ = clock_.now_ns();
  std::atomic<int> granted{-1};
  std::vector<Grant> grants;
  // Of the calling thread, and of those that it starts: the loop, and the device's own.
  const auto schedule = [this, real_time] {
    if (!real_time) return std::vector<Grant>();
    return std::vector<Grant>{pin_thread(rig_.loop.cpu), make_thread_real_time(rig_.loop.priority)};
  };
  std::thread loop_thread([&] {
    if (real_time) prefault(loop_memory);
    grants = schedule();
    granted.store(real_time ? 1 : 0, std::memory_order_release);
    loop.run();
    loop_ended_.store(true, std::memory_order_release);
  });
  while (granted.load(std::memory_order_acquire) < 0) std::this_thread::sleep_for(100us);
  say_grants(grants);
  DeviceKeeper keeper(*driver, loop, [&schedule] { schedule(); });
  sd_notify(0, "READY=1\nSTATUS=running");

  housekeeping(loop, control.get(), driver->description());
  // Nobody feeds the watchdog any more, and closing a device that hangs takes its time.
  sd_notify(0, "STOPPING=1\nSTATUS=closing the device");
  loop_thread.join();
  drain_notices(loop);
  keeper.stop();
  // The keeper may not have come to it.
  if (loop.device_is_gone()) driver->stop();
  driver->close();
  // Of one that is here the loop has told.
  const char* const left_on = loop.device_is_gone() ? driver->left_on() : nullptr;
  if (left_on != nullptr) spdlog::error("{}", left_on);
  return finish(loop);
}

SettingBounds Service::setting_bounds(const Loop& loop) const {
  return {rig_.limits, rig_.model.oscillator.excitation == physics::Excitation::force,
          rig_.loop.rate_hz, loop.snapshot().drive.gain};
}

std::unique_ptr<Control> Service::open_control(Loop& loop, const drivers::Description& device) {
  LineServerSettings settings;
  settings.path = control_socket(rig_);
  settings.group = rig_.control.group;
  settings.longest_line = protocol::longest_control_line;
  if (settings.path.empty()) {
    spdlog::info("no control socket: name one in control.socket or with --control");
    return nullptr;
  }
  auto control = std::make_unique<Control>(
      settings, loop, clock_, rig_.loop.rate_hz,
      ControlHandlers{.status = [this, &loop] { return status(loop); },
                      .refusal =
                          [this, &loop](const Setting& setting) {
                            return refusal(rig_.excitation, setting_bounds(loop), setting);
                          },
                      .was_set =
                          [this](const Setting& setting) {
                            rig_.excitation = with_setting(rig_.excitation, setting);
                          },
                      .reload = [this, &loop, &device] { return reload(loop, device); }});
  spdlog::info("commands at {}", settings.path.string());
  return control;
}

void Service::housekeeping(Loop& loop, Control* control, const drivers::Description& device) {
  control_ = control;
  std::int64_t next_status_ns = started_ns_ + status_period_ns;
  while (!loop_ended_.load(std::memory_order_acquire)) {
    bool signalled = false;
    if (control != nullptr) {
      signalled = control->serve(housekeeping_period, signals_.file());
    } else {
      pollfd file{signals_.file(), POLLIN, 0};
      signalled = ::poll(&file, 1, static_cast<int>(housekeeping_period.count())) > 0;
    }
    if (signalled) {
      while (const int signal = signals_.next()) heed(signal, loop, device);
    }
    drain_notices(loop);
    // Fed by progress, not by this thread's own life.
    const std::uint64_t cycles = loop.timing().cycles.load(std::memory_order_relaxed);
    if (cycles != cycles_fed_) sd_notify(0, "WATCHDOG=1");
    cycles_fed_ = cycles;
    if (clock_.now_ns() >= next_status_ns) {
      next_status_ns += status_period_ns;
      send_status(loop);
    }
  }
  control_ = nullptr;
}

void Service::heed(int signal, Loop& loop, const drivers::Description& device) {
  if (signal == SIGHUP) {
    sd_notify(0, "RELOADING=1");
    try {
      for (const std::string& line : reload(loop, device)) spdlog::info("reload: {}", line);
    } catch (const InputError& error) {
      spdlog::error("nothing was changed: {}", error.what());
    }
    sd_notify(0, "READY=1");
    return;
  }
  loop.request_stop();
  sd_notify(0, "STOPPING=1\nSTATUS=ramping down");
  spdlog::info(++stop_requests_ == 1 ? "stopping: ramping down (once more: at once)"
                                     : "stopping at once");
}

// What can change without a restart does; of the rest it is said that it does not. Knobs of the
// excitation are turned as by `set`, and refused like there.
std::vector<std::string> Service::reload(Loop& loop, const drivers::Description& device) {
  const config::Rig now = config::load_rig(rig_.file);
  std::vector<std::string> out;
  for (const config::Change& change : config::changes(in_effect_, now)) {
    std::string line = config::text(change);
    if (const auto setting = knob_change(change, now)) {
      if (const auto why = refusal(rig_.excitation, setting_bounds(loop), *setting)) {
        line += ", refused: " + *why;
      } else {
        Command turn;
        turn.kind = Command::Kind::set;
        turn.setting = *setting;
        ask(loop, turn);
        rig_.excitation = with_setting(rig_.excitation, *setting);
      }
    }
    out.push_back(line);
  }
  Command apply;
  apply.kind = Command::Kind::apply;
  apply.live = live_settings(now, device);
  ask(loop, apply);
  rig_.calibration = now.calibration;
  rig_.calibration_text = now.calibration_text;
  rig_.safety = now.safety;
  rig_.metrics = now.metrics;
  if (out.empty()) out.emplace_back("nothing has changed");
  return out;
}

void Service::ask(Loop& loop, const Command& command) {
  if (loop.ask(command)) return;
  throw InputError({rig_.file.string(), 0, 0, "the loop is busy with other commands; try again"});
}

void Service::tell(const Event& event) {
  send(event_message(event, utc_us()));
  if (control_ != nullptr) control_->publish(event);
}

void Service::drain_notices(Loop& loop) {
  Notice notice;
  while (loop.next_notice(notice)) {
    if (notice.kind == Notice::Kind::overrun) {
      longest_untold_ns_ = std::max(longest_untold_ns_, notice.duration_ns);
    }
    if (notice.kind == Notice::Kind::model_broken) {
      tell_and_log(with_times(event_of(notice), notice.verdict, utc_us()));
      model_explained_.clear();
      if (examination_) examination_->examiner.ask(notice.verdict);
      continue;
    }
    if (const auto event = bursts_.take(notice, clock_.now_ns())) tell_and_log(*event);
  }
  for (const Event& event : bursts_.due(clock_.now_ns())) tell_and_log(event);
  tell_findings();
}

void Service::tell_findings() {
  if (!examination_) return;
  while (const auto finding = examination_->examiner.next_finding()) {
    const Event event = event_of(*finding);
    model_explained_ = event.message;
    tell_and_log(event);
  }
}

void Service::tell_and_log(const Event& event) {
  tell(event);
  // The status of each second has a line of its own for them.
  if (event.code != "overrun") log_event(event);
}

Status Service::status(const Loop& loop) {
  Status out = status_of(loop.snapshot(), ledger_, loop.timing());
  out.uptime_ns = clock_.now_ns() - started_ns_;
  out.devices = loop.device_counts();
  out.model_explained = model_explained_;
  for (const Consumer* consumer : {publisher_.get(), recorder_.get()}) {
    if (consumer != nullptr) out.lost_messages += consumer->stream.lost_messages();
  }
  return out;
}

void Service::send_status(const Loop& loop) {
  Status now = status(loop);
  now.degraded = now.late_cycles > late_told_;
  if (now.degraded) {
    spdlog::warn("{} cycles came late since the last status; the longest overrun took {:.3f} ms",
                 now.late_cycles - late_told_, static_cast<double>(longest_untold_ns_) * 1e-6);
    longest_untold_ns_ = 0;
  }
  late_told_ = now.late_cycles;
  for (const Event& event : losses_.look(now.ledger)) {
    tell(event);
    log_event(event);
  }
  // A recording ends with its ledger: the status comes last.
  send(timing_message(loop.timing(), utc_us()));
  send(status_message(now, utc_us()));
  if (control_ != nullptr) control_->publish(now);
  write_metrics_of(now);
  const std::string line = std::string("STATUS=") + name_of(now.state) + ", " +
                           std::to_string(now.ledger.produced) + " frames, " +
                           std::to_string(now.overruns) + " overruns";
  sd_notify(0, line.c_str());
}

void Service::write_metrics_of(const Status& status) {
  if (rig_.metrics.file.empty()) return;
  const std::string why =
      write_metrics(rig_.metrics.file, metrics_text(status, rig_.name, utc_us()));
  // Once, and not every second.
  if (!why.empty() && why != metrics_trouble_) spdlog::warn("no metrics: {}", why);
  metrics_trouble_ = why;
}

void Service::send(const Message& message) {
  if (publisher_) publisher_->stream.send(message);
  if (recorder_) recorder_->stream.send(message);
}

int Service::finish(Loop& loop) {
  sd_notify(0, "STOPPING=1\nSTATUS=draining");
  drain_notices(loop);
  for (const Event& event : bursts_.rest()) tell_and_log(event);
  if (examination_) examination_->stream.finish(examine_patience);
  tell_findings();
  if (publisher_) publisher_->stream.finish(publish_patience);
  if (recorder_) recorder_->stream.finish(record_patience);

  // Every frame is accounted for now, so the last status holds the whole ledger. It goes straight
  // to the outlets: their threads have ended.
  send_status(loop);
  bool closed = true;
  for (Consumer* consumer : {publisher_.get(), recorder_.get()}) {
    if (consumer == nullptr || consumer->outlet->close()) continue;
    spdlog::error("the {} could not be closed cleanly", consumer->name);
    closed = false;
  }

  const Status last = status(loop);
  std::istringstream lines(text(last));
  for (std::string line; std::getline(lines, line);) spdlog::info("{}", line);
  const LoopEnd& end = loop.why_ended();
  if (!last.ledger.is_closed()) {
    spdlog::error("the ledger does not balance: frames were lost without a line in it");
    return 1;
  }
  if (end.reason == LoopEnd::Reason::fault) {
    spdlog::error("stopped by a fault: {}", end.message);
    return 1;
  }
  if (last.state == RigState::faulted && last.interlock != Interlock::just_started) {
    spdlog::error("ended with a fault that nobody had cleared: {}", last.cause);
    return 1;
  }
  return closed ? 0 : 1;
}

}  // namespace

config::Rig with_overrides(config::Rig rig, const Overrides& overrides) {
  if (overrides.duration_s) {
    if (!std::isfinite(*overrides.duration_s) || *overrides.duration_s <= 0.0) {
      throw InputError({"", 0, 0,
                        "--duration: expected a time in seconds above 0, found " +
                            std::to_string(*overrides.duration_s)});
    }
    rig.loop.duration_s = overrides.duration_s;
  }
  if (overrides.record) {
    rig.recording.enabled = true;
    rig.recording.file = *overrides.record;
  }
  if (overrides.lcm_url) {
    rig.lcm.enabled = true;
    rig.lcm.url = *overrides.lcm_url;
  }
  if (overrides.no_lcm) rig.lcm.enabled = false;
  if (overrides.control) rig.control.socket = *overrides.control;
  return rig;
}

Pacing pacing_of(const config::Rig& rig, const drivers::Description& device) {
  if (rig.driver == config::DriverKind::simulated && !rig.simulated.real_time) return Pacing::free;
  if (rig.driver == config::DriverKind::replay && rig.replay.speed == 0.0) return Pacing::free;
  return device.paced ? Pacing::driver : Pacing::deadlines;
}

sigset_t heeded_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&signals, signal);
  return signals;
}

int serve(const config::Rig& rig) { return Service(rig).run(); }

}  // namespace stickslip::daemon
