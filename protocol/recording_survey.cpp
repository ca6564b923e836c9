// SPDX-License-Identifier: Apache-2.0
#include "protocol/recording_survey.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <istream>
#include <limits>
#include <map>
#include <numeric>
#include <string_view>

#include "physics/number_text.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "protocol/recording.h"
#include "protocol/recording_log.h"
#include "protocol/sha256.h"

namespace stickslip::protocol {
namespace {

using physics::counted;

constexpr std::size_t max_places_listed = 100;

enum class Validity : std::uint8_t { yes, bad_checksum, undecodable };

/// Decoded message of one event. Events on other channels are accepted without decoding.
class Content {
 public:
  Validity take(const LogEvent& event) {
    frames.clear();
    const std::string& channel = event.channel;
    if (channel == frames_channel) {
      if (decode(event.data, block_) && from_block(block_, frames)) return Validity::yes;
      return is_frame_block(event.data) ? Validity::bad_checksum : Validity::undecodable;
    }
    bool valid = true;
    if (channel == recording_channel) valid = decode(event.data, info);
    if (channel == status_channel) valid = decode(event.data, status);
    if (channel == event_channel) valid = decode(event.data, note);
    if (channel == estimate_channel) valid = decode(event.data, estimate_);
    if (channel == excitation_channel) valid = decode(event.data, excitation_);
    if (channel == recorder_channel) valid = decode(event.data, recorder_);
    return valid ? Validity::yes : Validity::undecodable;
  }

  static bool is_ours(const std::string& channel) {
    return std::any_of(lcm_channels.begin(), lcm_channels.end(),
                       [&channel](const LcmChannel& known) { return known.name == channel; });
  }

  std::vector<Frame> frames;
  recording_info_t info{};
  status_t status{};
  event_t note{};

 private:
  static bool is_frame_block(std::span<const std::uint8_t> bytes) {
    auto type = static_cast<std::uint64_t>(frame_block_t::getHash());
    if (bytes.size() < 8) return false;
    for (std::size_t i = 8; i > 0; --i, type >>= 8U) {
      if (bytes[i - 1] != static_cast<std::uint8_t>(type & 0xFFU)) return false;
    }
    return true;
  }

  frame_block_t block_{};
  friction_estimate_t estimate_{};
  excitation_t excitation_{};
  recorder_t recorder_{};
};

/// Receiver of the items of a log.
class Visitor {
 public:
  Visitor() = default;
  Visitor(const Visitor&) = delete;
  Visitor& operator=(const Visitor&) = delete;
  virtual ~Visitor() = default;
  virtual void valid(const LogEvent& event, const Content& content) = 0;
  /// An event whose message is invalid.
  virtual void invalid(const LogEvent& event, Validity why) = 0;
  /// Bytes outside of events.
  virtual void damage(const LogEvent& place, const std::string& why) = 0;
  virtual void cut_off(const LogEvent& place) = 0;
};

void walk(std::istream& in, const std::string& name, Visitor& visitor,
          const ProgressCallback& done) {
  EventReader reader(in, name, done);
  LogEvent event;
  Content content;
  while (true) {
    switch (reader.next(event)) {
      case EventReader::Found::end:
        return;
      case EventReader::Found::cut_off:
        visitor.cut_off(event);
        break;
      case EventReader::Found::damage:
        visitor.damage(event, reader.why());
        break;
      case EventReader::Found::event: {
        const Validity valid = content.take(event);
        const bool verified = valid == Validity::yes && Content::is_ours(event.channel);
        if (!event.followed && !verified) {
          // Its lengths may be damaged, and intact events may be within them.
          reader.reject(event);
        }
        if (valid != Validity::yes) {
          visitor.invalid(event, valid);
        } else if (event.followed || verified) {
          visitor.valid(event, content);
        }
      }
    }
  }
}

class Survey final : public Visitor {
 public:
  explicit Survey(LogSurvey& out) : out_(out) {}

  void valid(const LogEvent& event, const Content& content) override {
    if (next_number_ && event.number != *next_number_) ++out_.misnumbered;
    take_number(event);
    count(event);
    for (const Frame& frame : content.frames) take(frame);
    if (event.channel == recording_channel) {
      if (out_.events == 1) out_.info = content.info;
      take_digests(content.info);
    }
    if (event.channel == event_channel && content.note.code == model_changed_code) {
      out_.model_changes.push_back({content.note.time_ns, content.note.message});
    }
    if (event.channel == status_channel && is_of_the_recorder()) take_ledger(content.status);
  }

  void invalid(const LogEvent& event, Validity why) override {
    take_number(event);
    if (why == Validity::bad_checksum) {
      ++out_.bad_checksums;
    } else {
      ++out_.undecodable;
    }
    if (event.followed) {
      add_damage(event, why == Validity::bad_checksum
                            ? "a block of frames with a bad checksum"
                            : "not a message of the type of " + event.channel);
    }
  }

  void damage(const LogEvent& place, const std::string& why) override {
    ++out_.damaged_places;
    add_damage(place, why);
    next_number_.reset();  // the number of lost events is unknown
  }

  void cut_off(const LogEvent& place) override { out_.cut_off_bytes = place.end - place.at; }

  void finish() { out_.time_steps = time_steps_.found(); }

 private:
  void add_damage(const LogEvent& place, const std::string& why) {
    out_.damaged_bytes += place.end - place.at;
    if (out_.damaged.size() < max_places_listed) {
      out_.damaged.push_back({place.at, place.end - place.at, why});
    }
  }

  void take_number(const LogEvent& event) {
    if (event.number < std::numeric_limits<std::int64_t>::max()) next_number_ = event.number + 1;
  }

  void count(const LogEvent& event) {
    ++out_.events;
    const auto [known, is_new] = place_.try_emplace(event.channel, out_.channels.size());
    if (is_new) out_.channels.push_back({event.channel, 0, 0});
    ChannelEvents& channel = out_.channels[known->second];
    ++channel.events;
    channel.bytes += event.data.size();
  }

  void take(const Frame& frame) {
    if (out_.frames == 0) {
      out_.first_time_ns = frame.time_ns;
      out_.first_sequence = frame.sequence;
    } else {
      if (frame.time_ns <= out_.last_time_ns) ++out_.times_back;
      if (frame.sequence > out_.last_sequence) {
        time_steps_.add(out_.last_sequence, out_.last_time_ns, frame.time_ns,
                        frame.sequence - out_.last_sequence);
      }
      if (frame.sequence <= out_.last_sequence) {
        ++out_.repeats;
      } else if (frame.sequence - out_.last_sequence > 1) {
        ++out_.gaps;
        out_.missing += frame.sequence - out_.last_sequence - 1;
      }
    }
    ++out_.frames;
    out_.last_time_ns = frame.time_ns;
    out_.last_sequence = frame.sequence;
    for (const Channel channel : all_channels) {
      if (!frame.has(channel)) continue;
      ChannelRange& range = out_.ranges[index_of(channel)];
      const double value = frame[channel];
      range.least = range.values == 0 ? value : std::min(range.least, value);
      range.greatest = range.values == 0 ? value : std::max(range.greatest, value);
      ++range.values;
    }
  }

  void take_digests(const recording_info_t& info) {
    const auto compare = [this](const char* name, const std::string& text,
                                const std::string& digest) {
      auto& altered = out_.altered_texts;
      if (std::find(altered.begin(), altered.end(), name) != altered.end()) return;
      if (digest != (text.empty() ? std::string() : sha256_of(text))) altered.emplace_back(name);
    };
    compare("configuration", info.configuration, info.configuration_sha256);
    compare("model", info.model, info.model_sha256);
    compare("calibration", info.calibration, info.calibration_sha256);
    compare("fault_script", info.fault_script, info.fault_script_sha256);
  }

  // A log recorded from LCM also contains a daemon's ledger, but not that of the log.
  bool is_of_the_recorder() const { return out_.info && out_.info->program == "stickslipd"; }

  void take_ledger(const status_t& status) {
    if (status.recording == 0) return;
    RecordedLedger ledger;
    ledger.produced = status.produced;
    ledger.recorded = status.recorded;
    ledger.loss_names = status.record_loss_name;
    ledger.losses = status.record_loss;
    ledger.frames_before_it = out_.frames;
    out_.ledger = std::move(ledger);
  }

  LogSurvey& out_;
  TimeSteps time_steps_;
  std::map<std::string, std::size_t> place_;
  std::optional<std::int64_t> next_number_ = 0;
};

class Repairer final : public Visitor {
 public:
  Repairer(RepairResult& out, const std::function<void(const LogEvent&)>& keep)
      : out_(out), keep_(keep) {}

  void valid(const LogEvent& event, const Content& content) override {
    if (!continues(content.frames)) {
      ++out_.blocks_back_in_time;
      return;
    }
    ++out_.events;
    out_.frames += content.frames.size();
    keep_(event);
  }
  void invalid(const LogEvent& event, Validity why) override {
    ++(why == Validity::bad_checksum ? out_.bad_checksums : out_.undecodable);
    if (event.followed) out_.damaged_bytes += event.end - event.at;
  }
  void damage(const LogEvent& place, const std::string&) override {
    ++out_.damaged_places;
    out_.damaged_bytes += place.end - place.at;
  }
  void cut_off(const LogEvent& place) override { out_.cut_off_bytes = place.end - place.at; }

 private:
  bool continues(std::span<const Frame> frames) {
    std::optional<std::int64_t> last = last_ns_;
    for (const Frame& frame : frames) {
      if (last && frame.time_ns <= *last) return false;
      last = frame.time_ns;
    }
    last_ns_ = last;
    return true;
  }

  RepairResult& out_;
  const std::function<void(const LogEvent&)>& keep_;
  std::optional<std::int64_t> last_ns_;
};

std::ifstream open_log(const std::filesystem::path& file) {
  std::error_code failure;
  if (std::filesystem::is_directory(file, failure)) {
    throw InputError(Problem{file.string(), 0, 0, "is a folder; expected an LCM event log"});
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    throw InputError(
        Problem{file.string(), 0, 0, std::string("cannot be read: ") + std::strerror(errno)});
  }
  return in;
}

}  // namespace

std::int64_t RecordedLedger::lost() const {
  // Counts of a file may have any value, and their sum must not overflow.
  return static_cast<std::int64_t>(std::accumulate(
      losses.begin(), losses.end(), std::uint64_t{0},
      [](std::uint64_t sum, std::int64_t n) { return sum + static_cast<std::uint64_t>(n); }));
}

double LogSurvey::duration_s() const {
  return (static_cast<double>(last_time_ns) - static_cast<double>(first_time_ns)) * 1e-9;
}

double LogSurvey::rate_hz() const {
  double regular_s = duration_s();
  for (const TimeStep& step : time_steps) regular_s -= step.excess_s;
  if (frames < 2 || regular_s <= 0.0) return 0.0;
  return static_cast<double>(frames - 1 + missing) / regular_s;
}

std::uint64_t LogSurvey::unwritten() const {
  if (!ledger && info && info->frames >= 0) {
    const auto written = static_cast<std::uint64_t>(info->frames);
    return written > frames ? written - frames : 0;
  }
  if (!ledger) return 0;
  const std::uint64_t there =
      ledger->frames_before_it + static_cast<std::uint64_t>(info->frames_before);
  const auto recorded = static_cast<std::uint64_t>(ledger->recorded);
  return recorded > there ? recorded - there : 0;
}

bool LogSurvey::is_explained_by_gaps() const {
  const bool damage = damaged_places + bad_checksums + undecodable + misnumbered + repeats > 0;
  if (damage || cut_off_bytes > 0 || frames == 0) return false;
  const auto before = static_cast<std::uint64_t>(info->frames_before);
  const auto produced = static_cast<std::uint64_t>(ledger ? ledger->produced : info->frames);
  const std::uint64_t at_start = first_sequence > before ? first_sequence - before : 0;
  const std::uint64_t at_end = produced > last_sequence + 1 ? produced - last_sequence - 1 : 0;
  return unwritten() <= missing + at_start + at_end;
}

std::vector<std::string> LogSurvey::gap_sentences() const {
  std::vector<std::string> out;
  if (missing > 0) {
    out.push_back(counted(missing, "frame") + " missing in " + counted(gaps, "gap"));
  }
  if (unwritten() > 0 && is_explained_by_gaps()) {
    out.push_back(
        "lacks " + counted(unwritten(), "frame") +
        " of the recording that was published: it was received over LCM, which may lose them");
  }
  for (const TimeStep& step : time_steps) {
    if (out.size() >= max_places_listed) break;
    out.push_back(sentence_of(step));
  }
  return out;
}

std::vector<std::string> LogSurvey::faults() const {
  std::vector<std::string> out;
  const auto add = [&out](bool wrong, const std::string& sentence) {
    if (wrong) out.push_back(sentence);
  };
  add(damaged_places > 0, "damaged in " + counted(damaged_places, "place") + ", " +
                              counted(damaged_bytes, "byte") + " in all");
  add(bad_checksums > 0, counted(bad_checksums, "block") + " of frames with a bad checksum");
  add(undecodable > 0, counted(undecodable, "message") + " that cannot be decoded");
  add(misnumbered > 0, counted(misnumbered, "event") + " out of sequence: events were removed");
  add(cut_off_bytes > 0,
      "truncated: the last " + counted(cut_off_bytes, "byte") + " are an incomplete event");
  add(events == 0, "has no events");
  add(times_back > 0, counted(times_back, "frame") + " with a time that does not increase");
  for (const std::string& text : altered_texts) {
    out.push_back("its " + text + " does not match its SHA-256");
  }
  if (info && info->frames >= 0 && static_cast<std::uint64_t>(info->frames) != frames &&
      (missing == 0 || !is_explained_by_gaps())) {
    out.push_back("has " + std::to_string(frames) + " frames; " + std::to_string(info->frames) +
                  " were written");
  }
  if (ledger) {
    const auto before = static_cast<std::uint64_t>(info->frames_before);
    const std::uint64_t there = ledger->frames_before_it + before;
    const auto recorded = static_cast<std::uint64_t>(ledger->recorded);
    add((there < recorded && !is_explained_by_gaps()) || (ledger->closed() && there > recorded),
        "does not balance: the ledger has " + std::to_string(recorded - before) +
            " frames up to its last status, the log has " +
            std::to_string(ledger->frames_before_it));
  }
  return out;
}

LogSurvey survey_log(const std::filesystem::path& file, const ProgressCallback& done) {
  std::ifstream in = open_log(file);
  std::array<char, 4> head{};
  in.read(head.data(), head.size());
  const auto got = static_cast<std::size_t>(in.gcount());
  // A damaged log may begin with any bytes, but a text file is not a log.
  const bool text = got > 0 && std::all_of(head.begin(), head.begin() + in.gcount(), [](char c) {
                      return c == '\t' || c == '\n' || c == '\r' || (c >= 0x20 && c < 0x7F);
                    });
  if (text) {
    throw InputError(Problem{file.string(), 0, 0, "is text, not an LCM event log"});
  }
  return survey_log(in, file.string(), done);
}

LogSurvey survey_log(std::istream& in, const std::string& name, const ProgressCallback& done) {
  LogSurvey out;
  out.source = name;
  in.clear();
  in.seekg(0, std::ios::end);
  out.bytes = in.tellg();
  Survey survey(out);
  walk(in, name, survey, done);
  survey.finish();
  return out;
}

bool RepairResult::dropped_anything() const {
  return damaged_places > 0 || bad_checksums > 0 || undecodable > 0 || blocks_back_in_time > 0 ||
         cut_off_bytes > 0;
}

RepairResult repair_log(std::istream& in, const std::string& name,
                        const std::function<void(const LogEvent&)>& keep,
                        const ProgressCallback& done) {
  RepairResult out;
  Repairer mender(out, keep);
  walk(in, name, mender, done);
  return out;
}

RepairResult repair_log(const std::filesystem::path& file, const std::filesystem::path& out,
                        const ProgressCallback& done) {
  std::error_code none;
  if (std::filesystem::equivalent(file, out, none)) {
    throw InputError(Problem{out.string(), 0, 0,
                             "is the log itself; expected another file for the repaired one"});
  }
  std::ifstream in = open_log(file);
  LogWriter writer(out);
  const auto require = [&out](bool written) {
    if (!written) {
      throw InputError(
          Problem{out.string(), 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
    }
  };
  const auto keep = [&](const LogEvent& event) {
    require(writer.append(event.channel, event.data, event.time_us));
  };
  const RepairResult repair = repair_log(in, file.string(), keep, done);
  require(writer.close());
  if (repair.events == 0) {
    std::filesystem::remove(out, none);
    throw InputError(Problem{file.string(), 0, 0, "has no intact event of a log"});
  }
  return repair;
}

}  // namespace stickslip::protocol
