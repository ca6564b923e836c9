#include "diagnosis/report/pictures.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <tuple>
#include <utility>

#include "diagnosis/median.h"
#include "diagnosis/report/picture.h"
#include "diagnosis/report/words.h"

namespace stickslip::diagnosis {

namespace {

std::string figure(const std::string& picture, const std::string& words, bool wide = false) {
  if (picture.empty()) return "";
  return std::string("<figure") + (wide ? " class=\"wide\"" : "") + ">\n" + picture +
         "<figcaption>" + html_text(words) + "</figcaption>\n</figure>\n";
}

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

std::string with_unit(const std::string& name, const std::string& unit) {
  return unit == "1" || unit.empty() ? name : name + " [" + unit + "]";
}

// Beginnings of the windows that are shown, except the first: there a prediction starts anew.
std::vector<Mark> restarts_of(const Evidence& evidence) {
  std::vector<Mark> out;
  for (std::size_t i = 1; i < evidence.stretch.count; ++i) {
    out.push_back({evidence.windows[evidence.stretch.first + i].begin_s, ""});
  }
  return out;
}

// The channel first in which the declared model misses most.
std::vector<const ChannelEvidence*> worst_first(const Evidence& evidence) {
  std::vector<const ChannelEvidence*> out;
  for (const ChannelEvidence& channel : evidence.channels) out.push_back(&channel);
  const auto miss = [](const ChannelEvidence* channel) {
    std::vector<double> known;
    for (const double each : channel->window_before) {
      if (std::isfinite(each)) known.push_back(each);
    }
    return known.empty() ? 0.0 : median(std::move(known));
  };
  std::stable_sort(out.begin(), out.end(), [&](const ChannelEvidence* a, const ChannelEvidence* b) {
    return miss(a) > miss(b);
  });
  return out;
}

std::string overlay_figure(const Evidence& evidence, const ChannelEvidence& channel, bool changed) {
  const std::string name = channel_words(channel.channel);
  const AxisUnit unit = axis_unit(largest_of(channel.recorded), info(channel.channel).unit);
  LinePlot plot;
  plot.title = "Recorded and simulated: " + name;
  plot.says = "The recorded " + name + " over time, with the simulation of the declared model" +
              (changed ? " and that with what was found." : ".");
  plot.x_label = "time [s]";
  plot.y_label = with_unit(name, unit.unit);
  plot.marks = restarts_of(evidence);
  plot.series.push_back({"recorded", channel.time_s, scaled(channel.recorded, unit.factor), 0});
  plot.series.push_back({"declared", channel.time_s, scaled(channel.before, unit.factor), 1});
  if (changed) {
    plot.series.push_back({"with it", channel.time_s, scaled(channel.after, unit.factor), 2});
  }
  return figure(line_plot_svg(plot),
                changed
                    ? "Look where the dashed line (the declared model) leaves the broad grey one "
                      "(the recording); the thin line holds what was found and should stay on it."
                    : "The dashed line (the model) should lie on the broad grey one (the "
                      "recording).");
}

std::string difference_figure(const Evidence& evidence, const ChannelEvidence& channel,
                              bool changed) {
  const std::string name = channel_words(channel.channel);
  std::vector<double> before;
  std::vector<double> after;
  for (std::size_t i = 0; i < channel.time_s.size(); ++i) {
    before.push_back(channel.recorded[i] - channel.before[i]);
    after.push_back(channel.recorded[i] - channel.after[i]);
  }
  const double noise = 2.0 * channel.sigma;
  const AxisUnit unit = axis_unit(std::max({largest_of(before), largest_of(after), noise}),
                                  info(channel.channel).unit);
  LinePlot plot;
  plot.title = "Recorded minus simulated: " + name;
  plot.says =
      "The difference between recording and simulation over the same time, with a band of "
      "two standard deviations of the channel's noise around zero.";
  plot.x_label = "time [s]";
  plot.y_label = with_unit("difference", unit.unit);
  plot.marks = restarts_of(evidence);
  if (!channel.time_s.empty() && noise > 0.0) {
    const std::vector<double> ends = {channel.time_s.front(), channel.time_s.back()};
    plot.bands.push_back({"noise",
                          ends,
                          {-noise * unit.factor, -noise * unit.factor},
                          {noise * unit.factor, noise * unit.factor},
                          0});
  }
  plot.series.push_back({"declared", channel.time_s, scaled(before, unit.factor), 1});
  if (changed) plot.series.push_back({"with it", channel.time_s, scaled(after, unit.factor), 2});
  return figure(line_plot_svg(plot),
                "The same, enlarged: what is left when the simulation is taken from the recording. "
                "What stays in the grey band (two standard deviations of the noise) is explained.");
}

// A colour scale that both maps of a pair share: from the noise to the largest there is.
double scale_end(std::initializer_list<const std::vector<double>*> lists) {
  double most = 3.0;
  for (const std::vector<double>* list : lists) most = std::max(most, largest_of(*list));
  return most;
}

std::string time_map(const Evidence& evidence, bool after, double most) {
  MapPlot plot;
  plot.title = after ? "Channel by time, with what was found" : "Channel by time, declared model";
  plot.says =
      "Each row is a channel, each cell a stretch of the recording; the shade is the "
      "residual there over the noise.";
  plot.x_label = "time [s]";
  plot.value_label = "residual / noise";
  plot.x_low = evidence.windows.front().begin_s;
  plot.x_high = evidence.windows.back().end_s;
  plot.y_high = static_cast<double>(evidence.channels.size());
  plot.value_high = most;
  plot.height = 84.0 + 32.0 * static_cast<double>(evidence.channels.size());
  for (std::size_t c = 0; c < evidence.channels.size(); ++c) {
    const ChannelEvidence& channel = evidence.channels[c];
    plot.rows.push_back(channel_words(channel.channel));
    const auto& value = after ? channel.window_after : channel.window_before;
    const auto row = static_cast<double>(c);
    for (std::size_t i = 0; i < std::min(value.size(), evidence.windows.size()); ++i) {
      plot.cells.push_back({evidence.windows[i].begin_s, evidence.windows[i].end_s, row + 0.04,
                            row + 0.96, std::sqrt(value[i])});
    }
  }
  return map_plot_svg(plot);
}

std::string time_maps(const Evidence& evidence, bool changed) {
  if (evidence.windows.empty()) return "";
  double most = 3.0;
  for (const ChannelEvidence& channel : evidence.channels) {
    most = std::max({most, std::sqrt(largest_of(channel.window_before)),
                     std::sqrt(largest_of(channel.window_after))});
  }
  std::string out =
      figure(time_map(evidence, false, most),
             "When and in which channel the model misses. Ground colour: no more than "
             "the noise. A row that stands out: that channel feels what is missing; a "
             "column: it happened at that time only.");
  if (changed) {
    out += figure(time_map(evidence, true, most),
                  "The same with what was found, in the same colours: what still stands out is not "
                  "explained.");
  }
  return out;
}

std::string phase_map(const PhaseMap& map, const std::vector<double>& value, bool after,
                      double most) {
  const AxisUnit x = axis_unit(map.displacement_m, "m");
  const AxisUnit v = axis_unit(map.velocity_m_s, "m/s");
  MapPlot plot;
  plot.title = after ? "Phase space, with what was found" : "Phase space, declared model";
  plot.says =
      "A map over displacement and velocity of the mass; the shade is the residual of all "
      "channels there over the noise.";
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

std::string phase_maps(const PhaseMap& map, bool changed) {
  const double most = scale_end({&map.before, &map.after});
  std::string out = figure(
      phase_map(map, map.before, false, most),
      "Where in its motion the rig departs from the model. Left and right: far from rest, as a "
      "wrong spring shows; along the middle: slow motion and reversals, as wrong friction does. "
      "Empty: the mass was never there.");
  if (changed) {
    out += figure(phase_map(map, map.after, true, most),
                  "The same with what was found, in the same colours.");
  }
  return out;
}

double middle_drive_hz(const Evidence& evidence) {
  std::vector<double> hz;
  for (const WindowEvidence& each : evidence.windows) hz.push_back(each.drive_hz);
  return hz.empty() ? 0.0 : median(std::move(hz));
}

// Frequencies that a reader will look for.
std::vector<Mark> known_frequencies(const Diagnosis& d) {
  std::vector<Mark> out;
  const double drive_hz = middle_drive_hz(*d.evidence);
  if (drive_hz > 0.0) out.push_back({drive_hz, "drive"});
  const auto& own = d.baseline_model.oscillator.natural_frequency_hz;
  if (own && own->value > 0.0) out.push_back({own->value, "mass on its spring"});
  if (d.baseline_model.load_cell && d.baseline_model.load_cell->natural_frequency_hz.value > 0.0) {
    out.push_back({d.baseline_model.load_cell->natural_frequency_hz.value, "load cell"});
  }
  return out;
}

std::string spectrum_figure(const Diagnosis& d, const ChannelEvidence& channel, bool changed) {
  const std::string name = channel_words(channel.channel);
  LinePlot plot;
  plot.title = "By frequency: " + name;
  plot.says =
      "Power of the residual of this channel over frequency, in units of the noise, with the "
      "frequencies of the rig marked.";
  plot.x_label = "frequency [Hz]";
  plot.y_label = "power / noise power";
  plot.log_x = true;
  plot.log_y = true;
  plot.marks = known_frequencies(d);
  plot.levels = {{1.0, "noise"}};
  plot.series.push_back({"declared", channel.frequency_hz, channel.power_before, 1});
  if (changed) plot.series.push_back({"with it", channel.frequency_hz, channel.power_after, 2});
  return line_plot_svg(plot);
}

std::string drive_phase_figure(const ChannelEvidence& channel, bool changed) {
  LinePlot plot;
  plot.title = "By phase of the drive: " + channel_words(channel.channel);
  plot.says = "Residual of this channel over the noise, over the phase of the drive.";
  plot.x_label = "phase of the drive, 0 at its crest [degrees]";
  plot.y_label = "residual / noise";
  plot.levels = {{1.0, "noise"}};
  plot.series.push_back({"declared", channel.phase_deg, channel.phase_before, 1});
  if (changed) plot.series.push_back({"with it", channel.phase_deg, channel.phase_after, 2});
  return line_plot_svg(plot);
}

// From the least to the largest, with a little room, and never empty.
std::pair<double, double> room_around(double low, double high) {
  const double room = std::max(0.06 * (high - low), 0.02 * std::abs(high) + 1.0e-12);
  return {low - room, high + room};
}

std::string condition_map(const Evidence& evidence, bool after, double most) {
  double highest = 0.0;
  for (const WindowEvidence& each : evidence.windows) {
    highest = std::max(highest, each.drive_amplitude);
  }
  const AxisUnit unit = axis_unit(highest, info(evidence.driven_by).unit);
  MapPlot plot;
  plot.title =
      after ? "Operating condition, with what was found" : "Operating condition, declared model";
  plot.says =
      "One dot for each stretch of the recording, at the frequency and the amplitude of the "
      "drive there; the shade is the residual over the noise.";
  plot.x_label = "frequency of the drive [Hz]";
  plot.y_label = with_unit("amplitude of the drive", unit.unit);
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
  std::tie(plot.x_low, plot.x_high) = room_around(x_low, x_high);
  std::tie(plot.y_low, plot.y_high) = room_around(y_low, highest * unit.factor);
  return map_plot_svg(plot);
}

std::string condition_maps(const Evidence& evidence, bool changed) {
  if (evidence.windows.empty()) return "";
  double most = 9.0;
  for (const WindowEvidence& each : evidence.windows) {
    if (std::isfinite(each.before)) most = std::max({most, each.before, each.after});
  }
  most = std::sqrt(most);
  std::string out = figure(
      condition_map(evidence, false, most),
      "How the rig was driven when the model missed: one dot for each stretch. Dark dots on one "
      "side only: what is missing shows at such a drive (on a dark screen: bright ones).");
  if (changed) {
    out += figure(condition_map(evidence, true, most),
                  "The same with what was found, in the same colours.");
  }
  return out;
}

std::string words_below(const Curve& curve) {
  const std::string over = plain_words(curve.variable);
  std::string out;
  if (curve.quantity == "force against +x") {
    out = "The force that the declared model lacks, over the " + over +
          " (positive: against positive displacement). At zero it changes nothing.";
  } else if (curve.quantity == "factor on the friction law") {
    out = "By which factor the friction of the declared model is multiplied, over the " + over +
          ". At 1 it changes nothing.";
  } else if (curve.quantity == "normal load") {
    out = "The normal load, over the " + over + ".";
  } else if (curve.quantity == "reading") {
    out = "What the channel reads, over what is there. The dashed line would be right.";
  } else {
    out = std::string("The ") + curve.quantity + ", over the " + over + ".";
  }
  if (!curve.low.empty()) {
    out +=
        " Shaded: the 95\u00a0% interval; where it cannot be seen, it is narrower than the line.";
  }
  return out + " Drawn over the range of the recording.";
}

}  // namespace

std::string stretch_figures(const Diagnosis& d) {
  if (!d.evidence || d.evidence->stretch.count == 0) return "";
  const Evidence& evidence = *d.evidence;
  const bool changed = d.augmented.has_value();
  std::string out = "<div class=\"plots\">\n";
  for (const ChannelEvidence* channel : worst_first(evidence)) {
    out += overlay_figure(evidence, *channel, changed);
    out += difference_figure(evidence, *channel, changed);
  }
  return out + "</div>\n";
}

std::string residual_figures(const Diagnosis& d) {
  if (!d.evidence) return "";
  const Evidence& evidence = *d.evidence;
  const bool changed = d.augmented.has_value();
  std::string out = "<h3>By channel and time</h3>\n<div class=\"plots\">\n" +
                    time_maps(evidence, changed) +
                    "</div>\n<h3>In phase space</h3>\n<div class=\"plots\">\n" +
                    phase_maps(evidence.map, changed) +
                    "</div>\n<h3>By operating condition</h3>\n<div class=\"plots\">\n" +
                    condition_maps(evidence, changed) + "</div>\n";
  out += "<h3>By frequency and by phase of the drive</h3>\n<div class=\"plots\">\n";
  for (const ChannelEvidence* channel : worst_first(evidence)) {
    out += figure(spectrum_figure(d, *channel, changed),
                  "A peak tells which motion is not described; noise alone is flat at 1.");
    out += figure(drive_phase_figure(*channel, changed),
                  "A hump tells at which part of every cycle the model misses; noise alone is flat "
                  "at 1.");
  }
  return out + "</div>\n";
}

std::string shape_figures(const Finding& finding) {
  std::string out;
  for (const Curve& curve : finding.portrait) {
    const AxisUnit x = axis_unit(largest_of(curve.at), curve.variable_unit);
    const AxisUnit y = axis_unit(largest_of(curve.value), curve.unit);
    LinePlot plot;
    plot.title = plain_words(curve.quantity) + " over " + plain_words(curve.variable);
    plot.says = words_below(curve);
    plot.x_label = with_unit(plain_words(curve.variable), x.unit);
    plot.y_label = with_unit(plain_words(curve.quantity), y.unit);
    const auto at = scaled(curve.at, x.factor);
    if (!curve.low.empty()) {
      plot.bands.push_back(
          {"95 % interval", at, scaled(curve.low, y.factor), scaled(curve.high, y.factor), 2});
    }
    if (curve.quantity == "reading") {
      plot.series.push_back({"right", at, scaled(curve.at, y.factor), 1});
    }
    plot.series.push_back({"fitted", at, scaled(curve.value, y.factor), 2});
    out += figure(line_plot_svg(plot), words_below(curve));
  }
  return out.empty() ? out : "<div class=\"plots\">\n" + out + "</div>\n";
}

std::string calibration_figure(const Diagnosis& d) {
  IntervalPlot plot;
  plot.title = "Calibration: distance from the declared value";
  plot.says =
      "One row for each calibrated parameter: how many of its owner's standard deviations the "
      "recording moved it, with its interval.";
  plot.x_label = "declared standard deviations";
  plot.marks = {{-2.0, "\u22122"}, {0.0, "declared"}, {2.0, "+2"}};
  for (const Calibration& each : d.calibrated) {
    if (!(each.sigma > 0.0)) continue;
    plot.rows.push_back({each.path, each.sigmas_off, (each.low - each.declared) / each.sigma,
                         (each.high - each.declared) / each.sigma});
  }
  return figure(
      interval_plot_svg(plot),
      "Dots between the outer lines: the recording agrees with what was declared. A dot far "
      "outside: that value is wrong, or it stands in for physics that is not in the "
      "model.");
}

}  // namespace stickslip::diagnosis
