// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/figures.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <tuple>
#include <utility>

#include "diagnosis/median.h"
#include "diagnosis/report/formatting.h"
#include "diagnosis/report/html_elements.h"
#include "diagnosis/report/plot_svg.h"

namespace stickslip::report {

using namespace diagnosis;
using physics::ResultUnits;

namespace {

double largest_of(const std::vector<double>& values) {
  double out = 0.0;
  for (const double each : values) {
    if (std::isfinite(each)) out = std::max(out, std::abs(each));
  }
  return out;
}

std::vector<double> scaled(std::vector<double> values, double factor) {
  for (double& each : values) each *= factor;
  return values;
}

// "displacement [mm]", without a unit of 1.
std::string with_unit(const std::string& name, std::string_view unit) {
  return unit == "1" || unit.empty() ? name : name + " [" + std::string(unit) + "]";
}

// A stretch of the recording to draw.
struct Shown {
  const Stretch& stretch;
  const Traces& traces;
  const char* name;
};

// Starts of the shown windows but the first: every window has its own initial state.
std::vector<Mark> restarts_of(const Evidence& evidence, const Stretch& stretch) {
  std::vector<Mark> out;
  for (std::size_t i = 1; i < stretch.count; ++i) {
    out.push_back({evidence.windows[stretch.first + i].begin_s, ""});
  }
  return out;
}

// Channels by the misfit of the declared model, largest first.
std::vector<const ChannelEvidence*> worst_first(const Evidence& evidence) {
  std::vector<const ChannelEvidence*> out;
  for (const ChannelEvidence& channel : evidence.channels) out.push_back(&channel);
  const auto misfit = [](const ChannelEvidence* channel) {
    std::vector<double> known;
    for (const double each : channel->window_before) {
      if (std::isfinite(each)) known.push_back(each);
    }
    return known.empty() ? 0.0 : median(std::move(known));
  };
  std::stable_sort(out.begin(), out.end(), [&](const ChannelEvidence* a, const ChannelEvidence* b) {
    return misfit(a) > misfit(b);
  });
  return out;
}

std::string overlay_figure(const Evidence& evidence, const ChannelEvidence& channel,
                           const Shown& shown, bool changed, const ResultUnits& units) {
  const std::string name = channel_name(channel.channel);
  const Traces& traces = shown.traces;
  const AxisUnit unit =
      axis_unit(largest_of(traces.recorded), units.of(info(channel.channel).unit));
  LinePlot plot;
  plot.title = "Recorded and simulated, " + std::string(shown.name) + ": " + name;
  plot.description = "The recorded " + name +
                     " over time, with the simulation of the declared model" +
                     (changed ? " and of the augmented model." : ".");
  plot.x_label = units.axis("time", "s");
  plot.y_label = with_unit(name, unit.unit);
  plot.marks = restarts_of(evidence, shown.stretch);
  plot.series.push_back({"recorded", traces.time_s, scaled(traces.recorded, unit.factor), 0});
  plot.series.push_back({"declared", traces.time_s, scaled(traces.before, unit.factor), 1});
  if (changed) {
    plot.series.push_back({"augmented", traces.time_s, scaled(traces.after, unit.factor), 2});
  }
  return figure(
      line_plot_svg(plot),
      changed ? "Dashed: the declared model; it deviates from the recording (broad grey line) "
                "where physics is missing. Thin: the augmented model."
              : "The dashed line (the model) should lie on the broad grey one (the "
                "recording).");
}

// In units of the noise, on a scale on which both the noise and the largest difference are seen.
std::string difference_figure(const Evidence& evidence, const ChannelEvidence& channel,
                              const Shown& shown, bool changed, const ResultUnits& units) {
  constexpr double band = 2.0;           // standard deviations of the noise
  constexpr double linear_up_to = 12.0;  // beyond, the band would be a line
  const Traces& traces = shown.traces;
  const double sigma = std::max(channel.sigma, 1.0e-300);
  std::vector<double> before;
  std::vector<double> after;
  for (std::size_t i = 0; i < traces.time_s.size(); ++i) {
    before.push_back((traces.recorded[i] - traces.before[i]) / sigma);
    after.push_back((traces.recorded[i] - traces.after[i]) / sigma);
  }
  LinePlot plot;
  plot.title =
      "Recorded minus simulated, " + std::string(shown.name) + ": " + channel_name(channel.channel);
  plot.description =
      "Recording minus simulation over the same time in standard deviations of the noise, with a "
      "band of two of them around zero.";
  plot.x_label = units.axis("time", "s");
  plot.y_label = "difference / noise";
  plot.asinh_y = std::max(largest_of(before), largest_of(after)) > linear_up_to;
  plot.marks = restarts_of(evidence, shown.stretch);
  if (!traces.time_s.empty()) {
    const std::vector<double> ends = {traces.time_s.front(), traces.time_s.back()};
    plot.bands.push_back({"noise", ends, {-band, -band}, {band, band}, 0});
  }
  plot.series.push_back({"declared", traces.time_s, before, 1});
  if (changed) plot.series.push_back({"augmented", traces.time_s, after, 2});
  return figure(line_plot_svg(plot),
                std::string("Residual in units of the noise") +
                    (plot.asinh_y ? ", logarithmic beyond the band" : "") +
                    ". Within the grey band (two standard deviations) the recording is "
                    "explained.");
}

// End of the colour scale shared by both maps of a pair.
double scale_end(std::initializer_list<const std::vector<double>*> lists) {
  double most = 3.0;
  for (const std::vector<double>* list : lists) most = std::max(most, largest_of(*list));
  return most;
}

std::string time_map(const Evidence& evidence, bool after, double most, const ResultUnits& units) {
  MapPlot plot;
  plot.title = after ? "Channel by time, augmented model" : "Channel by time, declared model";
  plot.description =
      "Each row is a channel, each cell a window of the recording; the shade is the ratio of "
      "residual to noise.";
  plot.x_label = units.axis("time", "s");
  plot.value_label = "residual / noise";
  plot.x_low = evidence.windows.front().begin_s;
  plot.x_high = evidence.windows.back().end_s;
  plot.y_high = static_cast<double>(evidence.channels.size());
  plot.value_high = most;
  plot.height = 84.0 + 32.0 * static_cast<double>(evidence.channels.size());
  for (std::size_t c = 0; c < evidence.channels.size(); ++c) {
    const ChannelEvidence& channel = evidence.channels[c];
    plot.rows.push_back(channel_name(channel.channel));
    const auto& value = after ? channel.window_after : channel.window_before;
    const auto row = static_cast<double>(c);
    for (std::size_t i = 0; i < std::min(value.size(), evidence.windows.size()); ++i) {
      plot.cells.push_back({evidence.windows[i].begin_s, evidence.windows[i].end_s, row + 0.04,
                            row + 0.96, std::sqrt(value[i])});
    }
  }
  return map_plot_svg(plot);
}

std::string time_maps(const Evidence& evidence, bool changed, const ResultUnits& units) {
  if (evidence.windows.empty()) return "";
  double most = 3.0;
  for (const ChannelEvidence& channel : evidence.channels) {
    most = std::max({most, std::sqrt(largest_of(channel.window_before)),
                     std::sqrt(largest_of(channel.window_after))});
  }
  std::string out =
      figure(time_map(evidence, false, most, units),
             "When and in which channel the model fails. Background colour: noise only. A "
             "conspicuous row: that channel responds to the missing physics; a column: an event of "
             "limited duration.");
  if (changed) {
    out += figure(time_map(evidence, true, most, units),
                  "Augmented model, same colour scale: what remains conspicuous is not "
                  "explained.");
  }
  return out;
}

std::string phase_map(const PhaseMap& map, const std::vector<double>& value, bool after,
                      double most, const ResultUnits& units) {
  const AxisUnit x = axis_unit(map.displacement_m, units.of("m"));
  const AxisUnit v = axis_unit(map.velocity_m_s, units.of("m/s"));
  MapPlot plot;
  plot.title = after ? "Phase space, augmented model" : "Phase space, declared model";
  plot.description =
      "A map over displacement and velocity of the mass; the shade is the ratio of residual to "
      "noise over all channels.";
  plot.x_label = with_unit("displacement", x.unit);
  plot.y_label = with_unit("velocity", v.unit);
  plot.value_label = "residual / noise";
  plot.x_low = -map.displacement_m * x.factor;
  plot.x_high = map.displacement_m * x.factor;
  plot.y_low = -map.velocity_m_s * v.factor;
  plot.y_high = map.velocity_m_s * v.factor;
  plot.value_high = most;
  const double w = (plot.x_high - plot.x_low) / static_cast<double>(PhaseMap::cells);
  const double h = (plot.y_high - plot.y_low) / static_cast<double>(PhaseMap::cells);
  for (std::size_t i = 0; i < value.size(); ++i) {
    const auto column = static_cast<double>(i % PhaseMap::cells);
    const auto row = static_cast<double>(i / PhaseMap::cells);
    plot.cells.push_back({plot.x_low + w * column, plot.x_low + w * (column + 1.0),
                          plot.y_low + h * row, plot.y_low + h * (row + 1.0), value[i]});
  }
  return map_plot_svg(plot);
}

std::string phase_maps(const PhaseMap& map, bool changed, const ResultUnits& units) {
  const double most = scale_end({&map.before, &map.after});
  std::string out = figure(
      phase_map(map, map.before, false, most, units),
      "In which states the model fails. Left and right edge: large deflections, typical of a wrong "
      "spring law; along the horizontal axis: slow motion and reversals, typical of a wrong "
      "friction "
      "law. Empty: states that the motion did not visit.");
  if (changed) {
    out +=
        figure(phase_map(map, map.after, true, most, units), "Augmented model, same colour scale.");
  }
  return out;
}

// A map of a motion that was not recorded would have axes of nothing.
bool has_motion(const PhaseMap& map) {
  constexpr double least = 1.0e-9;  // m, and m/s
  return map.displacement_m > least && map.velocity_m_s > least;
}

double median_drive_hz(const Evidence& evidence) {
  std::vector<double> hz;
  for (const WindowEvidence& each : evidence.windows) hz.push_back(each.drive_hz);
  return hz.empty() ? 0.0 : median(std::move(hz));
}

// Frequencies to mark in spectra.
std::vector<Mark> known_frequencies(const Diagnosis& d) {
  std::vector<Mark> out;
  const double drive_hz = median_drive_hz(*d.evidence);
  if (d.evidence->drive_is_periodic) out.push_back({drive_hz, "drive"});
  const auto& own = d.baseline_model.oscillator.natural_frequency_hz;
  if (own && own->value > 0.0) out.push_back({own->value, "oscillator"});
  if (d.baseline_model.load_cell && d.baseline_model.load_cell->natural_frequency_hz.value > 0.0) {
    out.push_back({d.baseline_model.load_cell->natural_frequency_hz.value, "load cell"});
  }
  return out;
}

std::string spectrum_figure(const Diagnosis& d, const ChannelEvidence& channel, bool changed) {
  const std::string name = channel_name(channel.channel);
  LinePlot plot;
  plot.title = "By frequency: " + name;
  plot.description =
      "Power spectrum of the residual of this channel in units of the noise power, with the "
      "frequencies of the rig marked.";
  plot.x_label = ResultUnits(d.model).axis("frequency", "Hz");
  plot.y_label = "power / noise power";
  plot.log_x = true;
  plot.log_y = true;
  plot.marks = known_frequencies(d);
  plot.levels = {{1.0, "noise"}};
  plot.series.push_back({"declared", channel.frequency_hz, channel.power_before, 1});
  if (changed) plot.series.push_back({"augmented", channel.frequency_hz, channel.power_after, 2});
  return line_plot_svg(plot);
}

std::string drive_phase_figure(const ChannelEvidence& channel, bool changed) {
  LinePlot plot;
  plot.title = "By phase of the excitation: " + channel_name(channel.channel);
  plot.description =
      "Ratio of residual to noise of this channel against the phase of the excitation.";
  plot.x_label = "phase of the excitation, 0 at its maximum [deg]";
  plot.y_label = "residual / noise";
  plot.levels = {{1.0, "noise"}};
  plot.series.push_back({"declared", channel.phase_deg, channel.phase_before, 1});
  if (changed) plot.series.push_back({"augmented", channel.phase_deg, channel.phase_after, 2});
  return line_plot_svg(plot);
}

// The range with a margin, never empty.
std::pair<double, double> with_margin(double low, double high) {
  const double margin = std::max(0.06 * (high - low), 0.02 * std::abs(high) + 1.0e-12);
  return {low - margin, high + margin};
}

std::string condition_map(const Evidence& evidence, bool after, double most,
                          const ResultUnits& units) {
  double highest = 0.0;
  for (const WindowEvidence& each : evidence.windows) {
    highest = std::max(highest, each.drive_amplitude);
  }
  const AxisUnit unit = axis_unit(highest, units.of(info(evidence.driven_by).unit));
  MapPlot plot;
  plot.title =
      after ? "Operating condition, augmented model" : "Operating condition, declared model";
  plot.description =
      "One dot per window of the recording, at its excitation frequency and amplitude; the shade "
      "is the ratio of residual to noise.";
  plot.x_label = units.axis("excitation frequency", "Hz");
  plot.y_label = with_unit("excitation amplitude", unit.unit);
  plot.value_label = "residual / noise";
  plot.value_high = most;
  double x_low = 1.0e300;
  double x_high = 0.0;
  double y_low = 1.0e300;
  for (const WindowEvidence& each : evidence.windows) {
    const double y = each.drive_amplitude * unit.factor;
    plot.dots.push_back({each.drive_hz, y, std::sqrt(after ? each.after : each.before)});
    x_low = std::min(x_low, each.drive_hz);
    x_high = std::max(x_high, each.drive_hz);
    y_low = std::min(y_low, y);
  }
  std::tie(plot.x_low, plot.x_high) = with_margin(x_low, x_high);
  std::tie(plot.y_low, plot.y_high) = with_margin(y_low, highest * unit.factor);
  return map_plot_svg(plot);
}

std::string condition_maps(const Evidence& evidence, bool changed, const ResultUnits& units) {
  double most = 9.0;
  for (const WindowEvidence& each : evidence.windows) {
    if (std::isfinite(each.before)) most = std::max({most, each.before, each.after});
  }
  most = std::sqrt(most);
  std::string out = figure(
      condition_map(evidence, false, most, units),
      "Excitation under which the model fails: one dot per window. Dark dots (bright on a dark "
      "screen) on one side only: the missing physics acts under that excitation.");
  if (changed) {
    out +=
        figure(condition_map(evidence, true, most, units), "Augmented model, same colour scale.");
  }
  return out;
}

std::string shape_caption(const Curve& curve) {
  const std::string over = plain_text(curve.variable);
  std::string out;
  if (curve.quantity == "force against +x") {
    out = "Force missing from the declared model, against the " + over +
          " (positive: opposing positive displacement). Zero: no effect.";
  } else if (curve.quantity == "factor on the friction law") {
    out = "Factor on the friction of the declared model, against the " + over + ". 1: no effect.";
  } else if (curve.quantity == "normal load") {
    out = "Normal load against the " + over + ".";
  } else if (curve.quantity == "reading") {
    out = "Reading of the channel against the true value. Dashed: an ideal sensor.";
  } else {
    out = plain_text(curve.quantity) + " against the " + over + ".";
    out.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(out.front())));
  }
  if (!curve.low.empty()) {
    out += " Shaded: 95\u00a0% interval; where invisible, it is narrower than the line.";
  }
  // The curve of a law that is replaced has a range of its own.
  return out + (curve.quantity == "friction force" ? " Drawn where the force changes its sign."
                                                   : " Drawn over the range of the recording.");
}

}  // namespace

std::string stretch_figures(const Diagnosis& d) {
  if (!d.evidence || d.evidence->worst.count == 0) return "";
  const Evidence& evidence = *d.evidence;
  const bool changed = d.augmented.has_value();
  const ResultUnits units(d.model);
  std::string out = "<div class=\"plots\">\n";
  for (const ChannelEvidence* channel : worst_first(evidence)) {
    std::vector<Shown> both = {{evidence.worst, channel->worst, "worst"}};
    if (evidence.typical.count > 0) {
      both.push_back({evidence.typical, channel->typical, "typical"});
    }
    for (const Shown& shown : both) {
      out += overlay_figure(evidence, *channel, shown, changed, units);
    }
    for (const Shown& shown : both) {
      out += difference_figure(evidence, *channel, shown, changed, units);
    }
  }
  return out + "</div>\n";
}

std::string residual_figures(const Diagnosis& d) {
  if (!d.evidence) return "";
  const Evidence& evidence = *d.evidence;
  const bool changed = d.augmented.has_value();
  const ResultUnits units(d.model);
  const bool periodic = evidence.drive_is_periodic;
  const auto part = [](const char* title, const std::string& figures) {
    return "<h3>" + std::string(title) + "</h3>\n<div class=\"plots\">\n" + figures + "</div>\n";
  };
  std::string out = part("By channel and time", time_maps(evidence, changed, units));
  if (has_motion(evidence.map)) {
    out += part("In phase space", phase_maps(evidence.map, changed, units));
  }
  if (periodic) out += part("By operating condition", condition_maps(evidence, changed, units));
  out += periodic ? "<h3>By frequency and by phase of the excitation</h3>\n"
                  : "<h3>By frequency</h3>\n";
  out += "<div class=\"plots\">\n";
  for (const ChannelEvidence* channel : worst_first(evidence)) {
    out += figure(spectrum_figure(d, *channel, changed),
                  "A peak marks the frequency of unmodelled motion; noise alone is flat at 1.");
    if (!periodic) continue;
    out += figure(drive_phase_figure(*channel, changed),
                  "A maximum marks the part of the cycle in which the model fails; noise alone is "
                  "flat at 1.");
  }
  return out + "</div>\n";
}

std::string curve_svg(const Curve& curve, const std::string& name) {
  const AxisUnit x = axis_unit(largest_of(curve.at), curve.variable_unit);
  const AxisUnit y = axis_unit(largest_of(curve.value), curve.unit);
  LinePlot plot;
  plot.title = plain_text(curve.quantity) + " over " + plain_text(curve.variable);
  plot.description = shape_caption(curve);
  plot.x_label = with_unit(plain_text(curve.variable), x.unit);
  plot.y_label = with_unit(plain_text(curve.quantity), y.unit);
  const auto at = scaled(curve.at, x.factor);
  if (!curve.low.empty()) {
    plot.bands.push_back(
        {"95 % interval", at, scaled(curve.low, y.factor), scaled(curve.high, y.factor), 2});
  }
  if (curve.quantity == "reading") {
    plot.series.push_back({"ideal", at, scaled(curve.at, y.factor), 1});
  }
  plot.series.push_back({name, at, scaled(curve.value, y.factor), 2});
  return line_plot_svg(plot);
}

std::string shape_figures(const Finding& finding) {
  std::string out;
  for (const Curve& curve : finding.portrait) {
    out += figure(curve_svg(curve, "fitted"), shape_caption(curve));
  }
  return out.empty() ? out : "<div class=\"plots\">\n" + out + "</div>\n";
}

std::string friction_figures(const Diagnosis& d) {
  if (!d.friction || d.friction->mended.force_n.empty()) return "";
  const FrictionPicture& friction = *d.friction;
  const ResultUnits units(d.model);
  const AxisUnit force = axis_unit(
      std::max({largest_of(friction.recorded.force_n), largest_of(friction.declared.force_n),
                largest_of(friction.mended.force_n)}),
      units.of("N"));
  const auto over = [&](const char* name, const char* unit_name, const auto& variable) {
    const AxisUnit x = axis_unit(largest_of(variable(friction.mended)), units.of(unit_name));
    LinePlot plot;
    plot.title = std::string("Friction over ") + name;
    plot.description =
        std::string("The friction force over the ") + name +
        ": recorded, of the declared law, and of the augmented one with its 95 % band.";
    plot.x_label = with_unit(name, x.unit);
    plot.y_label = with_unit("friction force", force.unit);
    const auto at = scaled(variable(friction.mended), x.factor);
    if (!friction.low_n.empty()) {
      plot.bands.push_back({"95 %", at, scaled(friction.low_n, force.factor),
                            scaled(friction.high_n, force.factor), 2});
    }
    if (!friction.recorded.force_n.empty()) {
      plot.series.push_back({"recorded", scaled(variable(friction.recorded), x.factor),
                             scaled(friction.recorded.force_n, force.factor), 0, true});
    }
    plot.series.push_back(
        without_way_back({"declared", scaled(variable(friction.declared), x.factor),
                          scaled(friction.declared.force_n, force.factor), 1}));
    plot.series.push_back({"augmented", at, scaled(friction.mended.force_n, force.factor), 2});
    return figure(
        line_plot_svg(plot),
        std::string(friction.recorded.force_n.empty() ? "" : "Dots: the recording. ") +
            "Dashed: the declared law; thin: the augmented one, its 95\u00a0% band shaded (where "
            "invisible, narrower than the line). Both under the mean load, in one cycle of the "
            "recorded size.");
  };
  return "<h3>The law of friction</h3>\n<div class=\"plots\">\n" +
         over("velocity", "m/s", [](const auto& each) { return each.velocity_m_s; }) +
         over("displacement", "m", [](const auto& each) { return each.displacement_m; }) +
         "</div>\n";
}

std::string calibration_figure(const Diagnosis& d) {
  IntervalPlot plot;
  plot.title = "Calibration: shift from the declared value";
  plot.description =
      "One row per calibrated parameter: its shift in declared standard deviations, with its "
      "interval.";
  plot.x_label = "declared standard deviations";
  plot.marks = {{-2.0, "\u22122"}, {0.0, "declared"}, {2.0, "+2"}};
  for (const Calibration& each : d.calibrated) {
    if (!(each.sigma > 0.0)) continue;
    plot.rows.push_back({each.path, each.shift_sigmas, (each.low - each.declared) / each.sigma,
                         (each.high - each.declared) / each.sigma});
  }
  return figure(
      interval_plot_svg(plot),
      "Dots between the outer lines: the recording agrees with the declared value. A dot far "
      "outside: the declared value is wrong, or the parameter compensates for missing physics.");
}

}  // namespace stickslip::report
