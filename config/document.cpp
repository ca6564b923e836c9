// SPDX-License-Identifier: Apache-2.0
#include "config/document.h"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>
#include <utility>

#include "config/key_binding.h"
#include "config/toml_nodes.h"
#include "config/validation.h"
#include "config/value.h"

namespace stickslip::config {

namespace {

constexpr std::uintmax_t largest_file = 1U << 20U;

}  // namespace

std::string read_text(const std::filesystem::path& file) {
  const auto refuse = [&file](const std::string& why) -> InputError {
    return InputError(Problem{file.string(), 0, 0, why});
  };
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status)) throw refuse("there is no such file");
  if (std::filesystem::is_directory(status)) throw refuse("is a folder, expected a TOML file");
  if (std::filesystem::is_regular_file(status) &&
      std::filesystem::file_size(file, error) > largest_file) {
    throw refuse("is larger than 1 MiB: expected a rig, a model or a fault script in TOML");
  }
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw refuse(std::string("cannot be read: ") + std::strerror(errno));
  std::string text;
  std::array<char, 1U << 14U> block{};
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > largest_file) {
      throw refuse("is larger than 1 MiB: expected a rig, a model or a fault script in TOML");
    }
  }
  if (stream.bad()) throw refuse(std::string("cannot be read: ") + std::strerror(errno));
  return text;
}

struct Document::Contents {
  toml::table root;
};

Document::Document(std::string_view text, std::string name, std::span<const Key> keys)
    : name_(std::move(name)),
      folder_(std::filesystem::path(name_).parent_path()),
      keys_(keys),
      contents_(std::make_unique<Contents>()) {
  try {
    contents_->root = toml::parse(text, name_);
  } catch (const toml::parse_error& error) {
    const Place place = place_of(error.source());
    problems_.push_back({name_, place.line, place.column,
                         one_line("is not valid TOML: " + std::string(error.description()))});
    return;
  }
  validate(contents_->root, keys_, name_, problems_);
}

Document::~Document() = default;
Document::Document(Document&&) noexcept = default;
Document& Document::operator=(Document&&) noexcept = default;

const void* Document::term_node(std::string_view path) const {
  const std::string_view terms = path.substr(0, path.find('.') + 1);
  const std::string_view id =
      path.substr(terms.size(), path.find('.', terms.size()) - terms.size());
  const toml::array* list = contents_->root[terms.substr(0, terms.size() - 1)].as_array();
  if (list == nullptr) return nullptr;
  const toml::node* found = nullptr;
  for (const toml::node& each : *list) {
    const toml::table& term = *each.as_table();
    if (term["id"].value<std::string_view>() != id) continue;
    // An effect on channels has one table for each: the channel follows the id in the path.
    const auto channel = term["channel"].value<std::string_view>();
    const std::string_view after = path.substr(std::min(terms.size() + id.size() + 1, path.size()));
    if (found != nullptr && channel && !after.starts_with(*channel)) continue;
    const toml::node* value = term.get(last_name(path));
    if (value == nullptr) value = node_at(term, "parameters." + std::string(last_name(path)));
    found = value != nullptr ? value : &each;
  }
  return found;
}

void Document::report(std::string_view path, const std::string& message) {
  problems_.push_back(problem_near(path, message));
}

void Document::warn(std::string_view path, const std::string& message) {
  warnings_.push_back(problem_near(path, message));
}

Problem Document::problem_near(std::string_view path, const std::string& message) const {
  const void* found = nullptr;
  if (path.starts_with("physics.") || path.starts_with("candidate.")) {
    found = term_node(path);
  } else {
    for (auto rest = path; found == nullptr && !rest.empty(); rest = parent_of(rest)) {
      const toml::node* node = node_at(contents_->root, rest);
      if (node != nullptr && node->source().begin.line > 0) found = node;
    }
  }
  return problem_at(found, std::string(path) + ": " + message);
}

void Document::report_fault(std::size_t position, std::string_view key,
                            const std::string& message) {
  const toml::table& fault = *contents_->root["fault"].as_array()->get(position)->as_table();
  const toml::node* value = fault.get(key);
  problems_.push_back(problem_at(value != nullptr ? value : &fault,
                                 joined_path(fault_label(fault), key) + ": " + message));
}

Problem Document::problem_at(const void* node, const std::string& message) const {
  const Place place =
      node != nullptr ? place_of(static_cast<const toml::node*>(node)->source()) : Place{1, 1};
  return {name_, place.line, place.column, one_line(message)};
}

void Document::add(const std::vector<Problem>& problems) {
  problems_.insert(problems_.end(), problems.begin(), problems.end());
}

std::vector<Problem> Document::take_problems() {
  std::vector<Problem> out = std::exchange(problems_, {});
  // Those of this file first, by place; those of other files in their own order.
  std::stable_sort(out.begin(), out.end(), [this](const Problem& a, const Problem& b) {
    const bool foreign_a = a.file != name_;
    const bool foreign_b = b.file != name_;
    if (foreign_a || foreign_b) return foreign_a < foreign_b;
    return std::pair(a.line, a.column) < std::pair(b.line, b.column);
  });
  return out;
}

bool Document::has(std::string_view path) const {
  return node_at(contents_->root, path) != nullptr;
}

std::optional<Stated> Document::stated(std::string_view path) const {
  const toml::node* node = node_at(contents_->root, path);
  const Key* key = find_key(keys_, path);
  if (node == nullptr || key == nullptr) return std::nullopt;
  const Place place = place_of(node->source());
  return Stated{toml_text(*node, key->type == Type::integer), place.line, place.column};
}

std::optional<std::string> Document::text(std::string_view path) const {
  const toml::node* node = node_at(contents_->root, path);
  return node != nullptr ? node->value_exact<std::string>() : std::nullopt;
}

std::filesystem::path Document::file_at(std::string_view path) const {
  const toml::node* node = node_at(contents_->root, path);
  return node != nullptr ? Value(node, folder_).path() : std::filesystem::path();
}

std::vector<NamedFile> Document::named_files() const {
  std::vector<NamedFile> out;
  const auto add = [&](const Key& key, const std::string& path) {
    std::filesystem::path file = file_at(path);
    if (!file.empty()) out.push_back({path, std::move(file), key.written});
  };
  for (const Key& key : keys_) {
    const std::string path(key.path);
    if (key.type == Type::file) add(key, path);
    if (key.type != Type::tables) continue;
    for (std::size_t i = 0; has(path + '.' + std::to_string(i)); ++i) {
      for (const Key& column : key.columns()) {
        const std::string at = path + '.' + std::to_string(i) + '.' + std::string(column.path);
        if (column.type == Type::file) add(column, at);
      }
    }
  }
  return out;
}

void Document::read_into(std::span<const Key> keys, void* object) const {
  const toml::node& root = contents_->root;
  read_keys(keys, Value(&root, folder_), object);
}

}  // namespace stickslip::config
