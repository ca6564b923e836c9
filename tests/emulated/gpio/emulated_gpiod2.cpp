// SPDX-License-Identifier: Apache-2.0
// The functions of libgpiod 2 in use, on emulated chips.
#include <fcntl.h>
#include <gpiod.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <map>
#include <string>
#include <vector>

#include "tests/emulated/gpio/emulated_gpio.h"

using stickslip::emulated::emulated_gpio;
using stickslip::emulated::GpioEdge;
using stickslip::emulated::GpioRequest;
using stickslip::emulated::Pull;

struct gpiod_chip {
  std::string path;
};
struct gpiod_chip_info {
  std::string name;
  std::string label;
  std::size_t lines = 0;
};
struct gpiod_line_info {
  std::string consumer;
};
struct gpiod_line_settings {
  GpioRequest request;
};
struct gpiod_line_config {
  std::map<unsigned, GpioRequest> lines;
};
struct gpiod_request_config {
  std::string consumer;
};
struct gpiod_line_request {
  std::string path;
  std::vector<unsigned> offsets;
  int edges[2] = {-1, -1};
};
struct gpiod_edge_event {
  GpioEdge edge;
};
struct gpiod_edge_event_buffer {
  std::vector<gpiod_edge_event> events;
};

namespace {

int failed(int error) {
  errno = error;
  return error == 0 ? 0 : -1;
}

}  // namespace

extern "C" {

const char* gpiod_api_version(void) { return "2 emulated"; }

gpiod_chip* gpiod_chip_open(const char* path) {
  return failed(emulated_gpio().open(path)) == 0 ? new gpiod_chip{path} : nullptr;
}
void gpiod_chip_close(gpiod_chip* chip) { delete chip; }

gpiod_chip_info* gpiod_chip_get_info(gpiod_chip* chip) {
  return new gpiod_chip_info{emulated_gpio().name(chip->path), emulated_gpio().label(chip->path),
                             emulated_gpio().lines(chip->path)};
}
void gpiod_chip_info_free(gpiod_chip_info* info) { delete info; }
const char* gpiod_chip_info_get_name(gpiod_chip_info* info) { return info->name.c_str(); }
const char* gpiod_chip_info_get_label(gpiod_chip_info* info) { return info->label.c_str(); }
size_t gpiod_chip_info_get_num_lines(gpiod_chip_info* info) { return info->lines; }

int gpiod_chip_get_line_offset_from_name(gpiod_chip* chip, const char* name) {
  const int offset = emulated_gpio().find(chip->path, name);
  if (offset < 0) return failed(ENOENT);
  return offset;
}

gpiod_line_info* gpiod_chip_get_line_info(gpiod_chip* chip, unsigned int offset) {
  return new gpiod_line_info{emulated_gpio().consumer(chip->path, offset)};
}
void gpiod_line_info_free(gpiod_line_info* info) { delete info; }
bool gpiod_line_info_is_used(gpiod_line_info* info) { return !info->consumer.empty(); }
const char* gpiod_line_info_get_consumer(gpiod_line_info* info) {
  return info->consumer.empty() ? nullptr : info->consumer.c_str();
}

gpiod_line_settings* gpiod_line_settings_new(void) { return new gpiod_line_settings; }
void gpiod_line_settings_free(gpiod_line_settings* settings) { delete settings; }
int gpiod_line_settings_set_direction(gpiod_line_settings* settings, gpiod_line_direction value) {
  settings->request.output = value == GPIOD_LINE_DIRECTION_OUTPUT;
  return 0;
}
int gpiod_line_settings_set_edge_detection(gpiod_line_settings* settings, gpiod_line_edge value) {
  settings->request.edges = value == GPIOD_LINE_EDGE_BOTH;
  return 0;
}
int gpiod_line_settings_set_bias(gpiod_line_settings* settings, gpiod_line_bias value) {
  settings->request.pull = value == GPIOD_LINE_BIAS_DISABLED    ? Pull::off
                           : value == GPIOD_LINE_BIAS_PULL_UP   ? Pull::up
                           : value == GPIOD_LINE_BIAS_PULL_DOWN ? Pull::down
                                                                : Pull::as_is;
  return 0;
}
void gpiod_line_settings_set_active_low(gpiod_line_settings* settings, bool value) {
  settings->request.active_low = value;
}
int gpiod_line_settings_set_output_value(gpiod_line_settings* settings, gpiod_line_value value) {
  settings->request.initially_active = value == GPIOD_LINE_VALUE_ACTIVE;
  return 0;
}

gpiod_line_config* gpiod_line_config_new(void) { return new gpiod_line_config; }
void gpiod_line_config_free(gpiod_line_config* config) { delete config; }
int gpiod_line_config_add_line_settings(gpiod_line_config* config, const unsigned int* offsets,
                                        size_t count, gpiod_line_settings* settings) {
  for (size_t i = 0; i < count; ++i) config->lines[offsets[i]] = settings->request;
  return 0;
}

gpiod_request_config* gpiod_request_config_new(void) { return new gpiod_request_config; }
void gpiod_request_config_free(gpiod_request_config* config) { delete config; }
void gpiod_request_config_set_consumer(gpiod_request_config* config, const char* consumer) {
  config->consumer = consumer;
}

void gpiod_line_request_release(gpiod_line_request* request) {
  for (const unsigned offset : request->offsets) emulated_gpio().release(request->path, offset);
  for (const int file : request->edges) {
    if (file >= 0) ::close(file);
  }
  delete request;
}

gpiod_line_request* gpiod_chip_request_lines(gpiod_chip* chip, gpiod_request_config* how,
                                             gpiod_line_config* lines) {
  auto* request = new gpiod_line_request{chip->path, {}, {-1, -1}};
  if (::pipe2(request->edges, O_CLOEXEC) != 0) request->edges[0] = -1;
  for (auto& [offset, line] : lines->lines) {
    line.consumer = how->consumer;
    const int error = emulated_gpio().request(chip->path, offset, line, request->edges[1]);
    if (error != 0) {
      gpiod_line_request_release(request);
      errno = error;
      return nullptr;
    }
    request->offsets.push_back(offset);
  }
  return request;
}

gpiod_line_value gpiod_line_request_get_value(gpiod_line_request* request, unsigned int offset) {
  bool active = false;
  if (failed(emulated_gpio().get(request->path, offset, active)) != 0) {
    return GPIOD_LINE_VALUE_ERROR;
  }
  return active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
}

int gpiod_line_request_set_value(gpiod_line_request* request, unsigned int offset,
                                 gpiod_line_value value) {
  return failed(emulated_gpio().set(request->path, offset, value == GPIOD_LINE_VALUE_ACTIVE));
}

int gpiod_line_request_get_fd(gpiod_line_request* request) { return request->edges[0]; }

int gpiod_line_request_read_edge_events(gpiod_line_request* request,
                                        gpiod_edge_event_buffer* buffer, size_t most) {
  GpioEdge edges[64];
  const size_t capacity = std::min<size_t>(most, 64) * sizeof edges[0];
  const ssize_t size = ::read(request->edges[0], edges, capacity);
  if (size < 0) return -1;
  const size_t count = static_cast<size_t>(size) / sizeof edges[0];
  buffer->events.clear();
  for (size_t i = 0; i < count; ++i) {
    buffer->events.push_back({edges[i]});
    emulated_gpio().edge_taken(request->path, edges[i]);
  }
  return static_cast<int>(count);
}

gpiod_edge_event_buffer* gpiod_edge_event_buffer_new(size_t) { return new gpiod_edge_event_buffer; }
void gpiod_edge_event_buffer_free(gpiod_edge_event_buffer* buffer) { delete buffer; }
gpiod_edge_event* gpiod_edge_event_buffer_get_event(gpiod_edge_event_buffer* buffer,
                                                    unsigned long index) {
  return &buffer->events.at(index);
}
gpiod_edge_event_type gpiod_edge_event_get_event_type(gpiod_edge_event* event) {
  return event->edge.rising ? GPIOD_EDGE_EVENT_RISING_EDGE : GPIOD_EDGE_EVENT_FALLING_EDGE;
}
unsigned int gpiod_edge_event_get_line_offset(gpiod_edge_event* event) {
  return event->edge.offset;
}
}
