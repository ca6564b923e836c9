#include "tools/diagnose/report_html.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "physics/effects/number_text.h"
#include "tools/diagnose/picture.h"
#include "tools/diagnose/report.h"

namespace stickslip::diagnosis {

namespace {

using physics::number_text;

// Series are told apart by lightness and dashes as well as by hue.
constexpr const char* style_sheet = R"(
:root { --ink:#1b1f24; --soft:#59636e; --paper:#ffffff; --rule:#d8dee4; --card:#f6f8fa;
  --s0:#59636e; --s1:#c2410c; --s2:#0b5cad; --s3:#7c3aed; --good:#116329; --bad:#a40e26;
  --m0:#f4f1ea; --m1:#e6ddc9; --m2:#d9c4a0; --m3:#cba775; --m4:#b9874f; --m5:#a06632;
  --m6:#80481f; --m7:#5d2d14; --m8:#37160b; }
@media (prefers-color-scheme: dark) { :root { --ink:#e6edf3; --soft:#9198a1; --paper:#0d1117;
  --rule:#30363d; --card:#161b22; --s0:#9198a1; --s1:#ff9b66; --s2:#6cb6ff; --s3:#c297ff;
  --good:#56d364; --bad:#ff7b72; } }
@media print { :root { --ink:#000; --soft:#333; --paper:#fff; --rule:#bbb; --card:#fff; }
  section { break-inside: avoid; } }
* { box-sizing: border-box; }
body { margin:0 auto; padding:24px; max-width:1080px; background:var(--paper); color:var(--ink);
  font:15px/1.5 system-ui, sans-serif; }
h1 { font-size:26px; line-height:1.25; margin:0 0 4px; } h2 { font-size:18px; margin:32px 0 8px; }
h3 { font-size:15px; margin:18px 0 4px; }
p { margin:6px 0; } .soft { color:var(--soft); } code { font:13px ui-monospace, monospace;
  overflow-wrap:anywhere; }
.cards { display:flex; flex-wrap:wrap; gap:12px; margin:16px 0; }
.card { background:var(--card); border:1px solid var(--rule); border-radius:6px; padding:10px 14px;
  flex:1 1 200px; }
.card b { display:block; font-size:22px; font-weight:600; }
.scroll { overflow-x:auto; }
table { border-collapse:collapse; margin:8px 0; } th, td { text-align:left; padding:3px 14px 3px 0;
  border-bottom:1px solid var(--rule); vertical-align:top; font-variant-numeric:tabular-nums; }
th { font-weight:600; } .plots { display:flex; flex-wrap:wrap; gap:14px; }
svg { max-width:100%; height:auto; } .tick { font-size:11px; fill:var(--soft); }
.label { font-size:12px; fill:var(--soft); } .title { font-size:12.5px; font-weight:600;
  fill:var(--ink); }
.grid { stroke:var(--rule); stroke-width:0.7; } .mark { stroke:var(--soft); stroke-width:0.7;
  stroke-dasharray:2 3; }
.line { fill:none; stroke-width:1.6; } .s0 { stroke:var(--s0); } .s1 { stroke:var(--s1);
  stroke-dasharray:5 3; } .s2 { stroke:var(--s2); } .s3 { stroke:var(--s3); stroke-dasharray:1 3; }
.dot { stroke:none; } .dot.s0 { fill:var(--s0); } .dot.s1 { fill:var(--s1); }
.dot.s2 { fill:var(--s2); }
)";

std::string map_colours() {
  std::string out;
  for (int i = 0; i < 9; ++i) {
    const std::string n = std::to_string(i);
    out.append(".m").append(n).append(" { fill:var(--m").append(n).append("); }\n");
  }
  return out;
}

std::string percent(double share) {
  if (share > 0.999) return "over 99.9 %";
  return number_text(100.0 * share) + " %";
}

std::string paragraph(const std::string& text, const char* style = "") {
  return std::string("<p") + (*style != 0 ? std::string(" class=\"") + style + "\"" : "") + ">" +
         html_text(text) + "</p>\n";
}

std::string card(const std::string& what, const std::string& value) {
  return "<div class=\"card\">" + html_text(what) + "<b>" + html_text(value) + "</b></div>\n";
}

std::string headline(const Diagnosis& d) {
  switch (d.verdict) {
    case Verdict::consistent:
      return "Consistent: nothing beyond the noise; the model explains the recording.";
    case Verdict::unexplained:
      return "Unexplained: the model and the recording differ, and nothing that was tried explains "
             "it well enough.";
    case Verdict::missing_physics:
      break;
  }
  std::string names;
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    if (i > 0) names += i + 1 == d.findings.size() ? " and " : ", ";
    names += std::string(d.findings[i].effect->card().name);
    if (d.findings[i].place.channel) {
      names += " (" + std::string(info(*d.findings[i].place.channel).stem) + ")";
    }
  }
  return "Missing physics: " + names + ".";
}

std::string first_screen(const Diagnosis& d) {
  std::string out = "<h1>" + html_text(headline(d)) + "</h1>\n";
  if (d.location) out += paragraph(d.location->statement);
  for (const Finding& finding : d.findings) out += paragraph(finding.statement);
  out += "<div class=\"cards\">\n";
  const auto before = number_text(d.baseline.chi2_per_sample);
  out += card("held-out chi-squared per sample (1: only noise)",
              d.augmented ? before + " → " + number_text(d.augmented->chi2_per_sample) : before);
  if (!d.findings.empty()) {
    out += card("probability among what was tried", percent(d.findings.front().probability));
  }
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!d.baseline.rmse[c]) continue;
    const ChannelInfo& channel = channel_table[c];
    std::string value = number_text(*d.baseline.rmse[c]);
    if (d.augmented && d.augmented->rmse[c]) value += " → " + number_text(*d.augmented->rmse[c]);
    out += card("prediction error, " + std::string(channel.stem),
                value + " " + std::string(channel.unit));
    break;  // the first channel stands for the others here; all of them follow below
  }
  return out + "</div>\n";
}

std::string regions_section(const Diagnosis& d) {
  if (!d.location || d.location->regions.empty()) return "";
  constexpr std::size_t most = 12;
  std::string out =
      "<section><h2>Where it fails more than elsewhere</h2>\n<div class=\"scroll\"><table><tr>"
      "<th>channel</th><th>condition</th><th>residual there, in units of the noise</th>"
      "<th>elsewhere</th></tr>\n";
  const auto& regions = d.location->regions;
  for (std::size_t i = 0; i < std::min(most, regions.size()); ++i) {
    out.append("<tr><td>").append(info(regions[i].channel).stem).append("</td><td>");
    out.append(html_text(regions[i].words)).append("</td><td>");
    out.append(number_text(std::sqrt(regions[i].energy))).append("</td><td>");
    out.append(number_text(std::sqrt(regions[i].energy_outside))).append("</td></tr>\n");
  }
  out += "</table></div>\n";
  return out +
         paragraph(
             "Of all conditions that were looked at, those whose residuals are larger than "
             "elsewhere; of the entries of such lists one in twenty at most is there by chance "
             "(Benjamini and Yekutieli over blocks of windows drawn anew).",
             "soft") +
         "</section>\n";
}

std::string findings_section(const Diagnosis& d) {
  if (d.findings.empty()) return "";
  std::string out = "<section><h2>What was left out</h2>\n";
  int number = 0;
  for (const Finding& finding : d.findings) {
    const physics::Card& card = finding.effect->card();
    out += "<h3>" + std::to_string(++number) + ". " + html_text(std::string(card.name));
    if (finding.place.channel) out += ", channel " + std::string(info(*finding.place.channel).stem);
    out += "</h3>\n" + paragraph(finding.statement);
    out += "<p class=\"soft\"><code>" + html_text(std::string(card.equation)) + "</code></p>\n";
    out +=
        "<div class=\"scroll\"><table><tr><th>parameter</th><th>value</th><th>95 % "
        "interval</th><th>meaning</th></tr>\n";
    for (const Estimate& each : finding.parameters) {
      std::string meaning;
      for (const auto& parameter : card.parameters) {
        if (parameter.name == each.name) meaning = parameter.meaning;
      }
      out += "<tr><td>" + html_text(each.name) + "</td><td>" + number_text(each.value) +
             "</td><td>" + number_text(each.low) + " to " + number_text(each.high) + "</td><td>" +
             html_text(meaning) + "</td></tr>\n";
    }
    out +=
        "</table></div>\n<div class=\"scroll\"><table><tr><th>candidate</th><th>probability</th>"
        "</tr>\n<tr><td><b>" +
        html_text(Suspect{finding.effect, finding.place}.name()) + "</b></td><td>" +
        percent(finding.probability) + "</td></tr>\n";
    for (const Alternative& each : finding.alternatives) {
      out += "<tr><td>" + html_text(each.suspect.name()) + "</td><td>" + percent(each.probability) +
             "</td></tr>\n";
    }
    out += "</table></div>\n";
    if (finding.separating_experiment) {
      out +=
          paragraph("The run that would tell them apart: " + *finding.separating_experiment + ".");
    }
    out += "<div class=\"plots\">\n";
    for (const Curve& curve : finding.shape) {
      LinePlot plot;
      plot.title = curve.quantity + " over " + curve.variable;
      plot.x_label = curve.variable + " [" + curve.variable_unit + "]";
      plot.y_label = curve.quantity + (curve.unit == "1" ? "" : " [" + curve.unit + "]");
      plot.width = 420.0;
      plot.series.push_back({"", curve.at, curve.value, 2, false});
      out += line_plot_svg(plot);
    }
    out += "</div>\n";
  }
  return out + "</section>\n";
}

std::string pictures_section(const Diagnosis& d) {
  if (!d.evidence) return "";
  const Evidence& evidence = *d.evidence;
  const bool changed = d.augmented.has_value();
  std::string out;
  out += "<section><h2>Recorded and predicted</h2>\n" +
         paragraph(
             "Where the declared model fails most. Dotted lines: a prediction starts anew, "
             "from a state that is fitted to that window alone.",
             "soft") +
         "<div class=\"plots\">\n";
  for (const ChannelEvidence& channel : evidence.channels) {
    const ChannelInfo& name = info(channel.channel);
    LinePlot plot;
    plot.title = std::string(name.stem);
    plot.x_label = "time [s]";
    plot.y_label = std::string(name.stem) + " [" + std::string(name.unit) + "]";
    plot.width = 1000.0;
    plot.marks = evidence.window_begin_s;
    plot.series.push_back({"recorded", channel.time_s, channel.recorded, 0, false});
    plot.series.push_back({"declared model", channel.time_s, channel.before, 1, false});
    if (changed) {
      plot.series.push_back({"with what was found", channel.time_s, channel.after, 2, false});
    }
    out += line_plot_svg(plot);
  }
  out += "</div></section>\n<section><h2>What is left over</h2>\n" +
         paragraph("Residuals over the noise: 1 is noise alone.", "soft") +
         "<div class=\"plots\">\n";
  for (const ChannelEvidence& channel : evidence.channels) {
    const std::string name(info(channel.channel).stem);
    LinePlot by_time;
    by_time.title = name + ", by time";
    by_time.x_label = "time [s]";
    by_time.y_label = "chi-squared";
    by_time.log_y = true;
    by_time.width = 490.0;
    by_time.series.push_back({"before", channel.window_time_s, channel.window_before, 1, true});
    if (changed) {
      by_time.series.push_back({"after", channel.window_time_s, channel.window_after, 2, true});
    }
    out += line_plot_svg(by_time);
    LinePlot spectrum;
    spectrum.title = name + ", by frequency";
    spectrum.x_label = "frequency [Hz]";
    spectrum.y_label = "power";
    spectrum.log_y = true;
    spectrum.width = 490.0;
    spectrum.series.push_back({"before", channel.frequency_hz, channel.power_before, 1, false});
    if (changed) {
      spectrum.series.push_back({"after", channel.frequency_hz, channel.power_after, 2, false});
    }
    out += line_plot_svg(spectrum);
  }
  const auto map = [&](const char* title, const std::vector<double>& value) {
    MapPlot plot;
    plot.title = title;
    plot.x_label = "displacement [m]";
    plot.y_label = "velocity [m/s]";
    plot.value_label = "residual / noise";
    plot.columns = PhaseMap::cells;
    plot.x_low = -evidence.map.displacement_m;
    plot.x_high = evidence.map.displacement_m;
    plot.y_low = -evidence.map.velocity_m_s;
    plot.y_high = evidence.map.velocity_m_s;
    plot.value_low = 0.5;
    double most = 2.0;
    for (const double each : evidence.map.before) {
      if (std::isfinite(each)) most = std::max(most, each);
    }
    plot.value_high = most;
    plot.value = value;
    plot.width = 490.0;
    plot.height = 340.0;
    return map_plot_svg(plot);
  };
  out += map("Phase space, declared model", evidence.map.before);
  if (changed) out += map("Phase space, with what was found", evidence.map.after);
  return out + "</div></section>\n";
}

std::string numbers_section(const Diagnosis& d) {
  std::string out =
      "<section><h2>Numbers</h2>\n<div class=\"scroll\"><table><tr><th>held-out "
      "prediction error</th><th>declared</th><th>with what was found</th></tr>\n";
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!d.baseline.rmse[c]) continue;
    const std::string unit = " " + std::string(channel_table[c].unit);
    out += "<tr><td>" + std::string(channel_table[c].stem) + ", " + number_text(d.horizon_s) +
           " s ahead</td><td>" + number_text(*d.baseline.rmse[c]) + unit + "</td><td>" +
           (d.augmented && d.augmented->rmse[c] ? number_text(*d.augmented->rmse[c]) + unit : "") +
           "</td></tr>\n";
  }
  out += "<tr><td>chi-squared per sample</td><td>" + number_text(d.baseline.chi2_per_sample) +
         "</td><td>" + (d.augmented ? number_text(d.augmented->chi2_per_sample) : "") +
         "</td></tr>\n</table></div>\n";
  if (!d.calibrated.empty()) {
    out +=
        "<div class=\"scroll\"><table><tr><th>calibrated parameter</th><th>value</th><th>sigmas "
        "from the declared value</th></tr>\n";
    for (const Calibration& each : d.calibrated) {
      char off[32];
      std::snprintf(off, sizeof off, "%+.1f", each.sigmas_off);
      out += "<tr><td>" + html_text(each.path) + "</td><td>" + number_text(each.value) +
             "</td><td>" + off + "</td></tr>\n";
    }
    out += "</table></div>\n";
  }
  out +=
      "<div class=\"scroll\"><table><tr><th>noise</th><th>standard deviation</th><th></th></tr>\n";
  for (const auto& [channel, value] : d.noise_std) {
    const bool estimated = std::find(d.noise_estimated.begin(), d.noise_estimated.end(), channel) !=
                           d.noise_estimated.end();
    out += "<tr><td>" + std::string(info(channel).stem) + "</td><td>" + number_text(value) + " " +
           std::string(info(channel).unit) + "</td><td>" +
           (estimated ? "estimated from the recording" : "declared") + "</td></tr>\n";
  }
  out +=
      "</table></div>\n<h3>What was tried</h3>\n<div class=\"scroll\"><table><tr><th>added to"
      "</th><th>candidate</th><th>held-out chi-squared</th></tr>\n";
  for (const Trial& trial : d.trials) {
    out += "<tr><td>" +
           (trial.stage == 0 ? std::string("the declared model")
                             : std::to_string(trial.stage) + " found before") +
           "</td><td>" + html_text(trial.id) + "</td><td>" + number_text(trial.heldout_chi2) +
           "</td></tr>\n";
  }
  return out + "</table></div></section>\n";
}

std::string detection_section(const Diagnosis& d) {
  if (d.detection.limits.empty() && !d.false_alarms) return "";
  std::string out = "<section><h2>What else would have been seen</h2>\n";
  if (d.false_alarms) out += paragraph(sentence_of(*d.false_alarms));
  out += paragraph(
      "From these sizes on the recording would have shown it, beside what was found. Effects that "
      "replace a law instead of bending it are not in this table.");
  out += "<div class=\"scroll\"><table><tr><th>effect</th><th>parameter</th><th>from</th></tr>\n";
  for (const DetectionLimit& limit : d.detection.limits) {
    out += "<tr><td>" + html_text(limit.suspect.name()) + "</td><td>" +
           html_text(std::string(limit.parameter().name)) + "</td><td>" + value_text(limit) + " " +
           html_text(std::string(limit.parameter().unit)) + "</td></tr>\n";
  }
  out += "</table></div>\n";
  if (!d.detection.lookalikes.empty()) {
    out +=
        paragraph("These move the readings alike; this recording cannot tell one from the other.");
    out += "<div class=\"scroll\"><table><tr><th>one</th><th>other</th><th>cosine</th></tr>\n";
    for (const Lookalikes& pair : d.detection.lookalikes) {
      out += "<tr><td>" + html_text(d.detection.limits[pair.one].suspect.name()) + "</td><td>" +
             html_text(d.detection.limits[pair.other].suspect.name()) + "</td><td>" +
             number_text(pair.cosine) + "</td></tr>\n";
    }
    out += "</table></div>\n";
  }
  return out + "</section>\n";
}

std::string recordings_section(const Diagnosis& d) {
  std::string out = "<section><h2>The recordings themselves</h2>\n";
  for (const Integrity& each : d.integrity) {
    out += paragraph(each.source + ": " + number_text(each.duration_s) + " s at " +
                     number_text(each.rate_hz) + " Hz, " + std::to_string(each.frames) +
                     " frames, " + std::to_string(each.lost) + " lost.");
    out +=
        "<div class=\"scroll\"><table><tr><th>channel</th><th>lowest</th><th>highest</th>"
        "<th>step</th><th>samples at a rail</th><th>line of the mains</th></tr>\n";
    for (const ChannelIntegrity& c : each.channels) {
      const auto cell = [&out](const std::string& text) {
        out.append("<td>").append(text).append("</td>");
      };
      const auto amount = [&c](double value) {
        return number_text(value).append(" ").append(info(c.channel).unit);
      };
      out += "<tr>";
      cell(std::string(info(c.channel).stem));
      cell(amount(c.lowest));
      cell(amount(c.highest));
      cell(c.step > 0.0 ? amount(c.step) : "none seen");
      cell(std::to_string(c.at_low_rail + c.at_high_rail));
      cell(c.mains ? amount(c.mains->amplitude)
                         .append(" at ")
                         .append(number_text(c.mains->frequency_hz))
                         .append(" Hz")
                   : "none");
      out += "</tr>\n";
    }
    out += "</table></div>\n";
    for (const std::string& remark : each.remarks) out += paragraph(remark);
  }
  return out + "</section>\n";
}

std::string repeat_section(const Diagnosis& d, const Provenance& provenance) {
  std::string out = "<section><h2>To repeat this</h2>\n<p><code>" + html_text(provenance.command) +
                    "</code></p>\n";
  out += paragraph("stickslip " + provenance.version + ", seed " + std::to_string(provenance.seed) +
                   "; " + std::to_string(d.fitted_windows) + " windows fitted, " +
                   std::to_string(d.heldout_windows) + " held out, " + number_text(d.horizon_s) +
                   " s each.");
  out += "<div class=\"scroll\"><table><tr><th>file</th><th>SHA-256</th></tr>\n";
  for (const auto& file : provenance.files) {
    out +=
        "<tr><td>" + html_text(file.name) + "</td><td><code>" + file.sha256 + "</code></td></tr>\n";
  }
  return out + "</table></div></section>\n";
}

}  // namespace

std::string report_html(const Diagnosis& diagnosis, const Provenance& provenance) {
  std::string out =
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>Diagnosis: " +
      html_text(headline(diagnosis)) + "</title>\n<style>" + style_sheet + map_colours() +
      "</style>\n</head>\n<body>\n<main>\n";
  out += first_screen(diagnosis);
  out += findings_section(diagnosis);
  out += regions_section(diagnosis);
  out += pictures_section(diagnosis);
  out += numbers_section(diagnosis);
  out += detection_section(diagnosis);
  out += recordings_section(diagnosis);
  out += repeat_section(diagnosis, provenance);
  return out + "</main>\n</body>\n</html>\n";
}

}  // namespace stickslip::diagnosis
