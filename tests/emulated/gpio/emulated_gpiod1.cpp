// SPDX-License-Identifier: Apache-2.0
// The functions of libgpiod 1.6 that the drivers use, on emulated chips, with the real header.
#include <fcntl.h>
#include <gpiod.h>
#include <unistd.h>

#include <cerrno>
#include <deque>
#include <string>

#include "tests/emulated/gpio/emulated_gpio.h"

using stickslip::emulated::emulated_gpio;
using stickslip::emulated::GpioEdge;
using stickslip::emulated::GpioRequest;
using stickslip::emulated::Pull;

struct gpiod_line {
  gpiod_chip* chip = nullptr;
  unsigned offset = 0;
  bool requested = false;
  int edges[2] = {-1, -1};
  std::string consumer;  // when the line was looked up
};

struct gpiod_chip {
  std::string path;
  std::string name;
  std::string label;
  std::deque<gpiod_line> lines;
};

namespace {

int failed(int error) {
  errno = error;
  return error == 0 ? 0 : -1;
}

bool has(int flags, unsigned long flag) { return (static_cast<unsigned long>(flags) & flag) != 0; }

Pull pull_of(int flags) {
  if (has(flags, GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE)) return Pull::off;
  if (has(flags, GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP)) return Pull::up;
  if (has(flags, GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN)) return Pull::down;
  return Pull::as_is;
}

}  // namespace

extern "C" {

const char* gpiod_version_string(void) { return "1.6 emulated"; }

gpiod_chip* gpiod_chip_open(const char* path) {
  if (failed(emulated_gpio().open(path)) != 0) return nullptr;
  return new gpiod_chip{path, emulated_gpio().name(path), emulated_gpio().label(path), {}};
}

void gpiod_chip_close(gpiod_chip* chip) {
  for (gpiod_line& line : chip->lines) gpiod_line_release(&line);
  delete chip;
}

const char* gpiod_chip_name(gpiod_chip* chip) { return chip->name.c_str(); }
const char* gpiod_chip_label(gpiod_chip* chip) { return chip->label.c_str(); }
unsigned int gpiod_chip_num_lines(gpiod_chip* chip) { return emulated_gpio().lines(chip->path); }

gpiod_line* gpiod_chip_get_line(gpiod_chip* chip, unsigned int offset) {
  if (offset >= emulated_gpio().lines(chip->path)) {
    errno = EINVAL;
    return nullptr;
  }
  gpiod_line& line = chip->lines.emplace_back();
  line.chip = chip;
  line.offset = offset;
  line.consumer = emulated_gpio().consumer(chip->path, offset);
  return &line;
}

gpiod_line* gpiod_chip_find_line(gpiod_chip* chip, const char* name) {
  const int offset = emulated_gpio().find(chip->path, name);
  if (offset >= 0) return gpiod_chip_get_line(chip, static_cast<unsigned>(offset));
  errno = ENOENT;
  return nullptr;
}

const char* gpiod_line_consumer(gpiod_line* line) {
  return line->consumer.empty() ? nullptr : line->consumer.c_str();
}

int gpiod_line_request(gpiod_line* line, const gpiod_line_request_config* config, int value) {
  GpioRequest request;
  request.output = config->request_type == GPIOD_LINE_REQUEST_DIRECTION_OUTPUT;
  request.edges = config->request_type == GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES;
  request.initially_active = value != 0;
  request.active_low = has(config->flags, GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW);
  request.pull = pull_of(config->flags);
  request.consumer = config->consumer;
  if (request.edges && ::pipe2(line->edges, O_CLOEXEC) != 0) return -1;
  const int error =
      emulated_gpio().request(line->chip->path, line->offset, request, line->edges[1]);
  line->requested = error == 0;
  if (error != 0 && request.edges) {
    for (int& file : line->edges) {
      ::close(file);
      file = -1;
    }
  }
  return failed(error);
}

void gpiod_line_release(gpiod_line* line) {
  if (line->requested) emulated_gpio().release(line->chip->path, line->offset);
  line->requested = false;
  for (int& file : line->edges) {
    if (file >= 0) ::close(file);
    file = -1;
  }
}

int gpiod_line_set_value(gpiod_line* line, int value) {
  return failed(emulated_gpio().set(line->chip->path, line->offset, value != 0));
}

int gpiod_line_get_value(gpiod_line* line) {
  bool active = false;
  const int error = emulated_gpio().get(line->chip->path, line->offset, active);
  if (error != 0) return failed(error);
  return active ? 1 : 0;
}

int gpiod_line_event_get_fd(gpiod_line* line) { return line->edges[0]; }

int gpiod_line_event_read(gpiod_line* line, gpiod_line_event* event) {
  GpioEdge edge;
  if (::read(line->edges[0], &edge, sizeof edge) != static_cast<ssize_t>(sizeof edge)) return -1;
  emulated_gpio().edge_taken(line->chip->path, edge);
  event->event_type = edge.rising ? GPIOD_LINE_EVENT_RISING_EDGE : GPIOD_LINE_EVENT_FALLING_EDGE;
  return 0;
}
}
