#include "tools/command_line/program.h"

#include <stdexcept>
#include <utility>

namespace stickslip::command_line {

terminal::Notes Program::notes(const CLI::App& command) const {
  const auto found = notes_.find(&command);
  return found == notes_.end() ? terminal::Notes{} : found->second;
}

void Program::set_notes(const CLI::App& command, terminal::Notes notes) {
  notes_[&command] = std::move(notes);
}

Program& program_of(CLI::App& command) {
  CLI::App* root = &command;
  while (root->get_parent() != nullptr) root = root->get_parent();
  auto* const program = dynamic_cast<Program*>(root);
  if (program == nullptr) throw std::logic_error(command.get_name() + " belongs to no Program");
  return *program;
}

void describe(CLI::App& command, terminal::Notes notes) {
  program_of(command).set_notes(command, std::move(notes));
}

}  // namespace stickslip::command_line
