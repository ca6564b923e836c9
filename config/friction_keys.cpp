// SPDX-License-Identifier: Apache-2.0
// Keys of [friction]: the laws by name, and the parameters on the cards of those that have them.
#include "config/friction_keys.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <deque>
#include <stdexcept>
#include <string>
#include <utility>

#include "physics/friction_laws.h"

namespace stickslip::config {

namespace {

constexpr std::size_t most_parameters = 32;

/// A parameter of one or several laws.
struct LawParameter {
  const physics::ParameterCard* card = nullptr;
  bool required = false;
  std::string laws;  // "dahl|lugre"
};

void add(std::vector<LawParameter>& list, const physics::Card& law, std::size_t position) {
  const physics::ParameterCard& card = law.parameters[position];
  auto found = std::find_if(list.begin(), list.end(),
                            [&](const LawParameter& each) { return each.card->name == card.name; });
  if (found == list.end()) {
    // A transition speed of 0 is another kind of law: it is declared, not assumed.
    const bool required = !card.fixed_default || law.transition_speed == position;
    found = list.insert(list.end(), {&card, required, {}});
  }
  if (!found->laws.empty()) found->laws += '|';
  found->laws += law.id;
}

const std::vector<LawParameter>& law_parameters() {
  static const std::vector<LawParameter> parameters = [] {
    std::vector<LawParameter> list;
    for (const physics::Effect* law : physics::friction_laws()) {
      for (std::size_t i = 0; i < law->card().parameters.size(); ++i) add(list, law->card(), i);
    }
    if (list.size() > most_parameters) throw std::logic_error("laws: too many parameters");
    return list;
  }();
  return parameters;
}

// The name of a law makes its term, which its parameters are read into.
void read_law(physics::Model& model, std::size_t /*channel*/, const Value& value) {
  if (physics::find_law(value.text()) == nullptr) return;
  physics::Term term;
  term.id = value.text();
  term.law = true;
  model.terms.insert(model.terms.begin(), std::move(term));
}

template <std::size_t Index>
void read_parameter(physics::Model& model, std::size_t /*channel*/, const Value& value) {
  if (physics::law_term(model) == nullptr) return;
  model.terms.front().parameters[std::string(law_parameters()[Index].card->name)] =
      value.parameter();
}

template <std::size_t... Index>
constexpr auto readers_of(std::index_sequence<Index...> /*indices*/) {
  return std::array{+[](void* object, std::size_t channel, const Value& value) {
    read_parameter<Index>(*static_cast<physics::Model*>(object), channel, value);
  }...};
}

std::string sentence_of(const physics::ParameterCard& card) {
  std::string out(card.meaning);
  out.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(out.front())));
  return out + '.';
}

Key key_of(const LawParameter& parameter, std::size_t index, std::deque<std::string>& texts) {
  static constexpr auto readers = readers_of(std::make_index_sequence<most_parameters>());
  const physics::ParameterCard& card = *parameter.card;
  const auto kept = [&texts](std::string text) -> std::string_view {
    return texts.emplace_back(std::move(text));
  };
  Key key{.path = kept("friction." + std::string(card.name)),
          .unit = card.unit,
          .sentence = kept(sentence_of(card)),
          .need = parameter.required ? Need::in_table : Need::optional,
          .when = kept("friction.law=" + parameter.laws),
          .only_then = true,
          .type = Type::parameter,
          .assign = readers[index]};
  if (!parameter.required) key.without = kept(toml_number(*card.fixed_default));
  if (card.positive) key.low = 0.0;
  // Friction of 0 is none, in a law that needs no more than its level.
  const bool is_level = index == 0;
  key.above_low = card.positive && card.fixed_default != 0.0 && !is_level;
  return key;
}

std::vector<BoundKey<physics::Model>> made_keys() {
  static constexpr BoundKey<physics::Model> law = read_by<physics::Model, read_law>(
      Type::choice,
      Key{.path = "friction.law",
          .sentence =
              "Law of friction, f = mu N theta (docs/physics.md). Without [friction]: none.",
          .need = Need::in_table,
          .without = "none"});
  static std::deque<std::string> texts;
  static std::vector<std::string_view> names{"none"};
  for (const physics::Effect* each : physics::friction_laws()) names.push_back(each->card().id);
  std::vector<BoundKey<physics::Model>> keys{law};
  keys.front().choices = names;
  for (std::size_t i = 0; i < law_parameters().size(); ++i) {
    keys.push_back({key_of(law_parameters()[i], i, texts)});
  }
  return keys;
}

}  // namespace

std::span<const BoundKey<physics::Model>> friction_keys() {
  static const std::vector<BoundKey<physics::Model>> keys = made_keys();
  return keys;
}

}  // namespace stickslip::config
