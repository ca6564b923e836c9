// SPDX-License-Identifier: Apache-2.0
// For libgpiod 2.x.
#include <gpiod.h>
#include <poll.h>

#include <cerrno>
#include <cstdlib>

#include "drivers/amplifier/gpio_lines.h"

namespace stickslip::drivers::gpio {

namespace {

template <auto release>
struct Release {
  template <typename Thing>
  void operator()(Thing* thing) const {
    release(thing);
  }
};
using OpenChip = std::unique_ptr<gpiod_chip, Release<gpiod_chip_close>>;
using ChipInfo = std::unique_ptr<gpiod_chip_info, Release<gpiod_chip_info_free>>;
using LineInfo = std::unique_ptr<gpiod_line_info, Release<gpiod_line_info_free>>;
using Settings = std::unique_ptr<gpiod_line_settings, Release<gpiod_line_settings_free>>;
using LineConfig = std::unique_ptr<gpiod_line_config, Release<gpiod_line_config_free>>;
using RequestConfig = std::unique_ptr<gpiod_request_config, Release<gpiod_request_config_free>>;
using Request = std::unique_ptr<gpiod_line_request, Release<gpiod_line_request_release>>;
using EventBuffer = std::unique_ptr<gpiod_edge_event_buffer, Release<gpiod_edge_event_buffer_free>>;

constexpr const char* consumer = "stickslip";
constexpr std::size_t events_at_once = 16;

gpiod_line_bias bias_of(config::GpioLine::Bias bias) {
  switch (bias) {
    case config::GpioLine::Bias::disabled:
      return GPIOD_LINE_BIAS_DISABLED;
    case config::GpioLine::Bias::pull_up:
      return GPIOD_LINE_BIAS_PULL_UP;
    case config::GpioLine::Bias::pull_down:
      return GPIOD_LINE_BIAS_PULL_DOWN;
    case config::GpioLine::Bias::as_is:
      break;
  }
  return GPIOD_LINE_BIAS_AS_IS;
}

std::size_t lines_of(gpiod_chip* chip) {
  const ChipInfo info(gpiod_chip_get_info(chip));
  return info ? gpiod_chip_info_get_num_lines(info.get()) : 0;
}

/// Negative: not found.
int find_line(gpiod_chip* chip, const std::string& line) {
  const int named = gpiod_chip_get_line_offset_from_name(chip, line.c_str());
  if (named >= 0) return named;
  if (line.empty() || line.find_first_not_of("0123456789") != std::string::npos) return -1;
  const unsigned long offset = std::strtoul(line.c_str(), nullptr, 10);
  return offset < lines_of(chip) ? static_cast<int>(offset) : -1;
}

Settings settings_of(const config::GpioLine& line, Use use, bool edges) {
  Settings settings(gpiod_line_settings_new());
  if (!settings) return settings;
  gpiod_line_settings_set_active_low(settings.get(), line.active_low);
  gpiod_line_settings_set_bias(settings.get(), bias_of(line.bias));
  if (use == Use::output) {
    gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_OUTPUT);
    gpiod_line_settings_set_output_value(settings.get(), GPIOD_LINE_VALUE_INACTIVE);
  } else {
    gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_INPUT);
    if (edges) gpiod_line_settings_set_edge_detection(settings.get(), GPIOD_LINE_EDGE_BOTH);
  }
  return settings;
}

/// Null, with errno, if they are not available.
Request request_all(gpiod_chip* chip, Use use, std::span<const config::GpioLine> lines,
                    std::span<const unsigned> offsets, bool edges) {
  const LineConfig config(gpiod_line_config_new());
  const RequestConfig how(gpiod_request_config_new());
  if (!config || !how) return nullptr;
  gpiod_request_config_set_consumer(how.get(), consumer);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const Settings settings = settings_of(lines[i], use, edges);
    if (!settings ||
        gpiod_line_config_add_line_settings(config.get(), &offsets[i], 1, settings.get()) != 0) {
      return nullptr;
    }
  }
  return Request(gpiod_chip_request_lines(chip, how.get(), config.get()));
}

/// All lines are requested together, and the library does not report which one failed.
Refusal refusal_of(gpiod_chip* chip, int error, std::span<const config::GpioLine> lines,
                   std::span<const unsigned> offsets) {
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const LineInfo info(gpiod_chip_get_line_info(chip, offsets[i]));
    if (!info || !gpiod_line_info_is_used(info.get())) continue;
    const char* by = gpiod_line_info_get_consumer(info.get());
    return {error, lines[i].line, by == nullptr ? "" : by};
  }
  return {error, lines.front().line, ""};
}

bool edges_may_be_unsupported(int error) {
  return error != EBUSY && error != EACCES && error != EPERM;
}

}  // namespace

struct Lines::Handles {
  OpenChip chip;
  Request request;
  EventBuffer events;
  std::vector<unsigned> offsets;
  std::vector<int> files;
};

Lines::Lines(std::unique_ptr<Handles> handles) : handles_(std::move(handles)) {}
Lines::~Lines() = default;

std::string library_version() { return gpiod_api_version(); }

std::optional<Chip> chip_at(const std::string& path, int& error) {
  const OpenChip chip(gpiod_chip_open(path.c_str()));
  const ChipInfo info(chip ? gpiod_chip_get_info(chip.get()) : nullptr);
  if (!info) {
    error = errno;
    return std::nullopt;
  }
  return Chip{path, gpiod_chip_info_get_name(info.get()), gpiod_chip_info_get_label(info.get()),
              gpiod_chip_info_get_num_lines(info.get())};
}

std::unique_ptr<Lines> Lines::request(const std::string& path, Use use,
                                      std::span<const config::GpioLine> lines, Refusal& refusal) {
  auto handles = std::make_unique<Handles>();
  handles->chip.reset(gpiod_chip_open(path.c_str()));
  if (!handles->chip) {
    refusal = {errno, "", ""};
    return nullptr;
  }
  for (const config::GpioLine& line : lines) {
    const int offset = find_line(handles->chip.get(), line.line);
    if (offset < 0) {
      refusal = {ENOENT, line.line, ""};
      return nullptr;
    }
    handles->offsets.push_back(static_cast<unsigned>(offset));
  }
  bool edges = use == Use::input;
  handles->request = request_all(handles->chip.get(), use, lines, handles->offsets, edges);
  if (!handles->request && edges && edges_may_be_unsupported(errno)) {
    edges = false;
    handles->request = request_all(handles->chip.get(), use, lines, handles->offsets, edges);
  }
  if (!handles->request) {
    refusal = refusal_of(handles->chip.get(), errno, lines, handles->offsets);
    return nullptr;
  }
  if (edges) {
    handles->events.reset(gpiod_edge_event_buffer_new(events_at_once));
    if (handles->events)
      handles->files.push_back(gpiod_line_request_get_fd(handles->request.get()));
  }
  return std::unique_ptr<Lines>(new Lines(std::move(handles)));
}

int Lines::set(std::size_t line, bool active) noexcept {
  return gpiod_line_request_set_value(
             handles_->request.get(), handles_->offsets[line],
             active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE) == 0
             ? 0
             : errno;
}

int Lines::get(std::size_t line) noexcept {
  const gpiod_line_value value =
      gpiod_line_request_get_value(handles_->request.get(), handles_->offsets[line]);
  if (value == GPIOD_LINE_VALUE_ERROR) return -errno;
  return value == GPIOD_LINE_VALUE_ACTIVE ? 1 : 0;
}

std::span<const int> Lines::edge_files() const noexcept { return handles_->files; }

int Lines::take_edges(std::span<bool> went_active) noexcept {
  if (handles_->files.empty()) return 0;
  pollfd waited{handles_->files.front(), POLLIN, 0};
  for (std::size_t taken = 0; taken<max_edges_per_call&& ::poll(&waited, 1, 0)> 0;) {
    if ((waited.revents & POLLIN) == 0) return ENODEV;
    const int count = gpiod_line_request_read_edge_events(handles_->request.get(),
                                                          handles_->events.get(), events_at_once);
    if (count < 0) return errno;
    taken += static_cast<std::size_t>(count);
    for (int i = 0; i < count; ++i) {
      gpiod_edge_event* event =
          gpiod_edge_event_buffer_get_event(handles_->events.get(), static_cast<unsigned long>(i));
      if (gpiod_edge_event_get_event_type(event) != GPIOD_EDGE_EVENT_RISING_EDGE) continue;
      for (std::size_t line = 0; line < handles_->offsets.size(); ++line) {
        if (handles_->offsets[line] == gpiod_edge_event_get_line_offset(event)) {
          went_active[line] = true;
        }
      }
    }
  }
  return 0;
}

}  // namespace stickslip::drivers::gpio
