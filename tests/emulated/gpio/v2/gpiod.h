// SPDX-License-Identifier: Apache-2.0
// The declarations of libgpiod 2 that the driver uses, so that it compiles where only 1.6 is
// installed. Names and values are those of the library.
#pragma once

#include <cstddef>
#include <cstdint>

extern "C" {

struct gpiod_chip;
struct gpiod_chip_info;
struct gpiod_line_info;
struct gpiod_line_settings;
struct gpiod_line_config;
struct gpiod_request_config;
struct gpiod_line_request;
struct gpiod_edge_event;
struct gpiod_edge_event_buffer;

enum gpiod_line_value {
  GPIOD_LINE_VALUE_ERROR = -1,
  GPIOD_LINE_VALUE_INACTIVE = 0,
  GPIOD_LINE_VALUE_ACTIVE = 1
};
enum gpiod_line_direction {
  GPIOD_LINE_DIRECTION_AS_IS = 1,
  GPIOD_LINE_DIRECTION_INPUT,
  GPIOD_LINE_DIRECTION_OUTPUT
};
enum gpiod_line_edge {
  GPIOD_LINE_EDGE_NONE = 1,
  GPIOD_LINE_EDGE_RISING,
  GPIOD_LINE_EDGE_FALLING,
  GPIOD_LINE_EDGE_BOTH
};
enum gpiod_line_bias {
  GPIOD_LINE_BIAS_AS_IS = 1,
  GPIOD_LINE_BIAS_UNKNOWN,
  GPIOD_LINE_BIAS_DISABLED,
  GPIOD_LINE_BIAS_PULL_UP,
  GPIOD_LINE_BIAS_PULL_DOWN
};
enum gpiod_edge_event_type { GPIOD_EDGE_EVENT_RISING_EDGE = 1, GPIOD_EDGE_EVENT_FALLING_EDGE };

const char* gpiod_api_version(void);

gpiod_chip* gpiod_chip_open(const char* path);
void gpiod_chip_close(gpiod_chip* chip);
gpiod_chip_info* gpiod_chip_get_info(gpiod_chip* chip);
int gpiod_chip_get_line_offset_from_name(gpiod_chip* chip, const char* name);
gpiod_line_info* gpiod_chip_get_line_info(gpiod_chip* chip, unsigned int offset);
gpiod_line_request* gpiod_chip_request_lines(gpiod_chip* chip, gpiod_request_config* config,
                                             gpiod_line_config* lines);

void gpiod_chip_info_free(gpiod_chip_info* info);
const char* gpiod_chip_info_get_name(gpiod_chip_info* info);
const char* gpiod_chip_info_get_label(gpiod_chip_info* info);
size_t gpiod_chip_info_get_num_lines(gpiod_chip_info* info);

void gpiod_line_info_free(gpiod_line_info* info);
bool gpiod_line_info_is_used(gpiod_line_info* info);
const char* gpiod_line_info_get_consumer(gpiod_line_info* info);

gpiod_line_settings* gpiod_line_settings_new(void);
void gpiod_line_settings_free(gpiod_line_settings* settings);
int gpiod_line_settings_set_direction(gpiod_line_settings* settings, gpiod_line_direction value);
int gpiod_line_settings_set_edge_detection(gpiod_line_settings* settings, gpiod_line_edge value);
int gpiod_line_settings_set_bias(gpiod_line_settings* settings, gpiod_line_bias value);
void gpiod_line_settings_set_active_low(gpiod_line_settings* settings, bool value);
int gpiod_line_settings_set_output_value(gpiod_line_settings* settings, gpiod_line_value value);

gpiod_line_config* gpiod_line_config_new(void);
void gpiod_line_config_free(gpiod_line_config* config);
int gpiod_line_config_add_line_settings(gpiod_line_config* config, const unsigned int* offsets,
                                        size_t count, gpiod_line_settings* settings);

gpiod_request_config* gpiod_request_config_new(void);
void gpiod_request_config_free(gpiod_request_config* config);
void gpiod_request_config_set_consumer(gpiod_request_config* config, const char* consumer);

void gpiod_line_request_release(gpiod_line_request* request);
gpiod_line_value gpiod_line_request_get_value(gpiod_line_request* request, unsigned int offset);
int gpiod_line_request_set_value(gpiod_line_request* request, unsigned int offset,
                                 gpiod_line_value value);
int gpiod_line_request_get_fd(gpiod_line_request* request);
int gpiod_line_request_read_edge_events(gpiod_line_request* request,
                                        gpiod_edge_event_buffer* buffer, size_t max_events);

gpiod_edge_event_buffer* gpiod_edge_event_buffer_new(size_t capacity);
void gpiod_edge_event_buffer_free(gpiod_edge_event_buffer* buffer);
gpiod_edge_event* gpiod_edge_event_buffer_get_event(gpiod_edge_event_buffer* buffer,
                                                    unsigned long index);
gpiod_edge_event_type gpiod_edge_event_get_event_type(gpiod_edge_event* event);
unsigned int gpiod_edge_event_get_line_offset(gpiod_edge_event* event);
}
