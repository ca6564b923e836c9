#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "observer/smoother.h"
#include "physics/number_text.h"
#include "protocol/recording.h"
#include "tools/command_line/recording_input.h"
#include "tools/commands/commands.h"
#include "tools/files/write_file.h"
#include "tools/terminal/abilities.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

using namespace command_line;
using namespace files;

namespace {

using observer::FrictionEstimate;
using observer::Quantity;
using physics::number_text;

struct Arguments {
  std::string recording;
  std::string model;
  std::string out;
  std::string json;
};

/// What is told of a whole recording.
struct Summary {
  struct Spread {
    double sum = 0.0, weight = 0.0;
    double low = 0.0, high = 0.0;
    /// A value with its standard deviation; those that are sure count more.
    void add(double value, double deviation) {
      if (!(deviation > 0.0)) return;
      low = weight > 0.0 ? std::min(low, value) : value;
      high = weight > 0.0 ? std::max(high, value) : value;
      sum += value / (deviation * deviation);
      weight += 1.0 / (deviation * deviation);
    }
    double mean() const { return weight > 0.0 ? sum / weight : 0.0; }
  };
  Spread mu, gamma;
  std::size_t frames = 0, good = 0;
  double sticking = 0.0, slip_squares = 0.0, force_deviations = 0.0;

  void add(const FrictionEstimate& e) {
    ++frames;
    if (!e.valid) return;
    ++good;
    mu.add(e.mu, e.standard_deviation(Quantity::mu));
    gamma.add(e.gamma_per_s, e.standard_deviation(Quantity::gamma));
    sticking += e.sticking;
    slip_squares += e.slip_velocity_m_s * e.slip_velocity_m_s;
    force_deviations += e.standard_deviation(Quantity::friction_force);
  }
  double share(double sum) const { return good > 0 ? sum / static_cast<double>(good) : 0.0; }
};

/// The estimates as a table, a row for each frame.
class Table {
 public:
  /// Empty: no table; "-": standard output.
  explicit Table(const std::string& file) : name_(file) {
    if (!file.empty() && file != "-") file_.open(file);
  }
  void add(const FrictionEstimate& e) {
    if (name_.empty()) return;
    if (first_) write(header(e));
    first_ = false;
    std::string row;
    append(row, "%.9f", static_cast<double>(e.time_ns) * 1.0e-9);
    for (std::size_t i = 0; i < e.used; ++i) {
      if (!has_value(e.quantities[i])) continue;
      append(row, ",%.9g", value(e, e.quantities[i]));
      append(row, ",%.3g", std::sqrt(std::max(0.0, e.covariance[i][i])));
    }
    append(row, ",%.9g", e.slip_velocity_m_s);
    append(row, ",%.3g", e.slip_velocity_std_m_s);
    append(row, ",%.4f", e.sticking);
    append(row, ",%.4g", e.nis);
    row += e.valid ? ",1\n" : ",0\n";
    write(row);
  }
  void finish() {
    if (!file_.is_open()) return;
    file_.close();
    if (!file_) throw std::runtime_error(name_ + ": is not complete");
  }

 private:
  static void append(std::string& row, const char* format, double number) {
    char text[40];
    std::snprintf(text, sizeof text, format, number);
    row += text;
  }
  // The load cell's deflection has no field in an estimate.
  static bool has_value(Quantity quantity) { return quantity != Quantity::load_cell_deflection; }
  static double value(const FrictionEstimate& e, Quantity quantity) {
    switch (quantity) {
      case Quantity::displacement:
        return e.displacement_m;
      case Quantity::velocity:
        return e.velocity_m_s;
      case Quantity::load_cell_velocity:
        return e.velocity_m_s - e.slip_velocity_m_s;
      case Quantity::theta:
        return e.theta;
      case Quantity::mu:
        return e.mu;
      case Quantity::gamma:
        return e.gamma_per_s;
      case Quantity::normal_load:
        return e.normal_load_n;
      case Quantity::friction_force:
        return e.friction_force_n;
      case Quantity::load_cell_deflection:
        break;
    }
    return 0.0;
  }
  static std::string header(const FrictionEstimate& e) {
    std::string text = "time_s";
    for (std::size_t i = 0; i < e.used; ++i) {
      if (!has_value(e.quantities[i])) continue;
      const std::string name(observer::name_of(e.quantities[i]));
      text += ',' + name + ',' + name + "_std";
    }
    return text + ",slip_velocity_m_s,slip_velocity_m_s_std,sticking,nis,good\n";
  }
  void write(const std::string& text) {
    if (file_.is_open()) {
      file_ << text;
    } else {
      std::fwrite(text.data(), 1, text.size(), stdout);
    }
  }

  std::string name_;
  std::ofstream file_;
  bool first_ = true;
};

int run(const Arguments& arguments) {
  expect_writable(arguments.json);
  if (arguments.out != "-") expect_writable(arguments.out);
  const physics::Model model = config::load_model(arguments.model);
  const protocol::Recording recording = recording_from(arguments.recording);
  Summary summary;
  Table table(arguments.out);
  observer::Foretelling foretelling;
  terminal::Progress progress("estimating");
  // The table is what shows that something happens where it goes to the same terminal.
  if (arguments.out == "-" && terminal::abilities_of(STDOUT_FILENO).terminal) progress.finish();
  try {
    foretelling = observer::smooth(
        model, protocol::median_period_s(recording.frames), recording.frames,
        [&](const FrictionEstimate& e) {
          summary.add(e);
          table.add(e);
        },
        {}, [&progress](double share) { progress.at(share); });
  } catch (const std::invalid_argument& reason) {
    throw InputError(Problem{arguments.model, 0, 0, reason.what()});
  }
  table.finish();
  progress.finish();

  const double readings = std::max(1.0, static_cast<double>(foretelling.readings));
  const double nll = foretelling.negative_log_likelihood / readings;
  const double nis = foretelling.normalised_squares / readings;
  const double sticking = summary.share(summary.sticking);
  nlohmann::ordered_json json;
  json["schema"] = 1;
  json["frames"] = summary.frames;
  json["good_frames"] = summary.good;
  const auto spread = [](const Summary::Spread& s) {
    nlohmann::ordered_json out;
    if (s.weight > 0.0) out = {{"mean", s.mean()}, {"low", s.low}, {"high", s.high}};
    return out;
  };
  json["mu"] = spread(summary.mu);
  json["gamma_per_s"] = spread(summary.gamma);
  json["sticking_share"] = sticking;
  json["nll_per_reading"] = nll;
  json["nis_per_reading"] = nis;
  json["refused_readings"] = foretelling.refused;
  json["restarts"] = foretelling.restarts;
  if (!arguments.json.empty()) write_file(arguments.json, json.dump(2) + "\n");
  if (arguments.out == "-") return 0;

  std::printf("%s: %zu frames, %zu of them well estimated\n", arguments.recording.c_str(),
              summary.frames, summary.good);
  const auto tell = [](const char* name, const Summary::Spread& s) {
    if (!(s.weight > 0.0)) return;
    std::printf("%s %s, between %s and %s\n", name, number_text(s.mean()).c_str(),
                number_text(s.low).c_str(), number_text(s.high).c_str());
  };
  tell("mu", summary.mu);
  tell("gamma [1/s]", summary.gamma);
  std::printf("the contact sticks for %.1f %% of the time\n", 100.0 * sticking);
  std::printf(
      "readings foretold one period ahead: squared error %s of what was expected (1: the model is "
      "right about itself), negative log-likelihood %s per reading\n",
      number_text(nis).c_str(), number_text(nll).c_str());
  if (foretelling.restarts > 0 || foretelling.refused > 0) {
    std::printf("the filter lost its way and began anew %llu times; %ld readings were outliers\n",
                static_cast<unsigned long long>(foretelling.restarts), foretelling.refused);
  }
  if (!arguments.out.empty()) std::printf("%s written\n", arguments.out.c_str());
  return 0;
}

}  // namespace

void add_estimate(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "estimate",
      "What no sensor read in a recording: friction, its state, mu, gamma, slip, sticking");
  command->add_option("recording", arguments->recording, "Recording (CSV or LCM log)")
      ->required()
      ->type_name("RECORDING");
  command->add_option("--model", arguments->model, "Model (TOML)")->required();
  command->add_option("--out", arguments->out,
                      "Write the estimates as CSV, one row for each frame; - is standard output");
  command->add_option("--json", arguments->json, "Write the summary as JSON");
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stickslip::commands
