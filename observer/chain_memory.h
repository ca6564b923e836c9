// The memory of a sensor chain, between the filter's states and physics::FilterMemory.
#pragma once

#include "observer/layout.h"
#include "physics/sensor_chain.h"

namespace stickslip::observer {

/// A chain's memory from the filter's states; what an input just was is not a state of its own.
template <class T>
void recall(physics::FilterMemory<T>& memory, const Chain& chain, const Vector& states,
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
void each_state(const Chain& chain, const physics::FilterChain& filters,
                const physics::FilterMemory<T>& memory, Visit visit) {
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
