// SPDX-License-Identifier: Apache-2.0
#include "tools/investigation/study.h"

#include <fstream>
#include <nlohmann/json.hpp>

#include "physics/problem.h"
#include "protocol/json_text.h"
#include "tools/files/read_file.h"

namespace stickslip::investigation {

namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
constexpr int schema = 1;

// A range without an end is left out.
ordered_json ranges_json(const design::MotionRanges& ranges) {
  ordered_json out = ordered_json::object();
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    ordered_json each = ordered_json::object();
    if (std::isfinite(ranges.low[c])) each["low"] = ranges.low[c];
    if (std::isfinite(ranges.high[c])) each["high"] = ranges.high[c];
    if (!each.empty()) out[std::string(info(channel).stem)] = each;
  }
  return out;
}

ordered_json facts_json(const RigFacts& facts) {
  ordered_json limits = {{"value", facts.limits.value}, {"first", facts.limits.first}};
  if (std::isfinite(facts.limits.second)) limits["second"] = facts.limits.second;
  return {{"name", facts.name},
          {"drive", facts.force ? "force" : "base"},
          {"rate_hz", facts.rate_hz},
          {"limits", limits},
          {"ranges", ranges_json(facts.ranges)},
          {"displacement_range_assumed", facts.displacement_range_assumed}};
}

RigFacts facts_from(const ordered_json& in) {
  RigFacts out;
  out.name = in.at("name");
  out.force = in.at("drive") == "force";
  out.rate_hz = in.at("rate_hz");
  const ordered_json& limits = in.at("limits");
  out.limits = {limits.at("value"), limits.at("first"),
                limits.value("second", std::numeric_limits<double>::infinity())};
  for (const auto& [stem, range] : in.at("ranges").items()) {
    const auto channel = channel_named(stem);
    if (!channel) continue;
    const std::size_t c = index_of(*channel);
    out.ranges.low[c] = range.value("low", out.ranges.low[c]);
    out.ranges.high[c] = range.value("high", out.ranges.high[c]);
  }
  out.displacement_range_assumed = in.at("displacement_range_assumed");
  return out;
}

ordered_json question_json(const Question& q) {
  ordered_json expected = ordered_json::array();
  for (const Expected& each : q.expected) {
    expected.push_back(
        {{"truth", each.truth}, {"other", each.other}, {"nats", each.nats}, {"error", each.error}});
  }
  return {
      {"words", q.words},
      {"family", design::name_of(q.plan.family)},
      {"amplitude", q.plan.amplitude},
      {"duration", q.plan.duration},
      {"shape", q.plan.shape},
      {"duration_s", q.duration_s},
      {"peaks", {{"value", q.peaks.value}, {"first", q.peaks.first}, {"second", q.peaks.second}}},
      {"lowest", q.extent.lowest},
      {"highest", q.extent.highest},
      {"factor", q.factor},
      {"gain", q.gain},
      {"evaluations", q.evaluations},
      {"expected", expected}};
}

design::Family family_from(const std::string& name) {
  for (const design::Family each : design::all_families) {
    if (design::name_of(each) == name) return each;
  }
  return design::Family::modulated;
}

Question question_from(const ordered_json& in) {
  Question out;
  out.words = in.at("words");
  out.plan = {family_from(in.at("family")), in.at("amplitude"), in.at("duration"), in.at("shape")};
  out.duration_s = in.at("duration_s");
  const ordered_json& peaks = in.at("peaks");
  out.peaks = {peaks.at("value"), peaks.at("first"), peaks.at("second")};
  out.extent.lowest = in.at("lowest");
  out.extent.highest = in.at("highest");
  out.factor = in.at("factor");
  out.gain = in.at("gain");
  out.evaluations = in.at("evaluations");
  for (const ordered_json& each : in.at("expected")) {
    out.expected.push_back({each.at("truth"), each.at("other"), each.at("nats"), each.at("error")});
  }
  return out;
}

ordered_json step_json(const Step& step) {
  ordered_json out = {{"name", step.name},
                      {"question", question_json(step.question)},
                      {"recording_sha256", step.recording_sha256},
                      {"answered", step.answered}};
  if (!step.answered) return out;
  out["verdict"] = step.verdict;
  out["partial"] = step.partial;
  out["chi2_per_sample"] = step.chi2;
  out["findings"] = step.findings;
  out["least_probability"] = step.least_probability;
  out["hypotheses"] = ordered_json::array();
  for (const Standing& each : step.standing) {
    out["hypotheses"].push_back({{"id", each.id},
                                 {"name", each.name},
                                 {"statement", each.statement},
                                 {"probability", each.probability}});
  }
  return out;
}

Step step_from(const ordered_json& in) {
  Step out;
  out.name = in.at("name");
  out.question = question_from(in.at("question"));
  out.recording_sha256 = in.at("recording_sha256");
  out.answered = in.at("answered");
  if (!out.answered) return out;
  out.verdict = in.at("verdict");
  out.partial = in.value("partial", false);
  out.chi2 = in.at("chi2_per_sample");
  out.findings = in.at("findings").get<std::vector<std::string>>();
  out.least_probability = in.at("least_probability");
  for (const ordered_json& each : in.at("hypotheses")) {
    out.standing.push_back(
        {each.at("id"), each.at("name"), each.at("statement"), each.at("probability")});
  }
  return out;
}

Ending ending_from(const std::string& name) {
  for (const Ending each : {Ending::named, Ending::no_gain, Ending::budget, Ending::declined}) {
    if (name_of(each) == name) return each;
  }
  return Ending::open;
}

ordered_json settings_json(const StudySettings& s) {
  return {{"budget_s", s.budget_s},     {"certain", s.certain},
          {"least_gain", s.least_gain}, {"evaluations", s.evaluations},
          {"shortest_s", s.shortest_s}, {"longest_s", s.longest_s},
          {"overhead_s", s.overhead_s}, {"seed", s.seed},
          {"usual_runs", s.usual_runs}};
}

StudySettings settings_from(const ordered_json& in) {
  return {in.at("budget_s"),    in.at("certain"),    in.at("least_gain"),
          in.at("evaluations"), in.at("shortest_s"), in.at("longest_s"),
          in.at("overhead_s"),  in.at("seed"),       in.value("usual_runs", false)};
}

}  // namespace

std::string_view name_of(Ending ending) {
  switch (ending) {
    case Ending::open:
      return "open";
    case Ending::named:
      return "named";
    case Ending::no_gain:
      return "no_gain";
    case Ending::budget:
      return "budget";
    case Ending::declined:
      return "declined";
  }
  return "";
}

double Study::rig_time_s() const {
  double out = 0.0;
  for (const Step& step : steps) out += step.question.duration_s + settings.overhead_s;
  return out;
}

fs::path json_file(const fs::path& folder) { return folder / "study.json"; }
fs::path model_file(const fs::path& folder) { return folder / "model.toml"; }
fs::path recording_file(const fs::path& folder, const Step& step) {
  return folder / step.name / "recording.csv";
}

std::string study_text(const Study& study) {
  ordered_json out = {{"schema", schema},
                      {"rig", facts_json(study.facts)},
                      {"model_sha256", study.model_sha256},
                      {"settings", settings_json(study.settings)},
                      {"rig_time_s", study.rig_time_s()},
                      {"ending", name_of(study.ending)},
                      {"ending_words", study.ending_words},
                      {"runs", ordered_json::array()}};
  for (const Step& step : study.steps) out["runs"].push_back(step_json(step));
  return protocol::json_text(out) + "\n";
}

Study read_study(const fs::path& folder) {
  const fs::path file = json_file(folder);
  const std::string text = files::content_of(file);
  try {
    const ordered_json in = ordered_json::parse(text);
    Study out;
    out.facts = facts_from(in.at("rig"));
    out.rig = out.facts.name;
    out.model_sha256 = in.at("model_sha256");
    out.settings = settings_from(in.at("settings"));
    out.ending = ending_from(in.at("ending"));
    out.ending_words = in.at("ending_words");
    for (const ordered_json& each : in.at("runs")) out.steps.push_back(step_from(each));
    return out;
  } catch (const nlohmann::json::exception& error) {
    throw InputError(
        Problem{file.string(), 0, 0, std::string("is no study of this version: ") + error.what()});
  }
}

void write_whole(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  const fs::path part = file.string() + ".part";
  std::ofstream out(part, std::ios::binary);
  out << text;
  out.close();
  std::error_code error;
  if (out) fs::rename(part, file, error);
  if (!out || error) {
    throw InputError(Problem{file.string(), 0, 0,
                             "cannot be written; is the folder writable, and the disk not full?"});
  }
}

void save(const Study& study, const fs::path& folder) {
  write_whole(json_file(folder), study_text(study));
}

}  // namespace stickslip::investigation
