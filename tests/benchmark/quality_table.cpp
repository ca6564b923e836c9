// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/quality_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "physics/number_text.h"
#include "tests/benchmark/estimate_statistics.h"
#include "tools/concealment/bench_drawing.h"

namespace stickslip::quality {

namespace {

using Recordings = std::vector<const RecordingQuality*>;
using Value = std::function<std::optional<double>(const RecordingQuality&)>;
using Cell = std::function<std::string(const Recordings&)>;

struct Column {
  std::string title;
  Cell cell;
};

std::string text(const char* format, double value) {
  if (std::isinf(value)) return "infinite";
  char out[40];
  std::snprintf(out, sizeof out, format, value);
  return out;
}

// Two digits; large ones as a power of ten, percentages that round to 100 only where they are.
std::string percent(double share) {
  const double value = 100.0 * share;
  if (!(std::abs(value) < 1.0e4)) return text("%.0e", value);
  return text(std::abs(value) < 9.95 ? "%.1f" : "%.0f", value);
}

std::string plain(double value) {
  return text(std::abs(value) < 9.95 ? "%.2f" : (std::abs(value) < 1.0e4 ? "%.0f" : "%.0e"), value);
}

std::string three_digits(double value) { return text("%.3f", value); }

using Format = std::string (*)(double);

// "median (worst)"
Column median_and_worst(std::string title, Format format, Worst worst, Value value) {
  return {std::move(title), [format, worst, value = std::move(value)](const Recordings& all) {
            std::vector<std::optional<double>> values;
            for (const RecordingQuality* each : all) values.push_back(value(*each));
            const auto found = distribution_of(values, worst);
            if (!found) return std::string("-");
            return format(found->median) + " (" + format(found->worst) + ")";
          }};
}

template <class Predicate>
std::size_t count_of(const Recordings& all, const Predicate& predicate) {
  return static_cast<std::size_t>(
      std::count_if(all.begin(), all.end(), [&](const auto* each) { return predicate(*each); }));
}

template <class Predicate>
Column counted(std::string title, Predicate predicate) {
  return {std::move(title),
          [predicate](const Recordings& all) { return std::to_string(count_of(all, predicate)); }};
}

std::string row(const std::string& name, const std::vector<Column>& columns,
                const Recordings& recordings) {
  std::string out = "| " + name;
  for (const Column& column : columns) out += " | " + column.cell(recordings);
  return out + " |\n";
}

// By world, in the order of all_bench_kinds, and over all.
std::string table(const std::vector<Column>& columns, const Recordings& recordings) {
  std::string out = "| world";
  std::string rule = "| ---";
  for (const Column& column : columns) {
    out += " | " + column.title;
    rule += " | ---";
  }
  out += " |\n" + rule + " |\n";
  for (const auto kind : concealment::all_bench_kinds) {
    const std::string world(concealment::name_of(kind));
    Recordings of_world;
    std::copy_if(recordings.begin(), recordings.end(), std::back_inserter(of_world),
                 [&](const RecordingQuality* each) { return each->world == world; });
    if (!of_world.empty()) out += row(world, columns, of_world);
  }
  return out + row("all", columns, recordings) + "\n";
}

// A quantity of both estimators.
using Estimated = std::optional<double> EstimatorQuality::*;

Column of(const char* title, EstimatorQuality RecordingQuality::*estimator, Estimated quantity,
          Format format, Worst worst) {
  return median_and_worst(title, format, worst, [=](const RecordingQuality& each) {
    return (each.*estimator).*quantity;
  });
}

constexpr auto filter = &RecordingQuality::filter;
constexpr auto smoother = &RecordingQuality::smoother;

std::vector<Column> error_columns(const std::string& name,
                                  std::optional<double> HandErrors::*by_hand, Estimated estimated) {
  return {
      median_and_worst(name + ": by hand, causal", percent, Worst::largest,
                       [=](const RecordingQuality& each) { return each.by_hand.causal.*by_hand; }),
      median_and_worst("best", percent, Worst::largest,
                       [=](const RecordingQuality& each) { return each.by_hand.best.*by_hand; }),
      of("filter", filter, estimated, percent, Worst::largest),
      of("smoother", smoother, estimated, percent, Worst::largest)};
}

Column final_mu(EstimatorQuality RecordingQuality::*estimator) {
  return {"final mu", [=](const Recordings& all) {
            std::size_t known = 0;
            std::size_t covered = 0;
            for (const RecordingQuality* each : all) {
              const std::optional<bool>& covers = (each->*estimator).final_mu_covered;
              if (!covers) continue;
              ++known;
              if (*covers) ++covered;
            }
            return std::to_string(covered) + " of " + std::to_string(known);
          }};
}

std::vector<Column> coverage_columns(EstimatorQuality RecordingQuality::*estimator) {
  const auto covered = [=](const char* title, Estimated quantity) {
    return of(title, estimator, quantity, percent, Worst::smallest);
  };
  return {
      covered("f", &EstimatorQuality::force_coverage),
      covered("theta", &EstimatorQuality::theta_coverage),
      covered("slip", &EstimatorQuality::slip_coverage),
      covered("mu", &EstimatorQuality::mu_coverage),
      covered("N", &EstimatorQuality::load_coverage),
      final_mu(estimator),
      covered("NEES", &EstimatorQuality::nees_inside),
      of("mean NEES", estimator, &EstimatorQuality::nees, plain, Worst::largest),
      median_and_worst("good frames", percent, Worst::smallest, [=](const RecordingQuality& each) {
        return std::optional((each.*estimator).good_share);
      })};
}

// The sum over recordings, and the most in one.
Column summed(std::string title, std::function<std::uint64_t(const RecordingQuality&)> count) {
  return {std::move(title), [count = std::move(count)](const Recordings& all) {
            std::uint64_t sum = 0;
            std::uint64_t most = 0;
            for (const RecordingQuality* each : all) {
              sum += count(*each);
              most = std::max(most, count(*each));
            }
            return std::to_string(sum) + " (" + std::to_string(most) + ")";
          }};
}

Column false_alarms() {
  return summed("false alarms", [](const auto& each) { return each.alarms; });
}

Column hours() {
  return {"hours", [](const Recordings& all) {
            double sum = 0.0;
            for (const auto* each : all) sum += each->duration_s;
            return text("%.2f", sum / 3600.0);
          }};
}

std::vector<Column> event_columns() {
  return {median_and_worst("AUC by hand", three_digits, Worst::smallest,
                           [](const RecordingQuality& each) { return each.by_hand.best.auc; }),
          of("filter", filter, &EstimatorQuality::auc, three_digits, Worst::smallest),
          of("smoother", smoother, &EstimatorQuality::auc, three_digits, Worst::smallest),
          summed("restarts", [](const auto& each) { return each.filter.restarts; }),
          counted("smoother unphysical",
                  [](const auto& each) { return each.smoother.largest_theta > unphysical_theta; }),
          false_alarms(),
          hours()};
}

Recordings pointers(const std::vector<RecordingQuality>& recordings) {
  Recordings out;
  for (const RecordingQuality& each : recordings) out.push_back(&each);
  return out;
}

Recordings supported(const std::vector<RecordingQuality>& recordings) {
  Recordings out = pointers(recordings);
  std::erase_if(out, [](const RecordingQuality* each) { return !each->unsupported.empty(); });
  return out;
}

// The unsupported recordings, by reason.
std::string unsupported_table(const std::vector<RecordingQuality>& recordings) {
  std::map<std::string, std::size_t> reasons;
  for (const RecordingQuality& each : recordings) {
    if (!each.unsupported.empty()) ++reasons[each.unsupported];
  }
  std::string out = "| not supported, of " + std::to_string(recordings.size()) +
                    " recordings | reason |\n| --- | --- |\n";
  if (reasons.empty()) out += "| 0 | - |\n";
  for (const auto& [reason, count] : reasons) {
    out += "| " + std::to_string(count) + " | " + reason + " |\n";
  }
  return out + "\n";
}

Column number_of_recordings() {
  return {"recordings", [](const Recordings& all) { return std::to_string(all.size()); }};
}

void append(std::vector<Column>& columns, const std::vector<Column>& more) {
  columns.insert(columns.end(), more.begin(), more.end());
}

}  // namespace

std::string quality_tables(const std::vector<RecordingQuality>& recordings) {
  const Recordings all = supported(recordings);
  std::vector<Column> errors = {
      number_of_recordings(),
      counted("with friction", [](const auto& each) { return each.by_hand.best.force; })};
  append(errors, error_columns("f", &HandErrors::force, &EstimatorQuality::force));
  std::vector<Column> states = error_columns("theta", &HandErrors::theta, &EstimatorQuality::theta);
  append(states, error_columns("slip", &HandErrors::slip, &EstimatorQuality::slip));
  std::string out = "RMS error of the friction force, % of its RMS:\n\n" + table(errors, all);
  out += "RMS errors of theta and of the slip velocity, % of their RMS:\n\n" + table(states, all);
  out +=
      "Filter: truths within 95 % intervals, %; NEES of x, v, theta, mu within its 95 % bounds, "
      "%,\nand its mean per degree of freedom:\n\n" +
      table(coverage_columns(filter), all);
  out += "Smoother, likewise:\n\n" + table(coverage_columns(smoother), all);
  out +=
      "Stick against slip, and events (most in one recording):\n\n" + table(event_columns(), all);
  return out + unsupported_table(recordings);
}

std::string live_check_table(const std::vector<RecordingQuality>& recordings) {
  const auto explained = [](Explained Notice::*when, bool certain, bool right) {
    return [=](const RecordingQuality& each) {
      if (!each.notice) return false;
      const Explained& found = (*each.notice).*when;
      return found.certain == certain && found.right == right;
    };
  };
  const std::vector<Column> columns = {
      number_of_recordings(),
      counted("alarm within 2 s",
              [](const auto& each) { return each.notice && each.notice->after_s <= 2.0; }),
      counted("ever", [](const auto& each) { return each.notice.has_value(); }),
      counted("at once: certain, right", explained(&Notice::at_once, true, true)),
      counted("certain, wrong", explained(&Notice::at_once, true, false)),
      counted("uncertain, first right", explained(&Notice::at_once, false, true)),
      counted("first wrong", explained(&Notice::at_once, false, false)),
      counted("at last: certain, right", explained(&Notice::at_last, true, true)),
      counted("certain, wrong", explained(&Notice::at_last, true, false)),
      counted("uncertain, first right", explained(&Notice::at_last, false, true)),
      counted("first wrong", explained(&Notice::at_last, false, false))};
  return table(columns, supported(recordings)) + unsupported_table(recordings);
}

std::string false_alarm_table(const std::vector<RecordingQuality>& recordings) {
  return table({number_of_recordings(), false_alarms(), hours()}, supported(recordings));
}

std::string renewed(const std::string& document, const std::string& kind,
                    const std::string& tables) {
  const std::string begin = "<!-- observer_table --kind " + kind + " -->\n";
  const std::size_t mark = document.find(begin);
  const std::size_t end = mark == std::string::npos ? mark : document.find("<!-- end -->\n", mark);
  if (end == std::string::npos) {
    throw std::invalid_argument("the document lacks the lines <!-- observer_table --kind " + kind +
                                " --> and <!-- end -->");
  }
  return document.substr(0, mark + begin.size()) + "\n" + tables + document.substr(end);
}

namespace {

struct RowColumn {
  std::string_view title;
  Value value;
};

std::optional<double> number(std::uint64_t count) { return static_cast<double>(count); }

// Of the filter or the smoother.
void add_estimator(std::vector<RowColumn>& columns, EstimatorQuality RecordingQuality::*estimator,
                   const std::vector<std::pair<std::string_view, Estimated>>& quantities) {
  for (const auto& [title, quantity] : quantities) {
    columns.push_back({title, [estimator, quantity = quantity](const RecordingQuality& each) {
                         return (each.*estimator).*quantity;
                       }});
  }
}

std::vector<RowColumn> row_columns() {
  using Of = EstimatorQuality;
  std::vector<RowColumn> out = {
      {"duration_s", [](const RecordingQuality& r) { return std::optional(r.duration_s); }},
      {"force_causal", [](const RecordingQuality& r) { return r.by_hand.causal.force; }},
      {"force_best", [](const RecordingQuality& r) { return r.by_hand.best.force; }},
      {"theta_best", [](const RecordingQuality& r) { return r.by_hand.best.theta; }},
      {"slip_best", [](const RecordingQuality& r) { return r.by_hand.best.slip; }}};
  add_estimator(out, filter,
                {{"force_filter", &Of::force},
                 {"theta_filter", &Of::theta},
                 {"slip_filter", &Of::slip},
                 {"force_coverage_filter", &Of::force_coverage},
                 {"mu_coverage_filter", &Of::mu_coverage},
                 {"load_coverage_filter", &Of::load_coverage},
                 {"nees_filter", &Of::nees},
                 {"auc_filter", &Of::auc}});
  add_estimator(out, smoother,
                {{"force_smoother", &Of::force},
                 {"theta_smoother", &Of::theta},
                 {"slip_smoother", &Of::slip},
                 {"force_coverage_smoother", &Of::force_coverage},
                 {"mu_coverage_smoother", &Of::mu_coverage},
                 {"load_coverage_smoother", &Of::load_coverage},
                 {"nees_smoother", &Of::nees},
                 {"auc_smoother", &Of::auc}});
  const auto of_explained = [](Explained Notice::*when, auto member) {
    return [=](const RecordingQuality& r) {
      return r.notice ? std::optional<double>((*r.notice).*when.*member) : std::nullopt;
    };
  };
  out.insert(
      out.end(),
      {{"good_share", [](const RecordingQuality& r) { return std::optional(r.filter.good_share); }},
       {"largest_theta_smoother",
        [](const RecordingQuality& r) { return std::optional(r.smoother.largest_theta); }},
       {"restarts", [](const RecordingQuality& r) { return number(r.filter.restarts); }},
       {"alarms", [](const RecordingQuality& r) { return number(r.alarms); }},
       {"first_alarm_s",
        [](const RecordingQuality& r) {
          return r.notice ? std::optional<double>(r.notice->after_s) : std::nullopt;
        }},
       {"certain_at_once", of_explained(&Notice::at_once, &Explained::certain)},
       {"right_at_once", of_explained(&Notice::at_once, &Explained::right)},
       {"probability_at_once", of_explained(&Notice::at_once, &Explained::probability)},
       {"certain_at_last", of_explained(&Notice::at_last, &Explained::certain)},
       {"right_at_last", of_explained(&Notice::at_last, &Explained::right)},
       {"probability_at_last", of_explained(&Notice::at_last, &Explained::probability)}});
  return out;
}

}  // namespace

std::string rows_of(const std::vector<RecordingQuality>& recordings) {
  const std::vector<RowColumn> columns = row_columns();
  std::string out = "name,world,effect";
  for (const RowColumn& column : columns) (out += ',') += column.title;
  out += ",unsupported\n";
  for (const RecordingQuality& each : recordings) {
    out += each.name + ',' + each.world + ',' + each.effect;
    for (const RowColumn& column : columns) {
      const std::optional<double> value = column.value(each);
      out += ',';
      if (value) out += text("%.4g", *value);
    }
    out += each.unsupported.empty() ? ",0\n" : ",1\n";
  }
  return out;
}

}  // namespace stickslip::quality
