#include "daemon/service.h"

#include <spdlog/spdlog.h>
#include <systemd/sd-daemon.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <ctime>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/clock.h"
#include "daemon/event.h"
#include "daemon/ledger.h"
#include "daemon/messages.h"
#include "daemon/outlet.h"
#include "daemon/realtime.h"
#include "daemon/status.h"
#include "daemon/stream.h"
#include "drivers/make_driver.h"
#include "physics/problem.h"
#include "protocol/recording.h"

namespace stickslip::daemon {
namespace {

using namespace std::chrono_literals;

constexpr int loop_priority = 50;
constexpr auto housekeeping_period = 50ms;
constexpr std::int64_t status_period_ns = 1'000'000'000;
// Patience at the end: the network takes what it takes at once; a disk may be busy.
constexpr auto publish_patience = 5s;
constexpr auto record_patience = 30s;

std::int64_t wall_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// Waits for one of the stop signals; true where one came.
bool stop_signal_within(std::chrono::nanoseconds wait) {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  const timespec timeout{wait.count() / 1'000'000'000, wait.count() % 1'000'000'000};
  return sigtimedwait(&signals, nullptr, &timeout) > 0;
}

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

/// Everything around the loop while it runs, and the order in which it ends.
class Service {
 public:
  explicit Service(const config::Rig& rig) : rig_(rig) {}

  int run();

 private:
  std::vector<Frame> frames_to_replay() const;
  void open_consumers();
  std::vector<Stream*> streams();
  LoopSettings loop_settings() const;
  void say_grants(const std::vector<Grant>& grants) const;
  void housekeeping(Loop& loop);
  void drain_notices(Loop& loop);
  Status status(const Loop& loop);
  void send_status(const Loop& loop);
  void send(const Message& message);
  int finish(Loop& loop);

  Ledger ledger_;
  const config::Rig& rig_;
  MonotonicClock clock_;
  Pacing pacing_ = Pacing::deadlines;
  std::unique_ptr<Consumer> publisher_;
  std::unique_ptr<Consumer> recorder_;
  ProcessorLatencyRequest latency_request_;
  std::atomic<bool> loop_ended_{false};
  std::int64_t started_ns_ = 0;
  std::uint64_t cycles_fed_ = 0;
  std::uint64_t overruns_told_ = 0;
  std::int64_t longest_untold_ns_ = 0;
};

std::vector<Frame> Service::frames_to_replay() const {
  if (rig_.driver != config::DriverKind::replay) return {};
  return protocol::read_recording(rig_.replay.recording).frames;
}

void Service::open_consumers() {
  StreamSettings settings;
  settings.frames_per_block = static_cast<std::size_t>(std::max(1, rig_.loop.frames_per_block));
  settings.ring_frames =
      std::max<std::size_t>(16384, static_cast<std::size_t>(std::ceil(rig_.loop.rate_hz * 10.0)));
  // As fast as it goes, a frame never waits long, and blocks are the same at every run.
  if (pacing_ == Pacing::free) settings.longest_wait = std::chrono::hours(1);
  if (rig_.recording.enabled) {
    recorder_ = std::make_unique<Consumer>("recorder", open_log(rig_.recording.file),
                                           ledger_.recorded(), settings);
  }
  if (rig_.lcm.enabled) {
    publisher_ = std::make_unique<Consumer>("publisher", open_lcm(rig_.lcm.url),
                                            ledger_.published(), settings);
  }
}

std::vector<Stream*> Service::streams() {
  std::vector<Stream*> out;
  if (recorder_) out.push_back(&recorder_->stream);
  if (publisher_) out.push_back(&publisher_->stream);
  return out;
}

LoopSettings Service::loop_settings() const {
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
  settings.calibration = Calibration(rig_.calibration);
  // A recording may have gaps; a device may not.
  settings.longest_silence_ns = rig_.driver == config::DriverKind::replay ? 0 : 100'000'000;
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
  open_consumers();

  const std::unique_ptr<Observer> observer = observer_for(rig_);
  Loop loop(*driver, clock_, loop_settings(), Excitation(rig_.excitation), observer.get(), ledger_,
            streams());

  const bool real_time = rig_.loop.real_time_scheduling && pacing_ != Pacing::free;
  if (real_time) say_grants({lock_memory(), latency_request_.request()});
  spdlog::info("{}: {}, {} frames/s{}", rig_.name, driver->description().name, rig_.loop.rate_hz,
               pacing_ == Pacing::free ? ", as fast as it goes" : "");
  if (publisher_) spdlog::info("publishing at {}", rig_.lcm.url);
  if (recorder_) spdlog::info("recording into {}", rig_.recording.file.string());

  send(recording_info_message(rig_, wall_us()));
  for (Stream* stream : streams()) stream->start();

  started_ns_ = clock_.now_ns();
  std::atomic<int> granted{-1};
  Grant scheduling;
  std::thread loop_thread([&] {
    if (real_time) scheduling = make_thread_real_time(loop_priority);
    granted.store(real_time ? 1 : 0, std::memory_order_release);
    loop.run();
    loop_ended_.store(true, std::memory_order_release);
  });
  while (granted.load(std::memory_order_acquire) < 0) std::this_thread::sleep_for(100us);
  if (real_time) say_grants({scheduling});
  sd_notify(0, "READY=1\nSTATUS=running");

  housekeeping(loop);
  loop_thread.join();
  driver->close();
  return finish(loop);
}

void Service::housekeeping(Loop& loop) {
  std::int64_t next_status_ns = started_ns_ + status_period_ns;
  int requests = 0;
  while (!loop_ended_.load(std::memory_order_acquire)) {
    if (stop_signal_within(housekeeping_period)) {
      loop.request_stop();
      sd_notify(0, "STOPPING=1\nSTATUS=ramping down");
      spdlog::info(++requests == 1 ? "stopping: ramping down (once more: at once)"
                                   : "stopping at once");
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
}

void Service::drain_notices(Loop& loop) {
  Notice notice;
  while (loop.next_notice(notice)) {
    const Event event = event_of(notice);
    send(event_message(event, wall_us()));
    // A machine that is too slow need not be made slower by its log: overruns are told together.
    if (notice.kind == Notice::Kind::overrun) {
      longest_untold_ns_ = std::max(longest_untold_ns_, notice.duration_ns);
    } else {
      log_event(event);
    }
  }
}

Status Service::status(const Loop& loop) {
  Status out = status_of(loop.state(), ledger_, loop.timing());
  out.uptime_ns = clock_.now_ns() - started_ns_;
  for (const Consumer* consumer : {publisher_.get(), recorder_.get()}) {
    if (consumer != nullptr) out.lost_messages += consumer->stream.lost_messages();
  }
  return out;
}

void Service::send_status(const Loop& loop) {
  Status now = status(loop);
  now.degraded = now.overruns > overruns_told_;
  if (now.degraded) {
    spdlog::warn("{} cycles came late since the last status, by up to {:.3f} ms",
                 now.overruns - overruns_told_, static_cast<double>(longest_untold_ns_) * 1e-6);
    longest_untold_ns_ = 0;
  }
  overruns_told_ = now.overruns;
  send(status_message(now, wall_us()));
  const std::string line = std::string("STATUS=") + name_of(now.state) + ", " +
                           std::to_string(now.ledger.produced) + " frames, " +
                           std::to_string(now.overruns) + " overruns";
  sd_notify(0, line.c_str());
}

void Service::send(const Message& message) {
  if (publisher_) publisher_->stream.send(message);
  if (recorder_) recorder_->stream.send(message);
}

int Service::finish(Loop& loop) {
  sd_notify(0, "STOPPING=1\nSTATUS=draining");
  drain_notices(loop);
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
  return rig;
}

Pacing pacing_of(const config::Rig& rig, const drivers::Description& device) {
  if (rig.driver == config::DriverKind::simulated && !rig.simulated.real_time) return Pacing::free;
  if (rig.driver == config::DriverKind::replay && rig.replay.speed == 0.0) return Pacing::free;
  return device.paced ? Pacing::driver : Pacing::deadlines;
}

int serve(const config::Rig& rig) { return Service(rig).run(); }

}  // namespace stickslip::daemon
