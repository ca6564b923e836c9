// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/ground_truth.h"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "physics/problem.h"
#include "protocol/json_text.h"

namespace stickslip::concealment {

namespace {

using Json = nlohmann::ordered_json;

Json effect_json(const TrueEffect& effect) {
  Json json;
  json["id"] = effect.id;
  if (!effect.physics.empty()) json["physics"] = effect.physics;
  json["accept"] = effect.accept;
  json["relation"] = effect.relations;
  json["form"] = effect.form;
  json["channel"] = effect.channel ? Json(info(*effect.channel).stem) : Json(nullptr);
  json["when_s"] = Json(nullptr);
  for (const auto& [from, to] : effect.when_s) json["when_s"].push_back(Json::array({from, to}));
  json["parameters"] = Json::object();
  for (const auto& [name, p] : effect.parameters) {
    json["parameters"][name] = {{"value", p.value},
                                {"tolerance", p.tolerance},
                                {"reference", p.reference},
                                {"graded", p.graded},
                                {"sign_free", p.sign_free}};
  }
  if (!effect.depends_on.empty()) json["depends_on"] = effect.depends_on;
  json["snr"] = effect.snr;
  json["snr_after_calibration"] = effect.snr_after_calibration;
  return json;
}

TrueEffect effect_of(const Json& json) {
  TrueEffect effect;
  effect.id = json.at("id").get<std::string>();
  effect.physics = json.value("physics", "");
  effect.accept = json.at("accept").get<std::vector<std::string>>();
  effect.relations = json.at("relation").get<std::vector<std::string>>();
  effect.form = json.value("form", "");
  if (json.contains("channel") && json.at("channel").is_string()) {
    const auto stem = json.at("channel").get<std::string>();
    effect.channel = channel_named(stem);
    if (!effect.channel) throw std::invalid_argument("unknown channel \"" + stem + "\"");
  }
  if (json.contains("when_s") && json.at("when_s").is_array()) {
    for (const Json& span : json.at("when_s")) {
      effect.when_s.emplace_back(span.at(0).get<double>(), span.at(1).get<double>());
    }
  }
  for (const auto& [name, each] : json.at("parameters").items()) {
    TrueParameter p;
    // Parameters that the formula does not have may be null.
    if (each.at("value").is_number()) p.value = each.at("value").get<double>();
    p.tolerance = each.at("tolerance").get<double>();
    p.reference = each.at("reference").get<double>();
    p.graded = each.at("graded").get<bool>() && each.at("value").is_number();
    p.sign_free = each.at("sign_free").get<bool>();
    effect.parameters.emplace(name, p);
  }
  if (json.contains("depends_on") && json.at("depends_on").is_array()) {
    effect.depends_on = json.at("depends_on").get<std::vector<std::string>>();
  }
  effect.snr = json.value("snr", 0.0);
  effect.snr_after_calibration = json.value("snr_after_calibration", 0.0);
  return effect;
}

}  // namespace

std::string truth_text(const GroundTruth& truth) {
  Json json;
  json["schema"] = 1;
  json["name"] = truth.name;
  json["kind"] = truth.kind;
  json["world"] = truth.world;
  json["seed"] = truth.seed;
  json["attempt"] = truth.attempt;
  json["verdict"] = truth.verdict;
  json["duration_s"] = truth.duration_s;
  json["sample_rate_hz"] = truth.sample_rate_hz;
  json["slip_share"] = truth.slip_share;
  json["validation_graded"] = truth.validation_graded;
  json["effects"] = Json::array();
  for (const TrueEffect& effect : truth.effects) json["effects"].push_back(effect_json(effect));
  json["noise_std"] = truth.noise_std;
  json["noise_declared"] = truth.noise_declared;
  json["parameters"] = truth.parameters;
  if (!truth.nuisances.is_null()) json["nuisances"] = truth.nuisances;
  return protocol::json_text(json) + "\n";
}

GroundTruth read_truth(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(Problem{file.string(), 0, 0, "cannot be read"});
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  try {
    const Json json = Json::parse(text);
    if (json.at("schema").get<int>() != 1) {
      throw std::invalid_argument("schema is " + json.at("schema").dump() + ", expected 1");
    }
    GroundTruth truth;
    truth.name = json.at("name").get<std::string>();
    truth.kind = json.at("kind").get<std::string>();
    truth.world = json.value("world", "");
    truth.seed = json.value("seed", std::uint64_t{0});
    truth.verdict = json.at("verdict").get<std::string>();
    truth.duration_s = json.at("duration_s").get<double>();
    truth.sample_rate_hz = json.value("sample_rate_hz", 0.0);
    truth.validation_graded = json.value("validation_graded", true);
    truth.noise_declared = json.value("noise_declared", true);
    for (const Json& effect : json.at("effects")) truth.effects.push_back(effect_of(effect));
    truth.noise_std = json.value("noise_std", std::map<std::string, double>{});
    truth.parameters = json.value("parameters", std::map<std::string, double>{});
    if (json.contains("nuisances")) truth.nuisances = json.at("nuisances");
    return truth;
  } catch (const Json::parse_error& error) {
    throw InputError(Problem{
        file.string(), 0, 0,
        "is not a truth file: it is no JSON from byte " + std::to_string(error.byte) + " on"});
  } catch (const Json::exception&) {
    throw InputError(Problem{file.string(), 0, 0,
                             "is not a truth file: expected those keys and types that `stickslip "
                             "conceal` writes, among them schema, name, kind, verdict, duration_s "
                             "and effects"});
  } catch (const std::invalid_argument& error) {
    throw InputError(
        Problem{file.string(), 0, 0, std::string("is not a truth file: ") + error.what()});
  }
}

}  // namespace stickslip::concealment
