// SPDX-License-Identifier: Apache-2.0
#include "config/settings.h"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <optional>
#include <utility>

#include "config/document.h"
#include "config/toml_text.h"
#include "physics/frame.h"

namespace stickslip::config {

namespace {

/// Inverse of toml_string().
std::string unquoted(std::string_view text) {
  if (text.size() < 2 || text.front() != '"') return std::string(text);
  std::string out;
  for (std::size_t i = 1; i + 1 < text.size(); ++i) {
    if (text[i] != '\\') {
      out += text[i];
    } else if (text[i + 1] == 'u') {
      unsigned code = 0;
      std::from_chars(text.data() + i + 2, text.data() + i + 6, code, 16);
      out += static_cast<char>(code);
      i += 5;
    } else {
      out += text[++i];
    }
  }
  return out;
}

/// False if the other keys of the rig exclude this one. `before`: settings of the keys before it in
/// the table, which include those of its condition.
bool has_meaning(const Key& key, const std::vector<Setting>& before) {
  if (!key.only_then) return true;
  const auto equals = key.when.find('=');
  const std::string value = plain_text(before, key.when.substr(0, equals));
  const auto wanted = alternatives_in(key.when.substr(equals + 1));
  return std::find(wanted.begin(), wanted.end(), value) != wanted.end();
}

std::string shown(const Setting& setting) {
  if (!setting.value.empty()) return setting.value;
  return setting.words.empty() ? "not set" : setting.words;
}

}  // namespace

std::vector<Setting> settings_of(const Rig& rig) {
  const Document document(rig.text, rig.file.string(), rig_keys());
  std::vector<Setting> out;
  for (const Key& key : rig_keys()) {
    for (std::string& path : paths_of(key)) {
      Setting setting;
      setting.key = &key;
      setting.path = std::move(path);
      const std::optional<Stated> stated = document.stated(setting.path);
      if (stated) {
        setting.value = stated->text;
        setting.line = stated->line;
        setting.column = stated->column;
      } else if (!has_meaning(key, out)) {
        setting.words = "only with " + std::string(key.when);
      } else if (const Setting* same = find_setting(out, key.without)) {
        setting.value = same->value;  // the default is the value of another key
      } else {
        setting.value = default_value(key);
        if (setting.value.empty()) setting.words = absence_of(key);
      }
      if (stated && key.type == Type::file) {
        const std::filesystem::path named = unquoted(setting.value);
        const auto resolved =
            named.is_absolute() ? named : (rig.file.parent_path() / named).lexically_normal();
        setting.value = toml_string(resolved.string());
      }
      out.push_back(std::move(setting));
    }
  }
  return out;
}

const Setting* find_setting(const std::vector<Setting>& settings, std::string_view path) {
  const auto at = std::find_if(settings.begin(), settings.end(),
                               [path](const Setting& each) { return each.path == path; });
  return at == settings.end() ? nullptr : &*at;
}

std::string plain_text(const std::vector<Setting>& settings, std::string_view path) {
  const Setting* setting = find_setting(settings, path);
  return setting == nullptr ? std::string() : unquoted(setting->value);
}

std::vector<Change> changes(const Rig& before, const Rig& after) {
  const std::vector<Setting> old_settings = settings_of(before);
  const std::vector<Setting> new_settings = settings_of(after);
  std::vector<Change> out;
  for (std::size_t i = 0; i < old_settings.size(); ++i) {
    const Setting& was = old_settings[i];
    const Setting& is = new_settings[i];
    const bool model = was.path == "rig.model" && !(before.model == after.model);
    const bool truth =
        was.path == "driver.simulated.truth" && !(before.simulated.truth == after.simulated.truth);
    const bool calibration =
        was.path == "calibration.file" && before.calibration_text != after.calibration_text;
    if (shown(was) != shown(is)) {
      out.push_back({was.path, shown(was), shown(is), was.key->live});
    } else if (model || truth || calibration) {
      out.push_back({was.path, shown(was), shown(is) + " with other contents", was.key->live});
    }
  }
  return out;
}

std::string text(const Change& change) {
  return change.key + ": " + change.before + " -> " + change.after +
         (change.live ? "" : ", needs a restart");
}

}  // namespace stickslip::config
