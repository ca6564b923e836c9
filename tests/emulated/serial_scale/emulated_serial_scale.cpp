// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/serial_scale/emulated_serial_scale.h"

#include <fcntl.h>
#include <pty.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

namespace stickslip::emulated {

std::string scale_line(char status, double number, const std::string& unit) {
  char text[64];
  if (status == 'E') {
    std::snprintf(text, sizeof text, "E -------- %s", unit.c_str());
  } else {
    std::snprintf(text, sizeof text, "%c %c%09.3f %s", status, number < 0.0 ? '-' : '+',
                  std::abs(number), unit.c_str());
  }
  std::string line = text;
  int sum = 0;
  for (const char each : line) sum ^= each;
  std::snprintf(text, sizeof text, " *%02X\r\n", static_cast<unsigned>(sum));
  return line + text;
}

EmulatedSerialScale::EmulatedSerialScale(std::filesystem::path folder)
    : folder_(std::move(folder)) {
  std::filesystem::create_directories(folder_);
  plug_in();
}

EmulatedSerialScale::~EmulatedSerialScale() {
  stop();
  unplug();
}

void EmulatedSerialScale::write(const std::string& bytes) {
  if (::write(its_end_, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) {
    throw std::runtime_error("the pseudo-terminal accepts no more bytes");
  }
}

void EmulatedSerialScale::start(std::int64_t period_ns, std::function<std::string()> next) {
  stopping_ = false;
  thread_ = std::thread([this, period_ns, next = std::move(next)] {
    auto due = std::chrono::steady_clock::now();
    while (!stopping_) {
      write(next());
      due += std::chrono::nanoseconds(period_ns);
      std::this_thread::sleep_until(due);
    }
  });
}

void EmulatedSerialScale::stop() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
}

void EmulatedSerialScale::unplug() {
  if (its_end_ < 0) return;
  std::filesystem::remove(folder_ / "scale");
  ::close(its_end_);
  its_end_ = -1;
}

void EmulatedSerialScale::plug_in() {
  int other_end = -1;
  char name[128];
  if (::openpty(&its_end_, &other_end, name, nullptr, nullptr) != 0) {
    throw std::runtime_error("no pseudo-terminal");
  }
  // Terminal settings are left unchanged: the driver must set raw mode.
  ::close(other_end);
  ::fcntl(its_end_, F_SETFD, FD_CLOEXEC);
  std::filesystem::create_symlink(name, folder_ / "scale");
}

}  // namespace stickslip::emulated
