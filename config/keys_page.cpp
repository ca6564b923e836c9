// SPDX-License-Identifier: Apache-2.0
// docs/configuration.md, from the tables of keys.
#include <sstream>
#include <string>

#include "config/key.h"
#include "config/key_tables.h"

namespace stickslip::config {

namespace {

/// Part of the page: text, and the table of keys that follows it.
struct Section {
  std::string_view text;
  std::span<const Key> keys;
  bool live = false;  ///< with a column for the keys that a running daemon applies
};

constexpr std::string_view introduction = R"(# Configuration

`stickslip check --keys` prints this page from the table that files are validated against.

`stickslip check FILE...` reports every problem of a rig, a model, a fault script, a calibration, a
register map or a campaign, with line and column and without a daemon. Files are TOML. An unknown key is an
error, so that no misspelling goes unnoticed. CHANNEL stands for `displacement`, `velocity`,
`friction_force`, `normal_load`, `base_displacement` or `drive_force`. Paths are relative to the
file that names them.
)";

constexpr std::string_view rigs = R"(
## Rigs

Read by `stickslipd --config`; example: [`config/simulated.toml`](../config/simulated.toml).
`stickslip config RIG.toml --explain` prints the value of each key of a rig and its origin. Live: a
running daemon applies a new value when it reloads its file (`SIGHUP`); the other keys need a
restart, which it reports.

)";

constexpr std::string_view register_maps = R"(
## Register maps

Named by `map` of a Modbus unit; [`config/modbus/`](../config/modbus) holds
[some](hardware/modbus-lvdt.md#included-maps).

)";

constexpr std::string_view models = R"(
## Models

The assumed physics of a rig, as in
[`config/models/simulated.toml`](../config/models/simulated.toml). A parameter that is a plain
number is known exactly; `{ value = 0.06, sigma = 0.0006 }` has that standard deviation and is
calibrated on a recording before any effect is reported missing.

)";

constexpr std::string_view formulas = R"(
A `[[physics]]` table with a formula of your own, and each `[[candidate]]` table, of a model or of a
file for `stickslip diagnose --candidates`, as described in [formulas.md](formulas.md):

)";

constexpr std::string_view campaigns = R"(
## Campaigns

Read by `stickslip diagnose --campaign`; [campaigns.md](campaigns.md) describes them.

)";

constexpr std::string_view fault_scripts = R"(
## Fault scripts

Named by `driver.faults`; [`config/faults/`](../config/faults) holds one for each kind of fault, and
[faults.md](faults.md) describes them.

)";

constexpr std::string_view calibrations = R"(
## Calibrations

Named by `calibration.file` of a rig, as in
[`config/calibrations/beam.toml`](../config/calibrations/beam.toml);
[calibration.md](calibration.md) describes how to make one.

)";

void write(std::ostringstream& page, const Section& section) {
  const bool live = section.live;
  page << section.text << "| key | type | unit | range | default |" << (live ? " live |" : "")
       << " meaning |\n"
       << "| --- | --- | --- | --- | --- |" << (live ? " --- |" : "") << " --- |\n";
  for (const Key& key : section.keys) {
    std::string path(key.path);
    const auto star = path.find('*');
    if (star != std::string::npos) path.replace(star, 1, "CHANNEL");
    page << "| `" << path << "` | " << name_of(key.type) << " | " << key.unit << " | "
         << range_of(key) << " | " << absence_of(key) << " | ";
    if (live) page << (key.live ? "yes" : "") << " | ";
    page << key.sentence << " |\n";
  }
}

}  // namespace

std::string keys_page() {
  std::ostringstream page;
  page << introduction;
  for (const Section& section : {
           Section{rigs, keys_of<Rig>(), true},
           Section{"\nEach `[[modbus]]` table:\n\n", keys_of<ModbusUnit>()},
           Section{"\nEach `[[gauge]]` table:\n\n", keys_of<GaugeAt>()},
           Section{register_maps, keys_of<ModbusMap>()},
           Section{"\nEach `[[register]]` table:\n\n", keys_of<ModbusRegister>()},
           Section{models, keys_of<physics::Model>()},
           Section{"\nEach filter of `filters`:\n\n", keys_of<physics::Filter>()},
           Section{"\nEach `[[physics]]` table:\n\n", keys_of<physics::Term>()},
           Section{formulas, keys_of<physics::FormulaDeclaration>()},
           Section{campaigns, keys_of<CampaignFile>()},
           Section{"\nEach `[[recording]]` table:\n\n", keys_of<CampaignRecording>()},
           Section{"\nEach `[[number]]` table:\n\n", keys_of<physics::SharedNumber>()},
           Section{fault_scripts, keys_of<FaultScript>()},
           Section{"\nEach `[[fault]]` table:\n\n", keys_of<Fault>()},
           Section{"\nIts `amount`, by kind; channels are in the device's own units, before "
                   "calibration:\n\n",
                   fault_amount_keys()},
           Section{calibrations, keys_of<CalibrationFile>()},
           Section{"\nEach `[channel.CHANNEL]`, and each `[[history]]` table, which has `channel`, "
                   "the name of its\nchannel, too:\n\n",
                   keys_of<ChannelCalibration>()},
           Section{"\nEach `[[channel.CHANNEL.point]]`:\n\n", keys_of<CalibrationPoint>()},
       }) {
    write(page, section);
  }
  return page.str();
}

}  // namespace stickslip::config
