// SPDX-License-Identifier: Apache-2.0
#include "daemon/service.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <systemd/sd-daemon.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "config/lcm_url.h"
#include "config/named_files.h"
#include "config/settings.h"
#include "daemon/clock.h"
#include "daemon/control_server.h"
#include "daemon/device_supervisor.h"
#include "daemon/drive_change.h"
#include "daemon/event.h"
#include "daemon/event_throttle.h"
#include "daemon/ledger.h"
#include "daemon/loop.h"
#include "daemon/loss_monitor.h"
#include "daemon/message_writer.h"
#include "daemon/messages.h"
#include "daemon/metrics.h"
#include "daemon/model_change.h"
#include "daemon/model_check.h"
#include "daemon/realtime.h"
#include "daemon/recording_input.h"
#include "daemon/rig_description.h"
#include "daemon/rig_settings.h"
#include "daemon/signals.h"
#include "daemon/status.h"
#include "daemon/stream.h"
#include "daemon/utc_clock.h"
#include "drivers/factory/make_driver.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/recording.h"

namespace stickslip::daemon {
namespace {

using namespace std::chrono_literals;

/// More stack, and more heap, than the loop ever uses.
constexpr std::size_t loop_memory = 512UL << 10U;
constexpr auto housekeeping_period = 50ms;
constexpr std::int64_t status_period_ns = 1'000'000'000;
constexpr std::uint64_t statuses_per_description = 2;
// Time to drain at the end: a network needs none, a disk may be busy.
constexpr auto model_timeout = 5s;
constexpr auto publish_timeout = 5s;
constexpr auto record_timeout = 30s;

std::int64_t wall_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// Publisher or recorder: destination, encoder and ring.
struct Consumer {
  Consumer(const char* consumer, std::unique_ptr<MessageWriter> destination, Account& account,
           const StreamSettings& settings)
      : name(consumer),
        writer(std::move(destination)),
        sink(*writer),
        stream(sink, account, settings) {}

  const char* name;
  std::unique_ptr<MessageWriter> writer;
  MessageSink sink;
  Stream stream;
};

/// How long the end of the daemon waits for the checks. Those of a source that is faster than the
/// time are what it was run for.
std::optional<std::chrono::steady_clock::duration> patience_for(Pacing pacing) {
  if (pacing == Pacing::free_running) return std::nullopt;
  return std::chrono::seconds(5);
}

/// Consumer of frames whose losses do not count in the ledger.
struct CheckedModel {
  CheckedModel(const config::Rig& rig, Pacing pacing, const StreamSettings& settings)
      : check(rig.model, rig.observer.days_between_false_alarms, patience_for(pacing)),
        stream(check, account, settings) {}

  ModelCheck check;
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

void log_grants(const std::vector<Grant>& grants) {
  for (const Grant& grant : grants) {
    if (grant.granted) {
      spdlog::info("{}: granted", grant.request);
    } else {
      spdlog::warn("{}: not granted, {}", grant.request, grant.refusal);
    }
  }
}

std::unique_ptr<Observer> observer_for(const config::Rig& rig) {
  if (!rig.observer.enabled) return nullptr;
  auto observer = std::make_unique<Observer>(rig.model, 1.0 / rig.loop.rate_hz);
  if (observer->supported()) return observer;
  spdlog::warn("no estimates: {}", observer->unsupported());
  return nullptr;
}

LineServerSettings line_server_settings(const config::Rig& rig) {
  LineServerSettings settings;
  settings.path = control_socket(rig);
  settings.group = rig.control.group;
  settings.max_line_bytes = protocol::longest_control_line;
  return settings;
}

/// The real-time thread. Its scheduling is inherited by the threads that a device starts.
class LoopThread {
 public:
  LoopThread(Loop& loop, const config::Loop& settings, bool real_time)
      : settings_(settings), real_time_(real_time), thread_([this, &loop] { run(loop); }) {
    while (!scheduled_.load(std::memory_order_acquire)) std::this_thread::sleep_for(100us);
    log_grants(grants_);
  }
  LoopThread(const LoopThread&) = delete;
  LoopThread& operator=(const LoopThread&) = delete;

  /// Any thread: gives the calling thread the same scheduling.
  std::vector<Grant> schedule() const {
    if (!real_time_) return {};
    return {pin_thread(settings_.cpu), make_thread_real_time(settings_.priority)};
  }

  bool ended() const { return ended_.load(std::memory_order_acquire); }
  /// Has to be called before the destructor.
  void join() { thread_.join(); }

 private:
  void run(Loop& loop) {
    if (real_time_) prefault(loop_memory);
    grants_ = schedule();
    scheduled_.store(true, std::memory_order_release);
    loop.run();
    ended_.store(true, std::memory_order_release);
  }

  config::Loop settings_;
  bool real_time_;
  std::vector<Grant> grants_;
  std::atomic<bool> scheduled_{false};
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

/// Everything around the loop while it runs, and the order of the shutdown.
class Service {
 public:
  explicit Service(const config::Rig& rig) : started_with_(rig), rig_(rig) {}

  int run();

 private:
  std::vector<Frame> frames_to_replay() const;
  void open_consumers();
  std::vector<Stream*> streams();
  void log_start(const drivers::Description& device) const;
  void run_loop(Loop& loop, drivers::Driver& driver, ControlServer* control, bool real_time);
  void claim_control_socket();
  std::unique_ptr<ControlServer> open_control(Loop& loop, const drivers::Description& device);
  SettingBounds setting_bounds(const Loop& loop) const;
  void housekeeping(const LoopThread& thread, Loop& loop, const drivers::Description& device);
  bool serve_clients();
  void handle_signal(int signal, Loop& loop, const drivers::Description& device);
  std::vector<std::string> reload(Loop& loop, const drivers::Description& device);
  std::string take_model(const Answer& answer);
  std::string take_drive(const Answer& answer);
  Event take_note(const Snapshot& now, const std::string& text, const std::string& rig);
  void change_setting(Loop& loop, const Setting& setting, std::string& line);
  void ask(Loop& loop, const Command& command);
  std::int64_t utc_us() { return utc_.utc_us(clock_.now_ns(), wall_us()); }
  void publish_event(const Event& event);
  void publish_and_log(const Event& event);
  void publish_throttled(const Event& event);
  void publish_writer_events();
  void publish_losses();
  void drain_notices(Loop& loop);
  void publish_model_events();
  Status status(const Loop& loop);
  void publish_status(const Loop& loop);
  void describe_again();
  void write_metrics_of(const Status& status);
  void send(const Message& message);
  void finish_consumers();
  bool close_writers();
  int finish(Loop& loop);

  Ledger ledger_;
  const config::Rig started_with_;
  config::Rig rig_;  // with the changes since the start
  MonotonicClock clock_;
  UtcClock utc_;
  Signals signals_{handled_signals()};
  std::optional<ListeningSocket> socket_;  // until the control server has it
  ControlServer* control_ = nullptr;       // during housekeeping
  int stop_requests_ = 0;
  Pacing pacing_ = Pacing::deadlines;
  std::unique_ptr<Consumer> publisher_;
  std::unique_ptr<Consumer> recorder_;
  std::unique_ptr<CheckedModel> model_;      // if it is checked
  std::optional<ModelChange> model_change_;  // has the loop's observer
  DriveChange drive_change_;
  ProcessorLatencyRequest latency_request_;
  std::int64_t started_ns_ = 0;
  std::int64_t started_utc_us_ = 0;
  std::uint64_t statuses_ = 0;              // published
  std::uint64_t watchdog_cycles_ = 0;       // at the latest notification of the watchdog
  std::uint64_t late_cycles_reported_ = 0;  // in the latest status
  std::int64_t longest_unreported_overrun_ns_ = 0;
  EventThrottle throttle_;
  EventThrottle line_throttle_;     // of lines that are only logged
  bool recording_damaged_ = false;  // by more than frames that the ledger has as lost
  LossMonitor losses_;
  std::string metrics_error_;  // the latest that was logged
};

std::vector<Frame> Service::frames_to_replay() const {
  if (rig_.driver != config::DriverKind::replay) return {};
  return recording_from(rig_.replay.recording).frames;
}

void Service::open_consumers() {
  const StreamSettings settings = stream_settings(rig_, pacing_);
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
    model_ = std::make_unique<CheckedModel>(rig_, pacing_, settings);
  }
}

std::vector<Stream*> Service::streams() {
  std::vector<Stream*> out;
  if (recorder_) out.push_back(&recorder_->stream);
  if (publisher_) out.push_back(&publisher_->stream);
  if (model_) out.push_back(&model_->stream);
  return out;
}

void Service::log_start(const drivers::Description& device) const {
  spdlog::info("{}: {}, {} frames/s{}", rig_.name, device.name, rig_.loop.rate_hz,
               pacing_ == Pacing::free_running ? ", as fast as possible" : "");
  if (publisher_) spdlog::info("publishing on {}", rig_.lcm.url);
  if (recorder_) spdlog::info("recording into {}", rig_.recording.file.string());
}

int Service::run() {
  claim_control_socket();  // before anything that belongs to a daemon that is running
  const std::unique_ptr<drivers::Driver> driver = drivers::make_driver(rig_, frames_to_replay());
  if (const drivers::Result opened = driver->open(); !opened) {
    spdlog::error("{} could not be opened: {}", driver->description().name, opened.message);
    return 1;
  }
  const drivers::Description& device = driver->description();
  pacing_ = pacing_of(rig_, device);
  for (const std::string& sentence : unit_disagreements(rig_.calibration, device)) {
    spdlog::warn("{}", sentence);
  }
  open_consumers();

  model_change_.emplace(observer_for(rig_));
  LoopSettings settings = loop_settings(rig_, device, pacing_);
  if (recorder_) settings.recorder = &recorder_->stream;
  Loop loop(*driver, clock_, settings, Excitation(rig_.excitation, driven_rig(rig_)),
            model_change_->observer(), ledger_, streams());
  const std::unique_ptr<ControlServer> control = open_control(loop, device);

  const bool real_time = rig_.loop.real_time_scheduling && pacing_ != Pacing::free_running;
  if (real_time) log_grants({lock_memory(), latency_request_.request()});
  log_start(device);
  started_utc_us_ = utc_us();
  send(recording_info_message(rig_, started_utc_us_));
  for (Stream* stream : streams()) stream->start();
  run_loop(loop, *driver, control.get(), real_time);
  return finish(loop);
}

void Service::run_loop(Loop& loop, drivers::Driver& driver, ControlServer* control,
                       bool real_time) {
  started_ns_ = clock_.now_ns();
  LoopThread thread(loop, rig_.loop, real_time);
  DeviceSupervisor supervisor(driver, loop, [&thread] { thread.schedule(); });
  sd_notify(0, "READY=1\nSTATUS=running");

  control_ = control;
  housekeeping(thread, loop, driver.description());
  control_ = nullptr;
  // The loop makes no progress any more. systemd 252 suspends the watchdog when it stops a service,
  // but a notification, such as those during the ramp, resumes it.
  sd_notify(0, "STOPPING=1\nSTATUS=closing the device\nWATCHDOG_USEC=0");
  thread.join();
  drain_notices(loop);
  supervisor.stop();
  // The supervisor may not have got to it.
  if (loop.device_lost()) driver.stop();
  driver.close();
  // For a device that is present the loop has reported it.
  const char* const left_on = loop.device_lost() ? driver.left_on() : nullptr;
  if (left_on != nullptr) spdlog::error("{}", left_on);
}

SettingBounds Service::setting_bounds(const Loop& loop) const {
  return {rig_.limits, rig_.model.oscillator.excitation == physics::Excitation::force,
          rig_.loop.rate_hz, loop.snapshot().drive.gain};
}

void Service::claim_control_socket() {
  const LineServerSettings settings = line_server_settings(rig_);
  if (!settings.path.empty()) socket_.emplace(settings);
}

std::unique_ptr<ControlServer> Service::open_control(Loop& loop,
                                                     const drivers::Description& device) {
  const LineServerSettings settings = line_server_settings(rig_);
  if (!socket_) {
    spdlog::info("no control socket: set control.socket or --control");
    return nullptr;
  }
  auto control = std::make_unique<ControlServer>(
      std::move(*socket_), settings, loop, clock_, rig_.loop.rate_hz,
      ControlHandlers{
          .status = [this, &loop] { return status(loop); },
          .refusal =
              [this, &loop](const Setting& setting) {
                return refusal(rig_.excitation, setting_bounds(loop), setting);
              },
          .was_set =
              [this](const Setting& setting) {
                rig_.excitation = with_setting(rig_.excitation, setting);
              },
          .describe = [this] { return description_of(rig_); },
          .note = [this, &loop](
                      const std::string& text,
                      const std::string& rig) { return take_note(loop.snapshot(), text, rig); },
          .reload = [this, &loop, &device] { return reload(loop, device); },
          .propose_model =
              [this](ModelFile file) { return model_change_->propose(rig_, std::move(file)); },
          .model_answered = [this](const Answer& a) { return take_model(a); },
          .propose_drive =
              [this](DriveSamples samples) {
                return drive_change_.propose(rig_, std::move(samples));
              },
          .drive_answered = [this](const Answer& a) { return take_drive(a); }});
  spdlog::info("control socket: {}", settings.path.string());
  return control;
}

void Service::housekeeping(const LoopThread& thread, Loop& loop,
                           const drivers::Description& device) {
  std::int64_t next_status_ns = started_ns_ + status_period_ns;
  while (!thread.ended()) {
    if (serve_clients()) {
      while (const int signal = signals_.next()) handle_signal(signal, loop, device);
    }
    drain_notices(loop);
    // Notified by the loop's progress, not because this thread runs.
    const std::uint64_t cycles = loop.timing().cycles.load(std::memory_order_relaxed);
    if (cycles != watchdog_cycles_) sd_notify(0, "WATCHDOG=1");
    watchdog_cycles_ = cycles;
    if (clock_.now_ns() >= next_status_ns) {
      next_status_ns += status_period_ns;
      publish_losses();
      publish_status(loop);
    }
  }
}

/// Waits for clients and signals, for one period at most. True if a signal is pending.
bool Service::serve_clients() {
  if (control_ != nullptr) return control_->serve(housekeeping_period, signals_.file());
  pollfd file{signals_.file(), POLLIN, 0};
  return ::poll(&file, 1, static_cast<int>(housekeeping_period.count())) > 0;
}

void Service::handle_signal(int signal, Loop& loop, const drivers::Description& device) {
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
  spdlog::info(++stop_requests_ == 1 ? "stopping: ramping down (repeat to stop immediately)"
                                     : "stopping immediately");
}

// Applies what can change without a restart; the other changes are reported as such. Settings of
// the excitation change as by the command `set`, and are refused like there.
std::vector<std::string> Service::reload(Loop& loop, const drivers::Description& device) {
  const config::Rig now = config::load_rig(rig_.file);
  std::vector<std::string> out;
  for (const config::Change& change : config::changes(started_with_, now)) {
    std::string line = config::text(change);
    if (const auto setting = setting_change(change, now)) change_setting(loop, *setting, line);
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

// The recording and the live check follow the observer. Empty if the loop has not taken it.
std::string Service::take_model(const Answer& answer) {
  std::optional<NewModel> taken = model_change_->finish(answer);
  if (!taken) return {};
  const Event event = changed_event(taken->file, answer);
  rig_.model = taken->model;
  rig_.model_file = taken->file.name;
  rig_.model_text = taken->file.text;
  publish_and_log(event);
  send(recording_info_message(rig_, started_utc_us_));
  if (model_) model_->check.change_model(taken->model);
  return event.message;
}

// Empty if the loop has not taken it.
std::string Service::take_drive(const Answer& answer) {
  const auto settings = drive_change_.finish(answer);
  if (!settings) return {};
  rig_.excitation = *settings;
  const Event event = changed_event(drive_change_.samples(), answer);
  publish_and_log(event);
  return event.message;
}

Event Service::take_note(const Snapshot& now, const std::string& text, const std::string& rig) {
  if (!rig.empty() && rig != rig_.name) {
    throw InputError(Problem{"", 0, 0, "the note is about " + rig + ", and this is " + rig_.name});
  }
  Event note = note_event(text, now.frame.time_ns, now.frame.sequence);
  publish_event(note);
  spdlog::info("note: {}", note.message);
  return note;
}

/// Adds the reason of a refusal to the line about the change.
void Service::change_setting(Loop& loop, const Setting& setting, std::string& line) {
  if (const auto why = refusal(rig_.excitation, setting_bounds(loop), setting)) {
    line += ", refused: " + *why;
    return;
  }
  Command command;
  command.kind = Command::Kind::set;
  command.setting = setting;
  ask(loop, command);
  rig_.excitation = with_setting(rig_.excitation, setting);
}

void Service::ask(Loop& loop, const Command& command) {
  if (loop.ask(command)) return;
  throw InputError({rig_.file.string(), 0, 0, "the loop is busy with other commands; try again"});
}

void Service::publish_event(const Event& event) {
  send(event_message(event, utc_us()));
  if (control_ != nullptr) control_->publish(event);
}

void Service::publish_and_log(const Event& event) {
  publish_event(event);
  // Overruns are logged once a second, with the status.
  if (event.code != "overrun") log_event(event);
}

void Service::publish_throttled(const Event& event) {
  if (const auto now = throttle_.accept(event, clock_.now_ns(), {})) publish_and_log(*now);
}

void Service::publish_writer_events() {
  if (!recorder_) return;
  for (const Event& event : recorder_->writer->take_events()) {
    recording_damaged_ = recording_damaged_ || event.severity == Severity::error;
    publish_throttled(event);
  }
}

void Service::publish_losses() {
  for (const Event& event : losses_.update(ledger_.balance())) publish_throttled(event);
}

void Service::drain_notices(Loop& loop) {
  Notice notice;
  while (loop.next_notice(notice)) {
    if (notice.kind == Notice::Kind::overrun) {
      longest_unreported_overrun_ns_ = std::max(longest_unreported_overrun_ns_, notice.duration_ns);
    }
    if (const auto event = throttle_.accept(notice, clock_.now_ns())) publish_and_log(*event);
  }
  publish_writer_events();
  for (const Event& event : throttle_.due(clock_.now_ns())) publish_and_log(event);
  for (const Event& line : line_throttle_.due(clock_.now_ns())) log_event(line);
  publish_model_events();
}

void Service::publish_model_events() {
  if (!model_) return;
  while (const auto event = model_->check.next_event()) publish_and_log(*event);
}

Status Service::status(const Loop& loop) {
  Status out = status_of(loop.snapshot(), ledger_, loop.timing());
  out.uptime_ns = clock_.now_ns() - started_ns_;
  out.devices = loop.device_counts();
  if (model_) out.model = model_->check.verdict();
  for (const Consumer* consumer : {publisher_.get(), recorder_.get()}) {
    if (consumer != nullptr) out.lost_messages += consumer->stream.lost_messages();
  }
  if (!recorder_) return out;
  out.recording_failing = recorder_->stream.failing();
  out.recording = recorder_->writer->progress();
  std::error_code error;
  const auto space = std::filesystem::space(out.recording->file, error);
  if (!error) out.free_bytes = space.available;
  return out;
}

void Service::publish_status(const Loop& loop) {
  Status now = status(loop);
  now.degraded = now.late_cycles > late_cycles_reported_;
  if (now.degraded) {
    const std::string overrun_us = std::to_string(longest_unreported_overrun_ns_ / 1000);
    const Event line{Severity::warning, "late_cycles",
                     physics::counted(now.late_cycles - late_cycles_reported_, "cycle was late",
                                      "cycles were late") +
                         " since the last status; the longest overrun was " + overrun_us + " us"};
    if (line_throttle_.accept(line, clock_.now_ns(), {})) log_event(line);
    longest_unreported_overrun_ns_ = 0;
  }
  late_cycles_reported_ = now.late_cycles;
  describe_again();
  // The status comes last, so that a recording ends with its ledger.
  send(timing_message(loop.timing(), utc_us()));
  send(status_message(now, utc_us()));
  if (publisher_ && now.recording) publisher_->stream.send(recorder_message(now, utc_us()));
  if (control_ != nullptr) control_->publish(now);
  write_metrics_of(now);
  const std::string line = std::string("STATUS=") + name_of(now.state) + ", " +
                           physics::counted(now.ledger.produced, "frame") + ", " +
                           physics::counted(now.overruns, "overrun");
  sd_notify(0, line.c_str());
}

// For subscribers that came after the start. A recording has it as its first event.
void Service::describe_again() {
  if (publisher_ == nullptr || ++statuses_ % statuses_per_description != 0) return;
  publisher_->stream.send(recording_info_message(rig_, started_utc_us_));
}

void Service::write_metrics_of(const Status& status) {
  if (rig_.metrics.file.empty()) return;
  const std::string error =
      write_metrics(rig_.metrics.file, metrics_text(status, rig_.name, utc_us()));
  // Not again every second.
  if (!error.empty() && error != metrics_error_) spdlog::warn("no metrics: {}", error);
  metrics_error_ = error;
}

void Service::send(const Message& message) {
  if (publisher_) publisher_->stream.send(message);
  if (recorder_) recorder_->stream.send(message);
}

void Service::finish_consumers() {
  if (model_) model_->stream.finish(model_timeout);
  publish_model_events();
  if (publisher_) publisher_->stream.finish(publish_timeout);
  if (recorder_) recorder_->stream.finish(record_timeout);
  publish_writer_events();
  publish_losses();
  for (const Event& event : throttle_.flush()) publish_and_log(event);
  for (const Event& line : line_throttle_.flush()) log_event(line);
}

bool Service::close_writers() {
  bool closed = true;
  for (Consumer* consumer : {publisher_.get(), recorder_.get()}) {
    if (consumer == nullptr || consumer->writer->close()) continue;
    spdlog::error("the {} could not be closed cleanly", consumer->name);
    closed = false;
  }
  return closed;
}

int Service::finish(Loop& loop) {
  sd_notify(0, "STOPPING=1\nSTATUS=draining");
  drain_notices(loop);
  finish_consumers();
  // Every frame is accounted for now, so that the last status holds the complete ledger. It is
  // written directly: the threads of the streams have ended.
  publish_status(loop);
  const bool closed = close_writers();

  const Status last = status(loop);
  std::istringstream lines(text(last));
  for (std::string line; std::getline(lines, line);) spdlog::info("{}", line);
  const LoopEnd& end = loop.end_status();
  if (!last.ledger.is_closed()) {
    spdlog::error("the ledger does not balance: frames are unaccounted for");
    return 1;
  }
  if (end.reason == LoopEnd::Reason::fault) {
    spdlog::error("stopped by a fault: {}", end.message);
    return 1;
  }
  if (last.state == RigState::faulted && last.interlock != Interlock::just_started) {
    spdlog::error("ended with an uncleared fault: {}", last.cause);
    return 1;
  }
  if (const std::uint64_t lost = last.ledger.recorded.lost_in_total(); lost > 0) {
    spdlog::error("the recording is not whole: {} of {} frames were lost, see the ledger", lost,
                  last.ledger.produced);
    return 1;
  }
  if (recording_damaged_) spdlog::error("the recording is not whole, see the errors above");
  return closed && !recording_damaged_ ? 0 : 1;
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
  const auto check_written = [&rig](const char* option, const char* key, const auto& file) {
    const std::string wrong = config::wrong_with_output(rig, key, file);
    if (!wrong.empty()) {
      throw InputError({"", 0, 0, option + (": " + file.string()) + ' ' + wrong});
    }
  };
  if (overrides.record) {
    check_written("--record", "recording.file", *overrides.record);
    rig.recording.enabled = true;
    rig.recording.file = *overrides.record;
  }
  if (overrides.lcm_url) {
    const std::string wrong = config::wrong_with_lcm_url(*overrides.lcm_url);
    if (!wrong.empty())
      throw InputError({"", 0, 0, "--lcm-url " + *overrides.lcm_url + ": " + wrong});
    rig.lcm.enabled = true;
    rig.lcm.url = *overrides.lcm_url;
  }
  if (overrides.no_lcm) rig.lcm.enabled = false;
  if (overrides.control) {
    check_written("--control", "control.socket", *overrides.control);
    rig.control.socket = *overrides.control;
  }
  return rig;
}

Pacing pacing_of(const config::Rig& rig, const drivers::Description& device) {
  const bool simulated_time =
      rig.driver == config::DriverKind::simulated && !rig.simulated.real_time;
  const bool replayed_at_once = rig.driver == config::DriverKind::replay && rig.replay.speed == 0.0;
  if (simulated_time || replayed_at_once) return Pacing::free_running;
  return device.paced ? Pacing::driver : Pacing::deadlines;
}

sigset_t handled_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&signals, signal);
  return signals;
}

int serve(const config::Rig& rig) { return Service(rig).run(); }

}  // namespace stickslip::daemon
