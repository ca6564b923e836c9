// SPDX-License-Identifier: Apache-2.0
// For libgpiod 1.6.
#include <gpiod.h>
#include <poll.h>

#include <cerrno>
#include <cstdlib>

#include "drivers/amplifier/gpio_lines.h"

namespace stickslip::drivers::gpio {

namespace {

struct CloseChip {
  void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }
};
using OpenChip = std::unique_ptr<gpiod_chip, CloseChip>;

constexpr const char* consumer = "stickslip";

int flags_of(const config::GpioLine& line) {
  int flags = line.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  switch (line.bias) {
    case config::GpioLine::Bias::disabled:
      flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE;
      break;
    case config::GpioLine::Bias::pull_up:
      flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP;
      break;
    case config::GpioLine::Bias::pull_down:
      flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
      break;
    case config::GpioLine::Bias::as_is:
      break;
  }
  return flags;
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

gpiod_line* find_line(gpiod_chip* chip, const std::string& line) {
  if (gpiod_line* named = gpiod_chip_find_line(chip, line.c_str()); named != nullptr) return named;
  errno = ENOENT;
  if (!is_number(line)) return nullptr;
  const unsigned long offset = std::strtoul(line.c_str(), nullptr, 10);
  if (offset >= gpiod_chip_num_lines(chip)) return nullptr;
  return gpiod_chip_get_line(chip, static_cast<unsigned>(offset));
}

bool edges_may_be_unsupported(int error) {
  return error != EBUSY && error != EACCES && error != EPERM;
}

/// 0 or errno.
int request_one(gpiod_line* line, Use use, const config::GpioLine& settings, bool& has_edges) {
  has_edges = false;
  gpiod_line_request_config config{consumer, 0, flags_of(settings)};
  if (use == Use::output) {
    config.request_type = GPIOD_LINE_REQUEST_DIRECTION_OUTPUT;
    return gpiod_line_request(line, &config, 0) == 0 ? 0 : errno;
  }
  if (use == Use::input) {
    config.request_type = GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES;
    has_edges = gpiod_line_request(line, &config, 0) == 0;
    if (has_edges) return 0;
    if (!edges_may_be_unsupported(errno)) return errno;
  }
  config.request_type = GPIOD_LINE_REQUEST_DIRECTION_INPUT;
  return gpiod_line_request(line, &config, 0) == 0 ? 0 : errno;
}

}  // namespace

struct Lines::Handles {
  Handles() = default;
  Handles(const Handles&) = delete;
  Handles& operator=(const Handles&) = delete;
  ~Handles() {
    for (gpiod_line* line : lines) gpiod_line_release(line);
  }
  OpenChip chip;
  std::vector<gpiod_line*> lines;
  std::vector<int> files;               // of the lines with edge events
  std::vector<std::size_t> file_lines;  // indices of those lines
};

Lines::Lines(std::unique_ptr<Handles> handles) : handles_(std::move(handles)) {}
Lines::~Lines() = default;

std::string library_version() { return gpiod_version_string(); }

std::optional<Chip> chip_at(const std::string& path, int& error) {
  const OpenChip chip(gpiod_chip_open(path.c_str()));
  if (!chip) {
    error = errno;
    return std::nullopt;
  }
  return Chip{path, gpiod_chip_name(chip.get()), gpiod_chip_label(chip.get()),
              gpiod_chip_num_lines(chip.get())};
}

std::unique_ptr<Lines> Lines::request(const std::string& path, Use use,
                                      std::span<const config::GpioLine> lines, Refusal& refusal) {
  auto handles = std::make_unique<Handles>();
  handles->chip.reset(gpiod_chip_open(path.c_str()));
  if (!handles->chip) {
    refusal = {errno, "", ""};
    return nullptr;
  }
  for (const config::GpioLine& settings : lines) {
    gpiod_line* line = find_line(handles->chip.get(), settings.line);
    if (line == nullptr) {
      refusal = {errno, settings.line, ""};
      return nullptr;
    }
    bool has_edges = false;
    if (const int error = request_one(line, use, settings, has_edges); error != 0) {
      const char* by = gpiod_line_consumer(line);
      refusal = {error, settings.line, by == nullptr ? "" : by};
      return nullptr;
    }
    handles->lines.push_back(line);
    if (!has_edges) continue;
    handles->files.push_back(gpiod_line_event_get_fd(line));
    handles->file_lines.push_back(handles->lines.size() - 1);
  }
  return std::unique_ptr<Lines>(new Lines(std::move(handles)));
}

int Lines::set(std::size_t line, bool active) noexcept {
  return gpiod_line_set_value(handles_->lines[line], active ? 1 : 0) == 0 ? 0 : errno;
}

int Lines::get(std::size_t line) noexcept {
  const int value = gpiod_line_get_value(handles_->lines[line]);
  return value < 0 ? -errno : value;
}

std::span<const int> Lines::edge_files() const noexcept { return handles_->files; }

int Lines::take_edges(std::span<bool> went_active) noexcept {
  for (std::size_t i = 0; i < handles_->files.size(); ++i) {
    const std::size_t line = handles_->file_lines[i];
    pollfd waited{handles_->files[i], POLLIN, 0};
    for (std::size_t taken = 0; taken<max_edges_per_call&& ::poll(&waited, 1, 0)> 0; ++taken) {
      if ((waited.revents & POLLIN) == 0) return ENODEV;
      gpiod_line_event event{};
      if (gpiod_line_event_read(handles_->lines[line], &event) != 0) return errno;
      if (event.event_type == GPIOD_LINE_EVENT_RISING_EDGE) went_active[line] = true;
    }
  }
  return 0;
}

}  // namespace stickslip::drivers::gpio
