// SPDX-License-Identifier: Apache-2.0
// Conversion between filter states and physics::FilterMemory of a sensor chain.
#pragma once

#include "observer/layout.h"
#include "physics/sensor_chain.h"

namespace stickslip::observer {

/// Sets the memory of a chain from the filter's states. The chain's input, which is not a state of
/// the chain, is given.
template <class T>
void load_memory(physics::FilterMemory<T>& memory, const Chain& chain, const Vector& states,
                 const T& input, const T& input_rate) {
  memory.input = input;
  memory.input_rate = input_rate;
  T before = input;
  int next = chain.first;
  for (std::size_t i = 0; i < chain.sections.size(); ++i) {
    const Section& section = chain.sections[i];
    const T output(states[next++]);
    memory.section[i][0] = output;
    memory.section[i][1] =
        section.second_order ? T(states[next++]) : T((before - output) * section.omega);
    before = output;
  }
}

/// Calls visit(state index, value) for every state of a chain.
template <class T, class Visit>
void for_each_state(const Chain& chain, const physics::FilterChain& filters,
                    const physics::FilterMemory<T>& memory, Visit visit) {
  if (chain.count == 0) return;
  if (chain.sections.empty()) {
    visit(chain.reading, filters.output(memory));
    return;
  }
  int next = chain.first;
  for (std::size_t i = 0; i < chain.sections.size(); ++i) {
    visit(next++, memory.section[i][0]);
    if (chain.sections[i].second_order) visit(next++, memory.section[i][1]);
  }
}

}  // namespace stickslip::observer
