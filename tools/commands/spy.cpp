// SPDX-License-Identifier: Apache-2.0
// `stickslip spy`: live statistics of the traffic on LCM.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "tools/command_line/colour_option.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/spy/report.h"
#include "tools/telemetry/lcm_client.h"
#include "tools/terminal/abilities.h"

namespace stickslip::commands {

using namespace command_line;
using namespace telemetry;

namespace {

using std::chrono::steady_clock;

struct Arguments {
  std::string url;
  double duration_s = 0.0;
  bool once = false;
  bool json = false;
  spy::View view;
  terminal::Colours colours = terminal::Colours::automatic;
};

std::int64_t wall_clock_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

class Listener {
 public:
  // LCM's own arrival time: waiting in the queue does not change it.
  void take(const lcm::ReceiveBuffer* buffer, const std::string& channel) {
    traffic_.add(channel, {static_cast<const std::uint8_t*>(buffer->data), buffer->data_size},
                 buffer->recv_utime);
  }
  spy::Traffic& traffic() { return traffic_; }

 private:
  spy::Traffic traffic_;
};

/// Prints the traffic to standard output: a live table, a table, lines or JSON.
class Display {
 public:
  Display(const Arguments& arguments, spy::Traffic& traffic)
      : arguments_(arguments),
        traffic_(traffic),
        paint_(terminal::wants_colour(arguments.colours, STDOUT_FILENO)) {
    const terminal::Abilities screen = terminal::abilities_of(STDOUT_FILENO);
    table_ = screen.terminal && !arguments.json;
    live_ = table_ && !screen.dumb && !arguments.once;
  }

  /// `interval_s`: since the last call; `seconds`: since the start.
  void show(double interval_s, double seconds) {
    traffic_.close_interval(std::max(1e-3, interval_s));
    std::string out = text(seconds);
    if (live_) out = on_screen(out, seconds);
    std::fputs(out.c_str(), stdout);
    std::fflush(stdout);
  }

 private:
  std::string text(double seconds) const {
    const std::int64_t now_us = wall_clock_us();
    if (arguments_.json) return spy::json(arguments_.view, traffic_, now_us, seconds);
    if (spy::selected_channels(arguments_.view, traffic_, now_us).empty()) {
      return (traffic_.empty() ? "nothing yet at " : "nothing of that name yet at ") +
             arguments_.url + "\n";
    }
    if (!table_) return spy::lines(arguments_.view, traffic_, now_us);
    return spy::table(arguments_.view, traffic_, now_us, terminal::columns_of(STDOUT_FILENO),
                      paint_);
  }

  // Overwrites the screen line by line, which avoids flicker, and stays within its height.
  std::string on_screen(const std::string& table, double seconds) const {
    const std::size_t height = terminal::lines_of(STDOUT_FILENO);
    std::string out = "\033[H" + arguments_.url + "  " +
                      std::to_string(static_cast<long>(seconds)) +
                      " s (Ctrl-C ends)\033[K\n\033[K\n";
    std::size_t used = 3;  // including the one that the cursor ends on
    for (std::size_t at = 0; at < table.size();) {
      const std::size_t end = table.find('\n', at);
      if (height > 4 && ++used >= height && end + 1 < table.size()) {
        out += "... and more: name a channel to see no others\033[K\n";
        break;
      }
      out += table.substr(at, end - at) + "\033[K\n";
      at = end + 1;
    }
    return out + "\033[J";
  }

  const Arguments& arguments_;
  spy::Traffic& traffic_;
  terminal::Paint paint_;
  bool table_ = false;
  bool live_ = false;
};

int run(const Arguments& arguments) {
  const StopSignals stop;
  const std::unique_ptr<lcm::LCM> lcm = join_lcm(arguments.url);
  Listener listener;
  listen<&Listener::take>(*lcm, ".*", &listener);
  Display display(arguments, listener.traffic());
  const auto start = steady_clock::now();
  const auto period = std::chrono::seconds(1);
  // --once waits for frames, within limits.
  const double timeout_s = arguments.duration_s > 0.0 ? arguments.duration_s : 5.0;
  const auto end = after(start, arguments.once ? timeout_s : arguments.duration_s);
  auto shown = start;
  auto next = start + period;
  bool stopped = false;
  const auto show = [&](steady_clock::time_point now) {
    display.show(std::chrono::duration<double>(now - shown).count(),
                 std::chrono::duration<double>(now - start).count());
    shown = now;
  };
  while (!stopped) {
    const auto now = steady_clock::now();
    if (now >= end) break;
    if (now >= next) {
      if (arguments.once && listener.traffic().has_frames()) break;
      if (!arguments.once) show(now);
      next = std::max(next + period, now);
    }
    switch (wait_for(*lcm, stop, std::min(end, next))) {
      case Wake::stop:
        stopped = true;
        break;
      case Wake::message:
        lcm->handle();
        break;
      case Wake::time_out:
        break;
    }
  }
  const auto now = steady_clock::now();
  if (arguments.once || now - shown > period / 2) show(now);
  // A user who interrupts has seen the table; a script needs the status.
  return !listener.traffic().empty() || stopped ? 0 : 1;
}

}  // namespace

void add_spy(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "spy", "Show the traffic on LCM: rates, sizes, losses and last values of every channel");
  command
      ->add_option("names", arguments->view.name_filters,
                   "Show only channels whose name contains one of these words")
      ->type_name("NAME");
  add_url_option(*command, arguments->url);
  command->add_flag("--values", arguments->view.values,
                    "Show every value with its unit, minimum and maximum");
  const std::map<std::string, spy::Order> orders = {{"name", spy::Order::name},
                                                    {"rate", spy::Order::rate},
                                                    {"size", spy::Order::size},
                                                    {"age", spy::Order::age},
                                                    {"lost", spy::Order::lost}};
  command
      ->add_option_function<std::string>(
          "--sort",
          [arguments, orders](const std::string& by) { arguments->view.order = orders.at(by); },
          "Sort key of the channels; numbers descending")
      ->check(one_of({"name", "rate", "size", "age", "lost"}))
      ->default_str("name");
  add_stop_after_option(*command, arguments->duration_s);
  command->add_flag(
      "--once", arguments->once,
      "Print one table after the first second with frames, or after --duration (default: "
      "5 s) if there are none");
  add_json_flag(*command, arguments->json);
  add_colour_option(*command, arguments->colours);
  command->footer(
      "On a terminal a table that is redrawn every second, elsewhere one line per channel. "
      "Each line of --json is one second. Channels of other programs are listed with the "
      "fingerprint of their type.\n"
      "Exit status: 1 if no message was received.");
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command,
           {.examples = {{"Sort the channels by their rate", "stickslip spy --sort rate"},
                         {"Show minimum and maximum of every value in the frames",
                          "stickslip spy frames --values"},
                         {"Print one snapshot for a program", "stickslip spy --once --json"}},
            .environment = {lcm_url_variable, no_color_variable},
            .see_also = {"stickslip-record(1)", "stickslip-ctl(1)", "stickslipd(8)"}});
}

}  // namespace stickslip::commands
