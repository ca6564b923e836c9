// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/case_plan.h"

#include <algorithm>
#include <array>
#include <span>
#include <string_view>

namespace stickslip::concealment {

namespace {

bool contains(std::span<const BenchKind> kinds, BenchKind kind) {
  return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
}

// Effects that show in the same relation are not hidden together.
bool are_compatible(const HiddenEffect& a, const HiddenEffect& b) {
  constexpr std::array friction = {"stribeck", "dwell_strengthening", "contact_compliance",
                                   "friction_memory", "dry_friction"};
  const auto replaces_law = [&](const HiddenEffect& each) {
    return std::find(friction.begin(), friction.end(), each.id) != friction.end();
  };
  return a.id != b.id && !(replaces_law(a) && replaces_law(b)) && a.listed && b.listed &&
         a.requirements.lacks_friction == b.requirements.lacks_friction &&
         a.requirements.set_valued == b.requirements.set_valued;
}

CaseRequest::Kind draw_kind(const CaseRequest& request, RandomSource& random) {
  using Kind = CaseRequest::Kind;
  if (request.kind != Kind::any) return request.kind;
  const double u = random.uniform(0.0, 1.0);
  if (!request.ids.empty()) return Kind::single;
  return u < 0.13   ? Kind::nothing
         : u < 0.21 ? Kind::pair
         : u < 0.29 ? Kind::unlisted
                    : Kind::single;
}

std::vector<const HiddenEffect*> choices_of(const CaseRequest& request, CaseRequest::Kind kind) {
  std::vector<const HiddenEffect*> choices;
  for (const HiddenEffect& each : hidden_effects()) {
    const bool named =
        std::find(request.ids.begin(), request.ids.end(), each.id) != request.ids.end();
    if (!request.ids.empty() ? named : each.listed == (kind != CaseRequest::Kind::unlisted)) {
      choices.push_back(&each);
    }
  }
  return choices;
}

Plan plan_without_effects(RandomSource& random) {
  Plan plan;
  plan.kind = "null";
  plan.bench = all_bench_kinds[random.index(all_bench_kinds.size())];
  plan.requirements.lacks_friction = random.chance(0.5);
  plan.requirements.relaxes = random.chance(0.4);
  return plan;
}

bool is_compatible_with_all(const HiddenEffect& effect, const Plan& plan) {
  return contains(effect.benches, plan.bench) &&
         std::all_of(plan.effects.begin(), plan.effects.end(),
                     [&](const HiddenEffect* other) { return are_compatible(*other, effect); });
}

// Adds effects that go with those of the plan, until there are `count` or no further one does.
void add_effects(Plan& plan, std::size_t count, const std::vector<const HiddenEffect*>& choices,
                 RandomSource& random) {
  while (plan.effects.size() < count) {
    std::vector<const HiddenEffect*> further;
    for (const HiddenEffect* each : choices) {
      if (is_compatible_with_all(*each, plan)) further.push_back(each);
    }
    if (further.empty()) return;
    plan.effects.push_back(further[random.index(further.size())]);
    plan.kind = plan.effects.size() == 2 ? "pair" : "triple";
    plan.requirements.rings = plan.requirements.rings && plan.effects.back()->requirements.rings;
  }
}

std::size_t number_of_effects(CaseRequest::Kind kind) {
  return kind == CaseRequest::Kind::triple ? 3 : (kind == CaseRequest::Kind::pair ? 2 : 1);
}

}  // namespace

std::optional<Plan> draw_plan(const CaseRequest& request, RandomSource& random) {
  const CaseRequest::Kind kind = draw_kind(request, random);
  if (kind == CaseRequest::Kind::nothing) return plan_without_effects(random);
  const std::vector<const HiddenEffect*> choices = choices_of(request, kind);
  Plan plan;
  const HiddenEffect* first = choices[random.index(choices.size())];
  plan.effects.push_back(first);
  plan.bench = first->benches[random.index(first->benches.size())];
  plan.requirements = first->requirements;
  plan.kind = first->listed ? "single" : "unlisted";
  add_effects(plan, number_of_effects(kind), choices, random);
  // A pair with nothing to go with its first effect has remained a single since the first sets.
  if (kind == CaseRequest::Kind::triple && plan.effects.size() < 3) return std::nullopt;
  const bool replaces_memory =
      std::any_of(plan.effects.begin(), plan.effects.end(), [](const HiddenEffect* each) {
        return each->id == "friction_memory" || each->id == "contact_compliance" ||
               each->id == "dwell_strengthening";
      });
  if (!replaces_memory && !plan.requirements.set_valued) {
    plan.requirements.relaxes = random.chance(0.35);
  }
  if (plan.bench == BenchKind::force && !plan.requirements.lacks_friction) {
    plan.requirements.lacks_friction = random.chance(0.6);
  }
  return plan;
}

}  // namespace stickslip::concealment
