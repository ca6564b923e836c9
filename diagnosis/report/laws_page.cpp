// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/laws_page.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "diagnosis/report/formatting.h"
#include "diagnosis/report/html.h"
#include "diagnosis/report/json.h"
#include "diagnosis/report/plot_svg.h"
#include "physics/friction_laws.h"
#include "physics/number_text.h"

namespace stickslip::report {

using namespace diagnosis;
using physics::number_text;
using physics::ResultUnits;

namespace {

using Json = nlohmann::ordered_json;

ResultUnits units_of(const LawComparison& comparison) {
  return ResultUnits(comparison.laws.front().model);
}

// Without a normal load the coefficients of a law are forces.
std::string unit_of(const Estimate& each, const FittedLaw& law, const ResultUnits& units) {
  const bool is_force = !law.model.normal_load && (each.name == "mu" || each.name == "mu_static");
  return std::string(units.of(is_force ? "N" : each.unit));
}

// "stiffness_n_m 61.2 (58.9 to 63.6)"
std::string estimate_text(const Estimate& each, const ResultUnits& units) {
  if (is_undetermined(each)) return units.column(each.name, each.unit) + " not determined";
  const EstimateText text = format_estimate(each.value, each.low, each.high);
  std::string out = units.column(each.name, each.unit);
  out.append(" ").append(text.value).append(" (").append(text.low).append(" to ");
  return out.append(text.high).append(")");
}

std::string score_text(const FittedLaw& law, bool is_first, const std::string& within) {
  if (is_first) return "0";
  const auto& [value, error] = law.over_first;
  const EstimateText text = format_estimate(value, value - error, value + error);
  return text.value + within + format_number(error, 2);
}

// Filled up with blanks; a character of several bytes is one column.
std::string column(std::string text, std::size_t columns) {
  const auto begins = [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; };
  const auto used = static_cast<std::size_t>(std::count_if(text.begin(), text.end(), begins));
  text.append(columns > used ? columns - used : 0, ' ');
  return text;
}

std::string verdict_text(const FittedLaw& law, bool is_first) {
  if (is_first) return "preferred";
  const std::string out = law.distinguished ? "worse" : "not distinguished";
  return law.determined ? out : out + ", not determined";
}

std::string meaning_of_score(const LawComparison& comparison) {
  const bool determined =
      std::all_of(comparison.laws.begin(), comparison.laws.end(),
                  [](const FittedLaw& law) { return law.determined || law.id == "none"; });
  return std::string(comparison.noise_is_known
                         ? "Score: log predictive density of windows that nothing was fitted to, "
                           "less that of the first law [nat], with its standard error over windows."
                         : "Score: log likelihood of predictions in windows that nothing was "
                           "fitted to, less that of the first law [nat], with its standard error "
                           "over windows; the noise is not known.") +
         (determined ? "" : " Laws that the recording does not determine come last.");
}

}  // namespace

std::string laws_text(const LawComparison& comparison) {
  const ResultUnits units = units_of(comparison);
  std::ostringstream out;
  const auto row = [&out](const std::string& law, const std::string& score, const std::string& chi2,
                          const std::string& verdict) {
    out << column(law, 16) << column(score, 20) << column(chi2, 10) << verdict << "\n";
  };
  out << comparison.conclusion << "\n\n";
  row("law", "score", "chi2", "");
  for (const FittedLaw& law : comparison.laws) {
    const bool is_first = &law == &comparison.laws.front();
    row(law.id, score_text(law, is_first, " +/- "), format_number(law.held_out.chi2_per_sample),
        verdict_text(law, is_first));
    for (const Estimate& each : law.parameters) {
      out << "    " << estimate_text(each, units) << "\n";
    }
  }
  out << "\n"
      << meaning_of_score(comparison)
      << " chi2: per sample, on windows held out from fit and choice. Intervals: 95 %.\n";
  for (const FittedLaw& law : comparison.laws) {
    if (!law.separating_run) continue;
    out << "To distinguish " << comparison.laws.front().id << " from " << law.id << ": "
        << units.sentence(*law.separating_run) << ".\n";
  }
  return out.str();
}

Json laws_json(const LawComparison& comparison, const Provenance& provenance) {
  Json json;
  json["schema"] = 1;
  if (comparison.dimensionless) json["dimensionless"] = true;
  json["conclusion"] = comparison.conclusion;
  json["noise_is_known"] = comparison.noise_is_known;
  json["laws"] = Json::array();
  for (const FittedLaw& law : comparison.laws) {
    Json each;
    each["law"] = law.id;
    each["name"] = law.name;
    each["statement"] = law.statement;
    each["score"] = {{"value", law.over_first.value}, {"se", law.over_first.se}, {"unit", "nat"}};
    each["probability"] = law.probability;
    each["determined"] = law.determined;
    each["distinguished"] = law.distinguished;
    each["separating_experiment"] = law.separating_run ? Json(*law.separating_run) : Json(nullptr);
    each["parameters"] = Json::object();
    for (const Estimate& estimate : law.parameters) {
      each["parameters"][estimate.name] = {{"value", estimate.value},
                                           {"unit", estimate.unit},
                                           {"ci95", Json::array({estimate.low, estimate.high})}};
    }
    each["heldout"] = score_json(law.held_out, false);
    json["laws"].push_back(std::move(each));
  }
  json["fit"]["horizon_s"] = comparison.horizon_s;
  json["fit"]["windows"] = {{"fit", comparison.windows.fit},
                            {"select", comparison.windows.select},
                            {"report", comparison.windows.report}};
  json["provenance"] = provenance_json(provenance);
  return json;
}

// ---- Page
// --------------------------------------------------------------------------------------------

namespace {

using Values = std::vector<double>;

// A curve of each law that was drawn, over what was recorded.
struct Picture {
  std::string title;
  std::string caption;
  std::string x_name;
  std::string x_unit;
  std::string y_name = "friction force";
  std::function<const Values&(const LawCurves&)> x, y;
  const Values* recorded_x = nullptr;
  const Values* recorded_y = nullptr;
  bool log_x = false;
};

double largest(const std::vector<Series>& series, bool of_x) {
  double out = 0.0;
  for (const Series& each : series) {
    for (const double value : of_x ? each.x : each.y) {
      if (std::isfinite(value)) out = std::max(out, std::abs(value));
    }
  }
  return out;
}

std::string picture(const LawComparison& comparison, const Picture& what) {
  LinePlot plot;
  plot.title = what.title;
  plot.description = what.caption;
  plot.log_x = what.log_x;
  if (what.recorded_x != nullptr && !what.recorded_x->empty()) {
    plot.series.push_back({"recorded", *what.recorded_x, *what.recorded_y, 0});
  }
  int style = 1;
  for (const FittedLaw& law : comparison.laws) {
    if (!law.curves || style > 3 || what.x(*law.curves).empty()) continue;
    plot.series.push_back(
        without_way_back({law.id, what.x(*law.curves), what.y(*law.curves), style++}));
  }
  if (style == 1) return "";
  const ResultUnits units = units_of(comparison);
  const AxisUnit x = what.log_x ? AxisUnit{1.0, std::string(units.of(what.x_unit))}
                                : axis_unit(largest(plot.series, true), units.of(what.x_unit));
  const AxisUnit y = axis_unit(largest(plot.series, false), units.of("N"));
  for (Series& each : plot.series) {
    for (double& value : each.x) value *= x.factor;
    for (double& value : each.y) value *= y.factor;
  }
  plot.x_label = units.axis(what.x_name, x.unit);
  plot.y_label = units.axis(what.y_name, y.unit);
  return figure(line_plot_svg(plot), what.caption);
}

Section pictures_section(const LawComparison& comparison) {
  Section out("pictures", "Curves of the laws");
  const RecordedFriction none;
  const RecordedFriction& recorded = comparison.recorded ? *comparison.recorded : none;
  std::string figures;
  figures += picture(
      comparison,
      {.title = "Friction over velocity",
       .caption = "One cycle of a sinusoid of the recorded amplitude and speed. A loop: friction "
                  "has a memory, or the contact is compliant.",
       .x_name = "velocity",
       .x_unit = "m/s",
       .x = [](const LawCurves& c) -> const Values& { return c.velocity_m_s; },
       .y = [](const LawCurves& c) -> const Values& { return c.force_n; },
       .recorded_x = &recorded.velocity_m_s,
       .recorded_y = &recorded.force_n});
  figures += picture(
      comparison,
      {.title = "Friction over displacement",
       .caption = "The same cycle. Slanted flanks at the turning points: the contact deflects "
                  "before it slips.",
       .x_name = "displacement",
       .x_unit = "m",
       .x = [](const LawCurves& c) -> const Values& { return c.displacement_m; },
       .y = [](const LawCurves& c) -> const Values& { return c.force_n; },
       .recorded_x = &recorded.displacement_m,
       .recorded_y = &recorded.force_n});
  figures += picture(
      comparison,
      {.title = "Break-away force over the rate of loading",
       .caption = "The mass alone under a force that grows at this rate: its largest friction "
                  "before it has slipped. No recording shows this directly.",
       .x_name = "rate of the force",
       .x_unit = "N/s",
       .y_name = "break-away force",
       .x = [](const LawCurves& c) -> const Values& { return c.loading_rate_n_s; },
       .y = [](const LawCurves& c) -> const Values& { return c.break_away_n; },
       .log_x = true});
  figures += picture(
      comparison,
      {.title = "Frictional lag",
       .caption = "A velocity that swings between a twentieth of its mean and nearly twice it. "
                  "Where friction lags, it is higher while the velocity grows than while it falls.",
       .x_name = "velocity",
       .x_unit = "m/s",
       .x = [](const LawCurves& c) -> const Values& { return c.lag_velocity_m_s; },
       .y = [](const LawCurves& c) -> const Values& { return c.lag_force_n; }});
  if (figures.empty()) return out;
  out += paragraph(
      "The first laws of the table with their fitted parameters, as the literature draws them.");
  out += "<div class=\"plots\">\n" + figures + "</div>\n";
  return out;
}

Section table_section(const LawComparison& comparison) {
  Section out("laws", "Laws and scores");
  Table table(meaning_of_score(comparison) +
                  " Chi-squared: per sample, on windows held out from fit and choice.",
              {"law", "name", "score", "chi-squared", ""});
  for (const FittedLaw& law : comparison.laws) {
    const bool is_first = &law == &comparison.laws.front();
    table.row(
        {code(law.id), escape_html(law.name), escape_html(score_text(law, is_first, " \u00b1 ")),
         format_number(law.held_out.chi2_per_sample), escape_html(verdict_text(law, is_first))});
  }
  out += table.html();
  const ResultUnits units = units_of(comparison);
  for (const FittedLaw& law : comparison.laws) {
    if (!law.separating_run) continue;
    out += paragraph("To distinguish " + comparison.laws.front().id + " from " + law.id + ": " +
                     plain_text(units.sentence(*law.separating_run)) + ".");
  }
  return out;
}

Section parameters_section(const LawComparison& comparison) {
  Section out("parameters", "Parameters");
  const ResultUnits units = units_of(comparison);
  for (const FittedLaw& law : comparison.laws) {
    const physics::Effect* effect = physics::find_law(law.id);
    if (effect == nullptr) continue;
    out += "<h3>" + escape_html(law.name) + "</h3>\n" +
           paragraph(plain_text(units.sentence(law.statement)));
    out += "<p>Equation: " + code(effect->card().equation) + "</p>\n";
    Table table("With 95 % intervals.", {"name", "value", "95 % interval", "unit"});
    for (const Estimate& each : law.parameters) {
      const EstimateText text = format_estimate(each.value, each.low, each.high);
      const std::string unit = unit_of(each, law, units);
      const bool undetermined = is_undetermined(each);
      table.row({code(each.name), undetermined ? "not determined" : text.value,
                 undetermined ? "" : text.low + " to " + text.high,
                 escape_html(unit == "1" || unit.empty() ? "none" : unit)});
    }
    out += table.html();
    for (const std::string_view reference : effect->card().references) {
      out += paragraph(std::string(reference) + ".", "soft");
    }
  }
  return out;
}

}  // namespace

std::string laws_html(const LawComparison& comparison, const Provenance& provenance) {
  const FittedLaw& first = comparison.laws.front();
  const std::string title = "Laws of friction: " + first.name;
  const std::string head =
      "<header class=\"verdict\">\n<p class=\"kicker\">Comparison of laws</p>\n<h1>" +
      escape_html(title) + "</h1>\n" +
      paragraph(plain_text(units_of(comparison).sentence(comparison.conclusion))) + "</header>\n";
  return html_page(
      title, head,
      {table_section(comparison), pictures_section(comparison), parameters_section(comparison),
       reproduction_section(comparison.windows, comparison.horizon_s, units_of(comparison),
                            provenance)});
}

}  // namespace stickslip::report
