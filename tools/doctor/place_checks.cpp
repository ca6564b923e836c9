// Places: who may command the rig, reach its devices, write its recordings?
#include <algorithm>
#include <array>
#include <cerrno>

#include "tools/doctor/examination.h"

namespace stickslip::doctor {

namespace {

constexpr const char* group = "stickslip";
constexpr unsigned writable_by_others = 0002;

std::string join_group_command(const Host& host, const std::string& which) {
  return "sudo usermod -aG " + which + " " + host.caller().name + "   # then log in anew";
}

bool in_group(const Caller& caller) {
  return caller.root ||
         std::find(caller.groups.begin(), caller.groups.end(), group) != caller.groups.end();
}

constexpr const char* rules = "70-stickslip.rules";

/// The folder of udev's rules in which ours stand; empty where they do not.
std::string folder_of_rules(const Host& host) {
  for (const char* folder :
       {"/etc/udev/rules.d", "/run/udev/rules.d", "/usr/local/lib/udev/rules.d",
        "/usr/lib/udev/rules.d", "/lib/udev/rules.d"}) {
    const auto names = host.names_in(folder);
    if (std::find(names.begin(), names.end(), rules) != names.end()) return folder;
  }
  return {};
}

constexpr const char* trigger = "sudo udevadm control --reload && sudo udevadm trigger";

/// From the checkout: the rules without anything else of the installation.
std::string install_rules_command() {
  return std::string("sudo install -m 644 systemd/") + rules + " /etc/udev/rules.d/ && " + trigger;
}

/// What gives the caller a device: the rules, the group that they give it to, or their effect.
std::string access_command(const Host& host) {
  if (folder_of_rules(host).empty()) return install_rules_command();
  if (!in_group(host.caller())) return join_group_command(host, group);
  return trigger;
}

struct Device {
  const char* vendor;
  const char* product;
  const char* name;
};

constexpr std::array<Device, 2> usb_devices = {
    {{"0cd5", "0006", "LabJack U6"}, {"06c2", "003b", "PhidgetBridge 1046"}}};

/// Whether nothing being there is a reason to worry.
Finding absent(const std::string& check, const std::string& found, const Needs& needs,
               const std::string& command) {
  if (needs.hardware) return {check, Verdict::warn, found, command};
  return {check, Verdict::note, found, ""};
}

std::string usb_node(const std::string& bus, const std::string& device) {
  const auto padded = [](const std::string& text) {
    return std::string(text.size() < 3 ? 3 - text.size() : 0, '0') + text;
  };
  return "/dev/bus/usb/" + padded(bus) + "/" + padded(device);
}

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

}  // namespace

Finding check_group(const Host& host) {
  const std::string check = "group";
  const Caller caller = host.caller();
  if (!host.group_exists(group)) {
    return {
        check, Verdict::warn, std::string("there is no group ") + group,
        std::string("sudo groupadd --system ") + group + " && " + join_group_command(host, group)};
  }
  if (caller.root) return {check, Verdict::ok, caller.name + " may do anything", ""};
  if (in_group(caller)) return {check, Verdict::ok, caller.name + " is in " + group, ""};
  return {check, Verdict::warn,
          caller.name + " is not in " + group +
              ": neither devices, recordings nor commands are open to them",
          join_group_command(host, group)};
}

Finding check_runtime_folder(const Host& host, const Needs& needs) {
  const std::string check = "runtime folder";
  const std::string folder = needs.control_socket.parent_path().string();
  const Entry entry = host.look_at(folder);
  if (!entry.there()) {
    return {check, Verdict::note, folder + " is not there: the daemon's unit makes it at its start",
            "sudo systemctl start stickslipd"};
  }
  if (entry.kind != Entry::Kind::folder) {
    return {check, Verdict::fail, folder + " is no folder",
            "sudo mv " + shell_word(folder) + " " + shell_word(folder + ".old")};
  }
  if ((entry.mode & writable_by_others) != 0) {
    return {check, Verdict::fail,
            folder + " can be written by everyone, who may put a socket there",
            "sudo chmod o-w " + shell_word(folder)};
  }
  if (!entry.searchable) {
    return {check, Verdict::fail, folder + " is closed to " + host.caller().name,
            join_group_command(host, entry.group)};
  }
  return {check, Verdict::ok, folder + ", of " + entry.owner + ":" + entry.group, ""};
}

Finding check_control_socket(const Host& host, const Needs& needs) {
  const std::string check = "control socket";
  const std::string socket = needs.control_socket.string();
  const Entry entry = host.look_at(socket);
  if (!entry.there()) {
    return {check, Verdict::note, socket + " is not there: no daemon takes commands now",
            "sudo systemctl start stickslipd"};
  }
  if (entry.kind != Entry::Kind::socket) {
    return {check, Verdict::fail, socket + " is no socket",
            "sudo mv " + shell_word(socket) + " " + shell_word(socket + ".old")};
  }
  if ((entry.mode & writable_by_others) != 0) {
    return {check, Verdict::fail, socket + " takes commands from everyone on this host",
            "sudo chmod o-rwx " + shell_word(socket)};
  }
  const Tried connected = host.connect_to(socket);
  if (connected.done) {
    return {check, Verdict::ok, socket + " answers, of " + entry.owner + ":" + entry.group, ""};
  }
  if (connected.error == EACCES || connected.error == EPERM) {
    return {check, Verdict::fail, socket + " is closed to " + host.caller().name,
            join_group_command(host, entry.group)};
  }
  return {check, Verdict::warn, socket + " is left over, nobody listens: " + connected.words,
          "sudo systemctl restart stickslipd"};
}

Finding check_udev_rules(const Host& host, const Needs& needs) {
  const std::string check = "udev rules";
  const std::string folder = folder_of_rules(host);
  if (!folder.empty()) return {check, Verdict::ok, folder + "/" + rules, ""};
  return {check, needs.hardware ? Verdict::fail : Verdict::warn,
          std::string(rules) + " is not installed: devices belong to root alone",
          install_rules_command()};
}

Finding check_usb(const Host& host, const Needs& needs) {
  const std::string check = "USB devices";
  const std::filesystem::path bus = "/sys/bus/usb/devices";
  const auto names = host.names_in(bus);
  if (names.empty() || !host.look_at("/dev/bus/usb").there()) {
    return absent(check, "there is no USB here (/dev/bus/usb)", needs,
                  "sudo modprobe usbcore && lsusb");
  }
  std::vector<std::string> reached;
  for (const std::string& name : names) {
    for (const Device& device : usb_devices) {
      if (host.read(bus / name / "idVendor") != device.vendor ||
          host.read(bus / name / "idProduct") != device.product) {
        continue;
      }
      const std::string node = usb_node(host.read(bus / name / "busnum").value_or("0"),
                                        host.read(bus / name / "devnum").value_or("0"));
      if (!host.look_at(node).writable) {
        return {check, Verdict::fail,
                std::string(device.name) + " (" + node + ") is closed to " + host.caller().name,
                access_command(host)};
      }
      reached.push_back(std::string(device.name) + " (" + node + ")");
    }
  }
  if (reached.empty()) {
    return absent(check, "neither LabJack U6 nor PhidgetBridge is connected", needs,
                  "lsusb -d 0cd5: ; lsusb -d 06c2:");
  }
  return {check, Verdict::ok, listed(reached) + ": present and accessible", ""};
}

Finding check_hid(const Host& host) {
  const std::string check = "HID devices";
  const std::filesystem::path folder = "/sys/class/hidraw";
  std::vector<std::string> reached;
  for (const std::string& name : host.names_in(folder)) {
    std::string id = host.read(folder / name / "device/uevent").value_or("");
    std::transform(id.begin(), id.end(), id.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
    for (const Device& device : usb_devices) {
      if (id.find("0000" + std::string(device.vendor) + ":0000" + device.product) ==
          std::string::npos) {
        continue;
      }
      const Entry node = host.look_at("/dev/" + name);
      if (!node.readable || !node.writable) {
        return {
            check, Verdict::fail,
            std::string(device.name) + " (/dev/" + name + ") is closed to " + host.caller().name,
            access_command(host)};
      }
      reached.push_back(std::string(device.name) + " (/dev/" + name + ")");
    }
  }
  if (reached.empty()) return {check, Verdict::note, "no PhidgetBridge among /dev/hidraw*", ""};
  return {check, Verdict::ok, listed(reached) + ": present and accessible", ""};
}

Finding check_gpio(const Host& host, const Needs& needs) {
  const std::string check = "GPIO";
  std::vector<std::string> chips;
  std::vector<std::string> closed;
  for (const std::string& name : host.names_in("/dev")) {
    if (!name.starts_with("gpiochip")) continue;
    const Entry chip = host.look_at("/dev/" + name);
    (chip.readable && chip.writable ? chips : closed).push_back("/dev/" + name);
  }
  if (!closed.empty()) {
    return {check, needs.hardware ? Verdict::fail : Verdict::warn,
            listed(closed) + ": closed to " + host.caller().name, access_command(host)};
  }
  if (chips.empty()) {
    return {check, Verdict::note, "no /dev/gpiochip*: an amplifier's lines cannot be wired here",
            ""};
  }
  return {check, Verdict::ok, listed(chips) + ": present and accessible", ""};
}

Finding check_recording_space(const Host& host, const Needs& needs) {
  const std::string check = "recording space";
  const std::string folder = needs.recording_folder.string();
  if (host.look_at(folder).kind != Entry::Kind::folder) {
    return {check, needs.records ? Verdict::fail : Verdict::note, "there is no folder " + folder,
            "sudo install -d -o stickslip -g stickslip -m 2750 " + shell_word(folder)};
  }
  const std::optional<std::uint64_t> free = host.free_bytes(folder);
  const std::string look = "du -xh --max-depth=1 " + shell_word(folder) + " | sort -h | tail";
  if (!free) return {check, Verdict::warn, folder + " does not tell how much is free", look};
  const double hours = static_cast<double>(*free) / needs.recorded_bytes_per_s() / 3600.0;
  const std::string found = number(static_cast<double>(*free) / 1e9) + " GB free in " + folder +
                            ", " + number(hours) + " h of this rig at " +
                            number(needs.recorded_bytes_per_s() / 1e3) + " kB/s";
  if (hours >= 24.0) return {check, Verdict::ok, found, ""};
  return {check, hours >= 1.0 ? Verdict::warn : Verdict::fail, found, look};
}

Finding check_recording_speed(const Host& host, const Needs& needs) {
  const std::string check = "recording speed";
  const std::string folder = needs.recording_folder.string();
  if (host.look_at(folder).kind != Entry::Kind::folder) {
    return {check, Verdict::note, "nothing to measure: there is no folder " + folder, ""};
  }
  const WriteSpeed speed = host.measure_writing(folder);
  if (!speed.tried.done) {
    return {check, needs.records ? Verdict::fail : Verdict::warn,
            host.caller().name + " cannot write in " + folder + ": " + speed.tried.words,
            "sudo -u stickslip stickslip doctor" +
                (needs.config_file.empty() ? "" : " --config " + shell_word(needs.config_file))};
  }
  const double times = speed.bytes_per_s / needs.recorded_bytes_per_s();
  const double sync_s = static_cast<double>(speed.longest_sync_ns) * 1e-9;
  const std::string found = number(speed.bytes_per_s / 1e6) + " MB/s written and synced, " +
                            number(times) + " times what this rig records; longest sync " +
                            number(sync_s * 1e3) + " ms";
  // The ring before the recorder holds ten seconds of frames or more.
  const Verdict verdict = times < 2.0 || sync_s > 10.0   ? Verdict::fail
                          : times < 10.0 || sync_s > 1.0 ? Verdict::warn
                                                         : Verdict::ok;
  return {check, verdict, found,
          verdict == Verdict::ok
              ? ""
              : "lsblk -o NAME,ROTA,SIZE,FSTYPE,MOUNTPOINTS   # a faster disk for recording.file"};
}

}  // namespace stickslip::doctor
