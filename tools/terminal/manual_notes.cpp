#include "tools/terminal/manual_notes.h"

#include <string>
#include <utility>
#include <vector>

namespace stickslip::terminal {

namespace {

using terminal::Notes;

const std::pair<std::string, std::string> lcm_url = {
    "LCM_DEFAULT_URL", "Where LCM is, unless --url says it: udpm://239.255.76.67:7667?ttl=0"};
const std::pair<std::string, std::string> no_color = {
    "NO_COLOR", "Set to anything but nothing: no colours, unless --color asks for them"};
const std::pair<std::string, std::string> recording_file = {
    "*.log, *.lcm, *.csv",
    "Recordings: LCM event logs, or CSV with a column time_s and the channels in SI units. Which "
    "of "
    "the two one is, its content tells"};
const std::pair<std::string, std::string> model_file = {
    "config/models/*.toml", "Models, in the source; docs/configuration.md describes every key"};

struct Entry {
  std::string_view command;
  Notes notes;
};

const std::vector<Entry>& entries() {
  static const std::vector<Entry> all = {
      {"",
       {{{"What is wrong with a rig file, without a rig", "stickslip check config/simulated.toml"},
         {"What is on LCM", "stickslip spy"},
         {"Which physics a model leaves out",
          "stickslip diagnose run.log --model model.toml --html report.html"}},
        {no_color},
        {{"/etc/stickslip", "Rig files of an installation"},
         {"/run/stickslip/control.sock", "Where the daemon listens to stickslip ctl"}},
        "On a terminal, what lasts longer than a second tells how far it is and how long it will "
        "still take, on standard error; in a pipe it is silent.",
        {"stickslipd(8)"}}},
      {"simulate",
       {{{"What the sensors of a rig would read, driven as it was driven",
          "stickslip simulate --model model.toml --drive run.csv --out simulated.csv"}},
        {},
        {recording_file, model_file},
        {},
        {"stickslip-conceal(1)", "stickslip-evaluate(1)"}}},
      {"diagnose",
       {{{"The report, the page and the mended model",
          "stickslip diagnose run.log --model model.toml --json report.json --html report.html "
          "--write-model mended.toml"},
         {"How often it accuses for nothing",
          "stickslip diagnose run.log --model model.toml --bootstrap 10"}},
        {},
        {recording_file, model_file},
        {},
        {"stickslip-evaluate(1)", "stickslip-examine(1)"}}},
      {"evaluate",
       {{{"How well a model predicts a recording",
          "stickslip evaluate run.log --model mended.toml"}},
        {},
        {recording_file, model_file},
        {},
        {"stickslip-diagnose(1)"}}},
      {"estimate",
       {{{"Friction and what belongs to it, a row for each frame",
          "stickslip estimate run.log --model mended.toml --out estimates.csv"}},
        {},
        {recording_file, model_file},
        {},
        {"stickslip-evaluate(1)"}}},
      {"calibration",
       {{{"A line through points, into a calibration file",
          "stickslip calibration fit points.csv --channel friction_force --reference \"weights set "
          "12\" --file calibration.toml"},
         {"What a calibration file says", "stickslip calibration show calibration.toml"}},
        {},
        {},
        {},
        {"stickslip-ctl(1)"}}},
      {"check",
       {{{"Rigs and models, offline", "stickslip check config/simulated.toml model.toml"},
         {"The first readings of each device", "stickslip check --live config/bench-u6.toml"}},
        {},
        {model_file},
        {},
        {"stickslip-config(1)", "stickslip-doctor(1)"}}},
      {"config",
       {{{"One key: its value, its meaning, and where the value comes from",
          "stickslip config config/simulated.toml --explain excitation.carrier_hz"}},
        {},
        {},
        {},
        {"stickslip-check(1)"}}},
      {"record",
       {{{"Ten seconds of what LCM carries", "stickslip record heard.log --duration 10"}},
        {lcm_url},
        {recording_file},
        {},
        {"stickslip-replay(1)", "stickslip-spy(1)", "stickslipd(8)"}}},
      {"replay",
       {{{"A recording onto LCM again, twice as fast", "stickslip replay run.log --speed 2"}},
        {lcm_url},
        {recording_file},
        {},
        {"stickslip-record(1)", "stickslip-spy(1)"}}},
      {"convert",
       {{{"A log as CSV", "stickslip convert run.log run.csv"},
         {"And into a program that reads standard input", "stickslip convert run.log -"}},
        {},
        {recording_file},
        {},
        {"stickslip-log(1)"}}},
      {"ctl",
       {{{"What the rig does", "stickslip ctl status"},
         {"From the first look to motion", "stickslip ctl clear"},
         {"Then", "stickslip ctl arm"},
         {"And, for as long as this runs", "stickslip ctl start --dead-man"},
         {"A knob while it runs", "stickslip ctl set excitation.carrier_hz 4.2"}},
        {{"STICKSLIP_CONTROL", "The daemon's control socket, unless --socket says it"}, no_color},
        {{"/run/stickslip/control.sock", "The control socket, where nothing else is said"}},
        {},
        {"stickslipd(8)"}}},
      {"spy",
       {{{"All channels, the busiest first", "stickslip spy --sort rate"},
         {"Every number of the frames, between which values it was",
          "stickslip spy frames --values"},
         {"One look, for a program", "stickslip spy --once --json"}},
        {lcm_url, no_color},
        {},
        {},
        {"stickslip-record(1)", "stickslip-ctl(1)", "stickslipd(8)"}}},
      {"log",
       {{{"Is it whole, and do its books balance", "stickslip log check run.log run.001.log"},
         {"For other programs", "stickslip log export run.log run.h5"},
         {"What is whole of a damaged log", "stickslip log repair run.log --out whole.log"}},
        {},
        {recording_file},
        {},
        {"stickslip-convert(1)", "stickslip-record(1)"}}},
      {"poincare",
       {{{"A section at 4.2 Hz",
          "stickslip poincare --model config/models/motivational.toml --frequency-hz 4.2 "
          "--amplitude 0.008 --out section.csv"}},
        {},
        {model_file},
        {},
        {"stickslip-lyapunov(1)", "stickslip-bifurcation(1)"}}},
      {"lyapunov",
       {{{"Is it chaotic",
          "stickslip lyapunov --model config/models/paper-figure-10.toml --omega 1.25 "
          "--acceleration 1.9 --x 0.5"}},
        {},
        {model_file},
        {},
        {"stickslip-poincare(1)", "stickslip-bifurcation(1)"}}},
      {"bifurcation",
       {{{"Over the amplitude of the drive",
          "stickslip bifurcation --model config/models/motivational.toml --frequency-hz 4.2 --over "
          "drive.amplitude_m --from 0.006 --to 0.012 --out diagram.csv"}},
        {},
        {model_file},
        {},
        {"stickslip-poincare(1)", "stickslip-lyapunov(1)"}}},
      {"reduce",
       {{{"The coefficient of friction with its surface and pictures",
          "stickslip reduce run.log --model model.toml --out reduced"},
         {"As the paper did it", "stickslip reduce run.log --model model.toml --method paper"}},
        {},
        {recording_file, model_file},
        {},
        {"stickslip-figures(1)"}}},
      {"conceal",
       {{{"Twenty recordings in which something is hidden",
          "stickslip conceal --out blind --count 20"}},
        {},
        {{"DIR/truth", "What is hidden in each; each case holds the SHA-256 of its own"}},
        {},
        {"stickslip-examine(1)"}}},
      {"examine",
       {{{"All of a set, graded", "stickslip examine blind"},
         {"The same work as a list of commands, for a cluster",
          "stickslip examine blind --job-list jobs.txt"}},
        {},
        {{"DIR/reports", "The reports; those that are there are not made again"}},
        {},
        {"stickslip-conceal(1)", "stickslip-diagnose(1)"}}},
      {"figures",
       {{{"All of the paper's figures on one page", "stickslip figures --out figures"}},
        {},
        {},
        {},
        {"stickslip-reduce(1)", "gnuplot(1)"}}},
      {"devices",
       {{{"What is attached", "stickslip devices"}},
        {},
        {},
        {},
        {"stickslip-check(1)", "stickslip-doctor(1)"}}},
      {"doctor",
       {{{"What this machine grants a rig", "stickslip doctor --config config/simulated.toml"},
         {"The tail of the wake-ups, over ten minutes", "stickslip doctor --duration 600"}},
        {lcm_url, no_color},
        {},
        {},
        {"stickslip-check(1)", "stickslipd(8)"}}},
      {"completion",
       {{{"For bash", "stickslip completion bash"}}, {}, {}, {}, {"stickslip-manual(1)"}}},
      {"manual",
       {{{"Into a folder of one's own", "stickslip manual man1"}},
        {{"SOURCE_DATE_EPOCH", "The date on the pages, for builds that are the same to the bit"}},
        {},
        {},
        {"man(1)", "stickslip-completion(1)"}}},
  };
  return all;
}

}  // namespace

terminal::Notes manual_notes(std::string_view command) {
  Notes out;
  for (const Entry& entry : entries()) {
    if (entry.command == command) out = entry.notes;
  }
  if (!command.empty()) out.see_also.insert(out.see_also.begin(), "stickslip(1)");
  return out;
}

}  // namespace stickslip::terminal
