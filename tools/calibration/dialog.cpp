// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/dialog.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "physics/number_text.h"
#include "tools/calibration/words.h"

namespace stickslip::calibration {

namespace {

constexpr double standard_gravity_m_s2 = 9.80665;
// From equator to pole gravity lies between 9.780 and 9.832 m/s^2.
constexpr double relative_gravity_sigma = (9.832 - 9.780) / 9.80665 / 3.4641;
constexpr double unsteady = 10.0;  // standard deviation over the smallest of all readings

std::string four_digits(double value) { return physics::number_text(value, 4); }

std::string trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1));
}

/// Removes a finite number from the beginning of the text.
std::optional<double> take_number(std::string_view& text) {
  std::string_view rest = text;
  if (rest.starts_with('+')) rest.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
  if (error != std::errc{} || !std::isfinite(value)) return std::nullopt;
  rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
  while (!rest.empty() && rest.front() == ' ') rest.remove_prefix(1);
  text = rest;
  return value;
}

struct Unit {
  std::string_view name;
  std::string_view of;  // unit of the channels it applies to
  double si;
  bool mass;
};

constexpr std::array units = {Unit{"kg", "N", 1.0, true},
                              Unit{"g", "N", 1.0e-3, true},
                              Unit{"mg", "N", 1.0e-6, true},
                              Unit{"N", "N", 1.0, false},
                              Unit{"mN", "N", 1.0e-3, false},
                              Unit{"m", "m", 1.0, false},
                              Unit{"mm", "m", 1.0e-3, false},
                              Unit{"um", "m", 1.0e-6, false},
                              Unit{"\xc2\xb5m", "m", 1.0e-6, false},
                              Unit{"m/s", "m/s", 1.0, false},
                              Unit{"mm/s", "m/s", 1.0e-3, false}};

/// Example values for questions, in units that fit the channel.
const char* example_of(Channel channel) {
  const std::string_view unit = info(channel).unit;
  if (unit == "N") return "200 g, 0.2 kg or 1.5 N";
  return unit == "m" ? "10 mm or 250 um" : "50 mm/s";
}

std::string things(Channel channel) {
  const std::string_view unit = info(channel).unit;
  if (unit == "N") return "weights";
  return unit == "m" ? "gauge blocks" : "known speeds";
}

}  // namespace

std::optional<KnownValue> known_value(std::string_view text, Channel channel, double gravity_m_s2) {
  const std::string line = trimmed(text);
  std::string_view rest = line;
  const auto number = take_number(rest);
  if (!number) return std::nullopt;
  if (rest.empty()) return *number == 0.0 ? std::optional(KnownValue{}) : std::nullopt;
  for (const Unit& unit : units) {
    if (unit.name != rest || unit.of != info(channel).unit) continue;
    const double si = *number * unit.si * (unit.mass ? gravity_m_s2 : 1.0);
    if (!std::isfinite(si)) return std::nullopt;
    return KnownValue{si, unit.mass};
  }
  return std::nullopt;
}

Dialog::Dialog(DialogSettings settings) : settings_(std::move(settings)) {
  settings_.fit.unit = info(settings_.channel).unit;
  say("Calibration of " + std::string(info(settings_.channel).stem) + " with " +
      things(settings_.channel) + ": the zero, then known values in ascending and descending " +
      "order, and the zero once more. Readings are averaged over " +
      four_digits(settings_.reading_s) +
      " s; the rig must be at rest, and channels with crosstalk into this one at zero. `again N` "
      "repeats point N, `list` shows the points, `quit` ends without a change.");
  if (settings_.before)
    say("Now: " + calibration_words(*settings_.before, settings_.channel) + ".");
  ask();
}

Dialog::Wants Dialog::wants() const {
  if (step_ == Step::over) return Wants::nothing;
  return reading_ ? Wants::reading : Wants::answer;
}

std::string Dialog::take_text() { return std::exchange(text_, {}); }

std::string Dialog::value_text(double si) const {
  return four_digits(si) + " " + std::string(info(settings_.channel).unit);
}

void Dialog::ask() {
  switch (step_) {
    case Step::reference:
      say("Which reference, e.g. \"weights set 12, class M1\"?");
      break;
    case Step::person:
      say("Who calibrates?");
      break;
    case Step::uncertainty:
      say(std::string("Standard uncertainty of one reference, e.g. 0.01 %, ") +
          (info(settings_.channel).unit == "N" ? "5 mg" : "1 um") +
          ", or 0? (A tolerance is 1.7 of them.)");
      break;
    case Step::zero:
      say("Remove all load, wait until it is at rest, then press Enter.");
      break;
    case Step::up:
      say(std::string("Apply the next reference and type its value, e.g. ") +
          example_of(settings_.channel) + "; Enter alone after the largest.");
      break;
    case Step::down:
      say("Descending: reduce to " + value_text(way_down_.back()) +
          ", then press Enter (`skip` omits it).");
      break;
    case Step::last_zero:
      say("Remove all load once more, then press Enter.");
      break;
    case Step::again:
      say("Point " + std::to_string(target_ + 1) + " again: apply " + value_text(target_si_) +
          ", then press Enter.");
      break;
    case Step::review:
      say(fit_->acceptable() ? "`accept`, `again N` or `quit`?" : "`again N` or `quit`?");
      break;
    case Step::range:
      say("Valid range, in " + std::string(info(settings_.channel).unit) +
          "? Enter for the range of the references, " + four_digits(proposed_->valid->low) +
          " to " + four_digits(proposed_->valid->high) + ", or LOW HIGH.");
      break;
    case Step::over:
      break;
  }
}

/// Handles the commands that every question accepts; true if the line was one.
bool Dialog::command(const std::string& line) {
  if (line == "quit") {
    step_ = Step::over;
    say("Nothing is changed.");
    return true;
  }
  if (line == "list") {
    for (std::size_t i = 0; i < points_.size(); ++i) {
      say("  " + std::to_string(i + 1) + "  " + value_text(points_[i].reference_si) + "  " +
          four_digits(points_[i].raw) + " +- " + four_digits(points_[i].raw_std));
    }
    if (points_.empty()) say("  no points yet");
    ask();
    return true;
  }
  if (line != "again" && !line.starts_with("again ")) return false;
  std::string_view rest = std::string_view(line).substr(5);
  while (!rest.empty() && rest.front() == ' ') rest.remove_prefix(1);
  const auto number = take_number(rest);
  if (!number || !rest.empty() || *number < 1.0 || *number > static_cast<double>(points_.size()) ||
      *number != std::floor(*number)) {
    say(points_.empty()
            ? "There are no points yet."
            : "`again` takes the number of a point, 1 to " + std::to_string(points_.size()) + ".");
    ask();
    return true;
  }
  if (step_ != Step::again) back_ = step_;
  step_ = Step::again;
  target_ = static_cast<std::size_t>(*number) - 1;
  target_si_ = points_[target_].reference_si;
  ask();
  return true;
}

void Dialog::answer(std::string_view typed) {
  if (wants() != Wants::answer) return;
  const std::string line = trimmed(typed);
  if (command(line)) return;
  switch (step_) {
    case Step::reference:
      if (line.empty()) {
        say("A calibration needs a reference.");
      } else {
        reference_ = line;
        step_ = Step::person;
      }
      ask();
      break;
    case Step::person:
      by_ = line;
      step_ = Step::uncertainty;
      ask();
      break;
    case Step::uncertainty:
      answer_uncertainty(line);
      break;
    case Step::zero:
    case Step::last_zero:
      if (line.empty()) {
        target_ = points_.size();
        read(0.0);
      } else {
        say("Expected Enter, `again N`, `list` or `quit`.");
        ask();
      }
      break;
    case Step::again:
      if (line.empty()) {
        read(target_si_);
      } else {
        say("Expected Enter, `again N`, `list` or `quit`.");
        ask();
      }
      break;
    case Step::up:
      answer_up(line);
      break;
    case Step::down:
      answer_down(line);
      break;
    case Step::review:
      answer_review(line);
      break;
    case Step::range:
      answer_range(line);
      break;
    case Step::over:
      break;
  }
}

void Dialog::answer_uncertainty(const std::string& line) {
  std::string_view rest = line;
  const auto share = take_number(rest);
  const auto value =
      known_value(line, settings_.channel, settings_.gravity_m_s2.value_or(standard_gravity_m_s2));
  if (share && *share >= 0.0 && rest == "%") {
    relative_sigma_ = *share / 100.0;
  } else if (value && value->si >= 0.0) {
    absolute_sigma_ = value->si;
  } else {
    say("Expected a share in %, a number with its unit, or 0; found \"" + line + "\".");
    ask();
    return;
  }
  step_ = Step::zero;
  ask();
}

void Dialog::answer_up(const std::string& line) {
  if (line.empty()) {
    begin_down();
    return;
  }
  const auto value =
      known_value(line, settings_.channel, settings_.gravity_m_s2.value_or(standard_gravity_m_s2));
  if (!value) {
    say(std::string("Expected a number with its unit, e.g. ") + example_of(settings_.channel) +
        "; found \"" + line + "\".");
    ask();
    return;
  }
  by_mass_ = by_mass_ || value->by_mass;
  target_ = points_.size();
  read(value->si);
}

void Dialog::begin_down() {
  way_down_.clear();
  for (const Point& point : points_) {
    if (point.reference_si != 0.0) way_down_.push_back(point.reference_si);
  }
  if (way_down_.size() < 2) {
    say("At least two values besides the zero are needed to test a straight line.");
    ask();
    return;
  }
  way_down_.pop_back();  // the largest, which is applied now
  step_ = Step::down;
  ask();
}

void Dialog::answer_down(const std::string& line) {
  if (line.empty()) {
    target_ = points_.size();
    read(way_down_.back());
    return;
  }
  if (line == "skip") {
    way_down_.pop_back();
    if (way_down_.empty()) step_ = Step::last_zero;
  } else {
    say("Expected Enter, `skip`, `again N`, `list` or `quit`.");
  }
  ask();
}

void Dialog::read(double reference_si) {
  target_si_ = reference_si;
  reading_ = true;
  say("Reading for " + four_digits(settings_.reading_s) + " s ...");
}

void Dialog::reading_failed(const std::string& why) {
  if (wants() != Wants::reading) return;
  reading_ = false;
  say("No reading: " + why);
  ask();
}

void Dialog::offer(const Reading& reading) {
  if (wants() != Wants::reading) return;
  if (!std::isfinite(reading.mean) || !(reading.std >= 0.0) || !std::isfinite(reading.std) ||
      !(reading.n >= 1.0)) {
    reading_failed("the channel was not valid throughout");
    return;
  }
  reading_ = false;
  Point point;
  point.raw = reading.mean;
  point.raw_std = reading.std / std::sqrt(reading.n);
  point.reference_si = target_si_;
  point.reference_sigma =
      std::hypot(target_si_ == 0.0 ? 0.0 : absolute_sigma_, relative_sigma_ * target_si_);
  if (target_ < points_.size()) {
    points_[target_] = point;
  } else {
    points_.push_back(point);
  }
  say("Point " + std::to_string(target_ + 1) + ": " + value_text(target_si_) + " reads " +
      four_digits(point.raw) + " +- " + four_digits(point.raw_std) +
      (settings_.raw_unit.empty() ? "" : " " + settings_.raw_unit));
  if (smallest_std_ > 0.0 && reading.std > unsteady * smallest_std_) {
    say("Its standard deviation is " + physics::number_text(reading.std / smallest_std_, 4) +
        " times the smallest of all readings: was it at rest? (`again " +
        std::to_string(target_ + 1) + "`)");
  }
  if (reading.std > 0.0) {
    smallest_std_ = smallest_std_ > 0.0 ? std::min(smallest_std_, reading.std) : reading.std;
  }
  after_reading();
}

void Dialog::after_reading() {
  switch (step_) {
    case Step::zero:
      step_ = Step::up;
      break;
    case Step::down:
      way_down_.pop_back();
      if (way_down_.empty()) step_ = Step::last_zero;
      break;
    case Step::last_zero:
      review();
      return;
    case Step::again:
      step_ = back_;
      // The proposal was computed from the previous value of the point.
      if (step_ == Step::review || step_ == Step::range) {
        review();
        return;
      }
      break;
    default:
      break;
  }
  ask();
}

void Dialog::review() {
  FitOptions options = settings_.fit;
  if (by_mass_ && !settings_.gravity_m_s2) {
    options.scale_sigma = std::hypot(options.scale_sigma, relative_gravity_sigma);
  }
  step_ = Step::review;
  fit_ = fit(points_, options);
  say(fit_text(*fit_, points_, settings_.channel, settings_.raw_unit));
  proposed_.reset();
  if (fit_->acceptable()) {
    proposed_ = calibration_of(*fit_, points_);
    proposed_->raw_unit = settings_.raw_unit;
    proposed_->date = settings_.date;
    proposed_->reference = reference_;
    proposed_->by = by_;
    if (settings_.before) proposed_->crosstalk = settings_.before->crosstalk;
    say(change_text(settings_.before, *proposed_, settings_.channel));
  }
  ask();
}

void Dialog::answer_review(const std::string& line) {
  if (line == "accept" && proposed_) {
    step_ = Step::range;
  } else {
    say(line == "accept" ? "It is refused for the reasons above." : "Unknown answer.");
  }
  ask();
}

void Dialog::answer_range(const std::string& line) {
  std::string_view rest = line;
  if (!line.empty()) {
    const auto low = take_number(rest);
    const auto high = low ? take_number(rest) : std::nullopt;
    if (!high || !rest.empty() || *low >= *high) {
      say("Expected two numbers, the lower first; found \"" + line + "\".");
      ask();
      return;
    }
    proposed_->valid = config::ValidRange{*low, *high};
  }
  result_ = proposed_;
  step_ = Step::over;
  say("Accepted.");
}

}  // namespace stickslip::calibration
