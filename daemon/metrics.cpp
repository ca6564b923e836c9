// SPDX-License-Identifier: Apache-2.0
#include "daemon/metrics.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <span>
#include <utility>

#include "physics/number_text.h"

namespace stickslip::daemon {
namespace {

/// Names as in status_t.
constexpr std::array<std::string_view, 5> states = {"idle", "armed", "running", "stopping",
                                                    "faulted"};

/// A label's value: the format requires escapes of backslash, quote and line feed only.
std::string escaped(std::string_view value) {
  std::string out;
  for (const char c : value) {
    if (c == '\n') {
      out += "\\n";
      continue;
    }
    if (c == '\\' || c == '"') out += '\\';
    out += c;
  }
  return out;
}

std::string text_of(double value) { return physics::shortest_text(value); }
std::string text_of(std::uint64_t value) { return std::to_string(value); }
std::string text_of(std::int64_t value) { return std::to_string(value); }

template <class Integer>
double seconds(Integer ns) {
  return static_cast<double>(ns) * 1e-9;
}

/// "ring full" as the value of a label.
std::string word(std::string_view name) {
  std::string out(name);
  for (char& c : out) {
    if (c == ' ') c = '_';
  }
  return out;
}

class Page {
 public:
  explicit Page(std::string_view rig) : rig_("rig=\"" + escaped(rig) + '"') {}

  void family(std::string_view name, std::string_view type, std::string_view help) {
    name_ = "stickslip_" + std::string(name);
    text_ += "# HELP " + name_ + ' ' + std::string(help) + "\n# TYPE " + name_ + ' ' +
             std::string(type) + '\n';
  }

  template <class Value>
  void sample(Value value, std::string_view labels = {}, std::string_view suffix = {}) {
    text_ += name_ + std::string(suffix) + '{' + rig_ + (labels.empty() ? "" : ",") +
             std::string(labels) + "} " + text_of(value) + '\n';
  }

  template <class Value>
  void single(std::string_view name, std::string_view type, std::string_view help, Value value) {
    family(name, type, help);
    sample(value);
  }

  std::string take() { return std::move(text_); }

 private:
  std::string rig_;
  std::string name_;
  std::string text_;
};

std::uint64_t flag(bool value) { return value ? 1 : 0; }

void add_state(Page& page, const Status& status) {
  page.family("state", "gauge", "1 for the current state of the rig, 0 for the others.");
  for (const std::string_view state : states) {
    page.sample(flag(name_of(status.state) == state), "state=\"" + std::string(state) + '"');
  }
  page.single("fault", "gauge", "1 while a fault is latched and the amplifier is off.",
              flag(status.state == RigState::faulted));
  page.single("uptime_seconds", "gauge", "Time since the daemon started.",
              seconds(status.uptime_ns));
}

void add_ledger(Page& page, const Status& status) {
  const Balance& ledger = status.ledger;
  struct Consumer {
    std::string label;
    const AccountBalance& account;
  };
  const std::array<Consumer, 2> consumers = {
      {{"consumer=\"publisher\"", ledger.published}, {"consumer=\"recorder\"", ledger.recorded}}};
  page.single("frames_produced_total", "counter", "Frames that the driver yielded.",
              ledger.produced);
  page.family("frames_delivered_total", "counter", "Frames accepted by the network or the disk.");
  for (const Consumer& each : consumers) {
    if (each.account.enabled) page.sample(each.account.delivered, each.label);
  }
  page.family("frames_lost_total", "counter", "Frames that were not delivered, by reason.");
  for (const Consumer& each : consumers) {
    for (std::size_t i = 0; each.account.enabled && i < loss_count; ++i) {
      page.sample(each.account.lost[i], each.label + ",reason=\"" + word(loss_names[i]) + '"');
    }
  }
  if (ledger.recorded.enabled) {
    page.single("recording_failing", "gauge",
                "1 while the recording loses frames: full disk, lost log, too slow.",
                flag(status.recording_failing));
  }
  page.family("frames_pending", "gauge", "Frames in transit; after the end: unaccounted for.");
  for (const Consumer& each : consumers) {
    if (each.account.enabled) page.sample(ledger.pending(each.account), each.label);
  }
}

struct Durations {
  std::int64_t p50_ns;
  std::int64_t p99_ns;
  std::int64_t max_ns;
  std::uint64_t total_ns;
  std::uint64_t count;
};

void add_durations(Page& page, const std::string& name, const std::string& of,
                   const Durations& durations) {
  page.family(name + "_seconds", "summary", of + ", since the start; quantiles to 19 %.");
  page.sample(seconds(durations.p50_ns), "quantile=\"0.5\"");
  page.sample(seconds(durations.p99_ns), "quantile=\"0.99\"");
  page.sample(seconds(durations.total_ns), {}, "_sum");
  page.sample(durations.count, {}, "_count");
  page.single(name + "_max_seconds", "gauge", of + ": the longest since the start.",
              seconds(durations.max_ns));
}

void add_timing(Page& page, const Status& status) {
  page.single("cycles_total", "counter", "Cycles of the real-time loop.", status.cycles);
  page.single("overruns_total", "counter", "Cycles that ended after the next deadline.",
              status.overruns);
  page.single("skipped_periods_total", "counter", "Periods without a cycle, from overruns.",
              status.skipped_periods);
  page.single("overrun_max_seconds", "gauge", "The longest overrun since the start.",
              seconds(status.longest_overrun_ns));
  page.single("timing_degraded", "gauge", "1 if cycles were late since the last status.",
              flag(status.degraded));
  add_durations(page, "wakeup_lateness", "Lateness of the loop's wake-up against its deadline",
                {status.lateness_p50_ns, status.lateness_p99_ns, status.lateness_max_ns,
                 status.lateness_total_ns, status.lateness_count});
  add_durations(page, "cycle_work", "Duration of a cycle from wake-up to the last hand-over",
                {status.work_p50_ns, status.work_p99_ns, status.work_max_ns, status.work_total_ns,
                 status.work_count});
}

void add_device(Page& page, const Status& status) {
  page.single("frames_missing_at_source_total", "counter",
              "Frames lost by the device, from jumps of its sequence number.",
              status.missing_at_source);
  page.single("readings_not_finite_total", "counter", "Readings that were NaN or infinite.",
              status.not_finite);
  page.single("failed_reads_total", "counter", "Failed reads of the device.", status.failed_reads);
  page.single("failed_writes_total", "counter", "Failed writes to the device.",
              status.failed_writes);
  page.single("lost_messages_total", "counter",
              "Events, estimates and status messages that were dropped.", status.lost_messages);
}

std::string label(std::string_view name, std::string_view value) {
  return std::string(name) + "=\"" + escaped(value) + '"';
}

void add_device_counts(Page& page, std::span<const drivers::Count> counts) {
  const auto add = [&](drivers::Count::Kind kind, const char* name) {
    for (const drivers::Count& count : counts) {
      if (count.kind != kind) continue;
      page.sample(count.value, label("device", count.device) + ',' + label(name, count.name));
    }
  };
  page.family("device_events_total", "counter", "Events of a device, by its own count.");
  add(drivers::Count::Kind::sum, "event");
  page.family("device_level", "gauge", "Levels that a device reports, such as its backlog.");
  add(drivers::Count::Kind::level, "level");
}

std::string error_text() { return std::strerror(errno); }

bool write_all(int file, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(file, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

}  // namespace

std::string metrics_text(const Status& status, std::string_view rig, std::int64_t utc_us) {
  Page page(rig);
  page.family("info", "gauge", "Always 1; labels with the running version.");
  page.sample(std::uint64_t{1}, "version=\"" STICKSLIP_VERSION "\"");
  page.single("updated_timestamp_seconds", "gauge", "Time of the latest update, since 1970.",
              static_cast<double>(utc_us) * 1e-6);
  add_state(page, status);
  add_ledger(page, status);
  add_timing(page, status);
  add_device(page, status);
  add_device_counts(page, status.devices.all());
  return page.take();
}

std::string write_metrics(const std::filesystem::path& file, const std::string& text) {
  // In the same folder, so that the rename is atomic; not *.prom, which would be collected.
  const std::string temporary = file.string() + ".new";
  const int out =
      ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (out < 0) return temporary + " cannot be written: " + error_text();
  std::string problem;
  // The unit's umask, which protects recordings, must not apply.
  if (::fchmod(out, 0644) != 0 || !write_all(out, text)) {
    problem = temporary + " cannot be written: " + error_text();
  }
  if (::close(out) != 0 && problem.empty())
    problem = temporary + " cannot be written: " + error_text();
  if (problem.empty() && std::rename(temporary.c_str(), file.c_str()) != 0) {
    problem = file.string() + " cannot be replaced: " + error_text();
  }
  if (!problem.empty()) ::unlink(temporary.c_str());
  return problem;
}

}  // namespace stickslip::daemon
