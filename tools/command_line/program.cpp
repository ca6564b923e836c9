// SPDX-License-Identifier: Apache-2.0
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

std::vector<FileOption> Program::file_options(const CLI::App& command) const {
  const auto found = file_options_.find(&command);
  return found == file_options_.end() ? std::vector<FileOption>{} : found->second;
}

void Program::add_file_option(const CLI::App& command, FileOption option) {
  file_options_[&command].push_back(option);
}

const Program& program_of(const CLI::App& command) {
  const CLI::App* root = &command;
  while (root->get_parent() != nullptr) root = root->get_parent();
  const auto* const program = dynamic_cast<const Program*>(root);
  if (program == nullptr) throw std::logic_error(command.get_name() + " belongs to no Program");
  return *program;
}

Program& program_of(CLI::App& command) {
  return const_cast<Program&>(program_of(std::as_const(command)));
}

std::string full_name(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return (parent == nullptr ? "" : full_name(*parent) + " ") + command.get_name();
}

void describe(CLI::App& command, terminal::Notes notes) {
  program_of(command).set_notes(command, std::move(notes));
}

}  // namespace stickslip::command_line
