// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/effects_page.h"

#include <algorithm>
#include <string_view>
#include <vector>

#include "diagnosis/report/effect_picture.h"
#include "diagnosis/report/formatting.h"
#include "physics/catalogue.h"
#include "physics/friction_laws.h"
#include "physics/number_text.h"

namespace stickslip::report {

namespace {

using physics::Card;
using physics::Effect;
using physics::ParameterCard;

constexpr std::size_t page_columns = 108;

// Text broken at blanks, every line preceded by `indent`, the first by `first`.
std::string wrapped(std::string_view text, std::size_t columns, std::string_view first,
                    std::string_view indent) {
  std::string out(first);
  std::size_t column = first.size();
  bool begun = false;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(' '));
    if (begun && column + 1 + word.size() > columns) {
      out.append("\n").append(indent);
      column = indent.size();
      begun = false;
    }
    if (begun) out += ' ';
    out.append(word);
    column += word.size() + (begun ? 1 : 0);
    begun = true;
    text.remove_prefix(std::min(text.size(), word.size() + 1));
  }
  return out + '\n';
}

std::string words_of(std::string_view name) {
  std::string out(name);
  std::replace(out.begin(), out.end(), '_', ' ');
  return out;
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

// "friction law", "sensor: displacement, velocity", "force balance, over displacement"
std::string place_text(const Effect& effect) {
  const Card& card = effect.card();
  std::string out = words_of(physics::name_of(card.relation));
  std::vector<std::string> names;
  if (card.relation == physics::Relation::sensor) {
    for (const Channel channel : all_channels) {
      const bool alone = effect.acts_on({channel, {}});
      const bool from_another =
          std::any_of(all_channels.begin(), all_channels.end(), [&](Channel from) {
            return effect.acts_on({channel, from});
          });
      if (alone || from_another) names.push_back(channel_name(channel));
    }
    return out + " of " + joined(names);
  }
  for (const std::string_view stem : card.depends_on) names.push_back(words_of(stem));
  return names.empty() ? out : out + ", over " + joined(names);
}

std::string tier_text(const Card& card) {
  switch (card.tier) {
    case physics::Tier::listed:
      return "listed, reported as `" + std::string(card.id) + "`";
    case physics::Tier::formula:
      return "formula, reported as `unlisted`; the listed effects are preferred to it";
    case physics::Tier::free_form:
      return "free form, reported as `unlisted`; every formula is preferred to it";
  }
  return "";
}

std::string unit_of(const ParameterCard& parameter) {
  return parameter.unit == "1" ? "1" : unit_text(parameter.unit, {}, physics::ResultUnits({}));
}

std::string range_of(const ParameterCard& parameter) {
  return physics::number_text(parameter.low, 6) + " to " + physics::number_text(parameter.high, 6);
}

// "estimated", "estimated; 0 if absent", "fixed; 1 if absent"
std::string treatment_of(const ParameterCard& parameter) {
  if (!parameter.fixed_default) return "estimated";
  const std::string value = physics::number_text(*parameter.fixed_default, 6);
  return (parameter.estimated ? "estimated; " : "fixed; ") + value + " if absent";
}

std::string link_to(const std::string& id) {
  std::string out = "[`";
  return out.append(id).append("`](#").append(id).append(")");
}

std::vector<std::string> rivals_of(const Card& card, bool linked) {
  std::vector<std::string> out;
  for (const std::string_view rival : card.rivals) {
    const std::string id(rival);
    out.push_back(linked ? link_to(id) : id);
  }
  return out;
}

std::string section_of(const Effect& effect) {
  const Card& card = effect.card();
  const std::string id(card.id);
  std::string out = "\n### " + id + "\n\n";
  out += wrapped("**" + std::string(card.name) + ".** " + std::string(card.sentence), page_columns,
                 "", "");
  out += '\n';
  out += wrapped(card.equation, page_columns, "    ", "    ") + '\n';
  if (!card.example.empty()) {
    std::vector<std::string> values;
    for (std::size_t i = 0; i < card.parameters.size(); ++i) {
      if (card.parameters[i].fixed_default == card.example[i]) continue;
      values.push_back(std::string(card.parameters[i].name) + " = " +
                       physics::number_text(card.example[i], 6));
    }
    out += "![" + id + "](effects/" + id + ".svg)\n\n";
    out += wrapped("Drawn with " + joined(values) + ".", page_columns, "", "") + "\n";
  }
  out += "| parameter | unit | meaning | range | value |\n| --- | --- | --- | --- | --- |\n";
  for (const ParameterCard& parameter : card.parameters) {
    out += "| `" + std::string(parameter.name) + "` | " + unit_of(parameter) + " | " +
           std::string(parameter.meaning) + " | " + range_of(parameter) + " | " +
           treatment_of(parameter) + " |\n";
  }
  out += '\n';
  out += wrapped("Acts on: " + place_text(effect) + ".", page_columns, "- ", "  ");
  out += wrapped("Tier: " + tier_text(card) + ".", page_columns, "- ", "  ");
  out += wrapped("Shown best by: " + std::string(card.experiment) + ".", page_columns, "- ", "  ");
  if (!card.rivals.empty()) {
    out += wrapped("Resembles, in a poor recording: " + joined(rivals_of(card, true)) + ".",
                   page_columns, "- ", "  ");
  }
  for (const std::string_view reference : card.references) {
    out += wrapped("Reference: " + std::string(reference) + ".", page_columns, "- ", "  ");
  }
  return out;
}

constexpr std::string_view introduction = R"(# The catalogue of effects

`stickslip effects --markdown` prints this page from the entries in `physics/effects/`, and
`stickslip effects ID` one of them. Ids and parameter names of the listed effects are
[fixed](formats.md#6-catalogue-of-effects); symbols and signs are those of
[formats.md](formats.md#1-equations-and-signs); how a diagnosis chooses among effects is in
[diagnosis.md](diagnosis.md).

A `[[physics]]` table of a model with `id` and these parameters adds an effect to it. "estimated":
a diagnosis fits the parameter; "fixed": it takes the default or what the recording suggests.
Ranges limit what is plausible on a bench like the paper's. Pictures are drawn as in a report: the
law of the effect, or where it is no function of one quantity, a loop or a reading with and without
it. A law of friction by name is not an effect: [physics.md](physics.md#laws-of-friction-by-name) has
them all, and `stickslip effects lugre` explains one.
)";

}  // namespace

std::string effects_list() {
  std::size_t width = 0;
  for (const Effect* effect : physics::catalogue())
    width = std::max(width, effect->card().id.size());
  const auto line = [width](const Effect* effect) {
    std::string id(effect->card().id);
    id.resize(width + 2, ' ');
    return id + std::string(effect->card().name) + "\n";
  };
  std::string out;
  for (const Effect* effect : physics::catalogue()) out += line(effect);
  out += "\nLaws of friction, for law = \"...\" in [friction] of a model:\n\n";
  for (const Effect* law : physics::friction_laws()) out += line(law);
  return out;
}

std::string effect_text(const Effect& effect, std::size_t columns) {
  const Card& card = effect.card();
  const auto part = [columns](const std::string& heading, std::string_view text) {
    std::string lines = "\n";
    return lines.append(heading).append("\n").append(wrapped(text, columns, "  ", "  "));
  };
  std::string out = std::string(card.id) + ": " + std::string(card.name) + "\n\n";
  out += wrapped(card.sentence, columns, "", "");
  out += part("Formula", card.equation);
  out += "\nParameters\n";
  for (const ParameterCard& parameter : card.parameters) {
    const std::string name = std::string(parameter.name) + " [" + unit_of(parameter) + "]";
    out += wrapped(name + ": " + std::string(parameter.meaning) + "; " + range_of(parameter) +
                       "; " + treatment_of(parameter),
                   columns, "  ", "    ");
  }
  out += part("Acts on", place_text(effect));
  if (card.law) {
    out += part("Declared as", "[friction] law = \"" + std::string(card.id) + "\"");
  } else {
    out += part("Tier", tier_text(card));
  }
  out += part("Shown best by", card.experiment);
  if (!card.rivals.empty())
    out += part("Resembles, in a poor recording", joined(rivals_of(card, false)));
  if (!card.references.empty()) {
    out += "\nReferences\n";
    for (const std::string_view reference : card.references) {
      out += wrapped(reference, columns, "  ", "    ");
    }
  }
  return out;
}

namespace {

std::string links_to(physics::Tier tier) {
  std::vector<std::string> links;
  for (const Effect* effect : physics::catalogue()) {
    if (effect->card().tier == tier) links.push_back(link_to(std::string(effect->card().id)));
  }
  return wrapped(joined(links) + ".", page_columns, "", "");
}

}  // namespace

std::string effects_page() {
  std::string out(introduction);
  constexpr std::string_view headings[] = {"Listed effects", "Formulas", "Free forms"};
  const Card* former = nullptr;
  for (const Effect* effect : physics::catalogue()) {
    const Card& card = effect->card();
    if (former == nullptr || former->tier != card.tier) {
      out.append("\n## ").append(headings[static_cast<std::size_t>(card.tier)]).append("\n\n");
      out += links_to(card.tier);
    }
    out += section_of(*effect);
    former = &card;
  }
  return out;
}

}  // namespace stickslip::report
