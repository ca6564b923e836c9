// SPDX-License-Identifier: Apache-2.0
// Access: to the control socket, the devices and the recordings.
#include <algorithm>
#include <array>
#include <cerrno>

#include "tools/doctor/examination.h"
#include "tools/doctor/udev_rules.h"

namespace stickslip::doctor {

namespace {

constexpr const char* group = "stickslip";
constexpr unsigned writable_by_others = 0002;

std::string join_group_command(const Host& host, const std::string& which) {
  return "sudo usermod -aG " + which + " " + host.caller().name + "   # then log in again";
}

bool in_group(const Caller& caller) {
  return caller.root ||
         std::find(caller.groups.begin(), caller.groups.end(), group) != caller.groups.end();
}

/// Gives the caller access to a device: installs the rules, adds the group, or applies the rules.
std::string access_command(const Host& host) {
  if (rules_file(host).empty()) return install_rules_command();
  if (!in_group(host.caller())) return join_group_command(host, group);
  return apply_rules_command;
}

struct Device {
  const char* vendor;
  const char* product;
  const char* name;
};

constexpr std::array<Device, 2> usb_devices = {
    {{"0cd5", "0006", "LabJack U6"}, {"06c2", "003b", "PhidgetBridge 1046"}}};

/// Finding for missing devices: a warning only if the rig needs hardware.
Finding absent(const std::string& check, const std::string& found, const Requirements& required,
               const std::string& command) {
  if (required.hardware) return {check, Verdict::warn, found, command};
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
  if (caller.root) return {check, Verdict::ok, caller.name + " has all permissions", ""};
  if (in_group(caller)) return {check, Verdict::ok, caller.name + " is in " + group, ""};
  return {check, Verdict::warn,
          caller.name + " is not in " + group + ": no access to devices, recordings or commands",
          join_group_command(host, group)};
}

Finding check_runtime_folder(const Host& host, const Requirements& required) {
  const std::string check = "runtime folder";
  const std::string folder = required.control_socket.parent_path().string();
  const Entry entry = host.entry_at(folder);
  if (!entry.exists()) {
    return {check, Verdict::note, folder + " does not exist: the daemon's unit creates it at start",
            "sudo systemctl start stickslipd"};
  }
  if (entry.kind != Entry::Kind::folder) {
    return {check, Verdict::fail, folder + " is not a folder",
            "sudo mv " + shell_word(folder) + " " + shell_word(folder + ".old")};
  }
  if ((entry.mode & writable_by_others) != 0) {
    return {check, Verdict::fail,
            folder + " is writable by all users, any of whom may create a socket there",
            "sudo chmod o-w " + shell_word(folder)};
  }
  if (!entry.searchable) {
    return {check, Verdict::fail, folder + " is not accessible to " + host.caller().name,
            join_group_command(host, entry.group)};
  }
  return {check, Verdict::ok, folder + ", of " + entry.owner + ":" + entry.group, ""};
}

Finding check_control_socket(const Host& host, const Requirements& required) {
  const std::string check = "control socket";
  const std::string socket = required.control_socket.string();
  const Entry entry = host.entry_at(socket);
  if (!entry.exists()) {
    return {check, Verdict::note, socket + " does not exist: no daemon accepts commands",
            "sudo systemctl start stickslipd"};
  }
  if (entry.kind != Entry::Kind::socket) {
    return {check, Verdict::fail, socket + " is not a socket",
            "sudo mv " + shell_word(socket) + " " + shell_word(socket + ".old")};
  }
  if ((entry.mode & writable_by_others) != 0) {
    return {check, Verdict::fail, socket + " accepts commands from every user of this host",
            "sudo chmod o-rwx " + shell_word(socket)};
  }
  const Attempt connected = host.connect_to(socket);
  if (connected.done) {
    return {check, Verdict::ok, socket + " answers, of " + entry.owner + ":" + entry.group, ""};
  }
  if (connected.error == EACCES || connected.error == EPERM) {
    return {check, Verdict::fail, socket + " is not accessible to " + host.caller().name,
            join_group_command(host, entry.group)};
  }
  return {check, Verdict::warn, socket + " is stale, no daemon listens: " + connected.reason,
          "sudo systemctl restart stickslipd"};
}

Finding check_udev_rules(const Host& host, const Requirements& required) {
  const std::string check = "udev rules";
  const std::string file = rules_file(host);
  if (!file.empty()) return {check, Verdict::ok, file, ""};
  return {check, required.hardware ? Verdict::fail : Verdict::warn,
          std::string(rules_name) + " is not installed: devices are accessible to root only",
          install_rules_command()};
}

Finding check_usb(const Host& host, const Requirements& required) {
  const std::string check = "USB devices";
  const std::filesystem::path bus = "/sys/bus/usb/devices";
  const auto names = host.names_in(bus);
  if (names.empty() || !host.entry_at("/dev/bus/usb").exists()) {
    return absent(check, "this machine has no USB (/dev/bus/usb)", required,
                  "sudo modprobe usbcore && lsusb");
  }
  std::vector<std::string> accessible;
  for (const std::string& name : names) {
    for (const Device& device : usb_devices) {
      if (host.read(bus / name / "idVendor") != device.vendor ||
          host.read(bus / name / "idProduct") != device.product) {
        continue;
      }
      const std::string node = usb_node(host.read(bus / name / "busnum").value_or("0"),
                                        host.read(bus / name / "devnum").value_or("0"));
      if (!host.entry_at(node).writable) {
        return {
            check, Verdict::fail,
            std::string(device.name) + " (" + node + ") is not accessible to " + host.caller().name,
            access_command(host)};
      }
      accessible.push_back(std::string(device.name) + " (" + node + ")");
    }
  }
  if (accessible.empty()) {
    return absent(check, "neither LabJack U6 nor PhidgetBridge is connected", required,
                  "lsusb -d 0cd5: ; lsusb -d 06c2:");
  }
  return {check, Verdict::ok, listed(accessible) + ": present and accessible", ""};
}

Finding check_hid(const Host& host) {
  const std::string check = "HID devices";
  const std::filesystem::path folder = "/sys/class/hidraw";
  std::vector<std::string> accessible;
  for (const std::string& name : host.names_in(folder)) {
    std::string id = host.read(folder / name / "device/uevent").value_or("");
    std::transform(id.begin(), id.end(), id.begin(),
                   [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
    for (const Device& device : usb_devices) {
      if (id.find("0000" + std::string(device.vendor) + ":0000" + device.product) ==
          std::string::npos) {
        continue;
      }
      const Entry node = host.entry_at("/dev/" + name);
      if (!node.readable || !node.writable) {
        return {check, Verdict::fail,
                std::string(device.name) + " (/dev/" + name + ") is not accessible to " +
                    host.caller().name,
                access_command(host)};
      }
      accessible.push_back(std::string(device.name) + " (/dev/" + name + ")");
    }
  }
  if (accessible.empty()) return {check, Verdict::note, "no PhidgetBridge among /dev/hidraw*", ""};
  return {check, Verdict::ok, listed(accessible) + ": present and accessible", ""};
}

Finding check_gpio(const Host& host, const Requirements& required) {
  const std::string check = "GPIO";
  std::vector<std::string> chips;
  std::vector<std::string> closed;
  for (const std::string& name : host.names_in("/dev")) {
    if (!name.starts_with("gpiochip")) continue;
    const Entry chip = host.entry_at("/dev/" + name);
    (chip.readable && chip.writable ? chips : closed).push_back("/dev/" + name);
  }
  if (!closed.empty()) {
    return {check, required.hardware ? Verdict::fail : Verdict::warn,
            listed(closed) + ": not accessible to " + host.caller().name, access_command(host)};
  }
  if (chips.empty()) {
    return {check, Verdict::note,
            "no /dev/gpiochip*: the lines of an amplifier cannot be connected", ""};
  }
  return {check, Verdict::ok, listed(chips) + ": present and accessible", ""};
}

Finding check_network_board(const Host& host, const NetworkBoard& board) {
  const std::string check = "board on Ethernet";
  const std::string where = board.name + " at " + board.host + ":" + std::to_string(board.port);
  const Attempt reached = host.reach(board.host, board.port);
  if (reached.done) return {check, Verdict::ok, where + " accepts connections", ""};
  return {check, Verdict::fail, where + " is not reached: " + reached.reason,
          "ping -c 3 " + shell_word(board.host)};
}

Finding check_recording_space(const Host& host, const Requirements& required) {
  const std::string check = "recording space";
  const std::string folder = required.recording_folder.string();
  if (host.entry_at(folder).kind != Entry::Kind::folder) {
    return {check, required.records ? Verdict::fail : Verdict::note, "there is no folder " + folder,
            "sudo install -d -o stickslip -g stickslip -m 2750 " + shell_word(folder)};
  }
  const std::optional<std::uint64_t> free = host.free_bytes(folder);
  const std::string look = "du -xh --max-depth=1 " + shell_word(folder) + " | sort -h | tail";
  if (!free) return {check, Verdict::warn, folder + " does not report its free space", look};
  const double hours = static_cast<double>(*free) / required.recorded_bytes_per_s() / 3600.0;
  const std::string found = short_number(static_cast<double>(*free) / 1e9) + " GB free in " +
                            folder + ", " + short_number(hours) + " h of this rig at " +
                            short_number(required.recorded_bytes_per_s() / 1e3) + " kB/s";
  if (hours >= 24.0) return {check, Verdict::ok, found, ""};
  return {check, hours >= 1.0 ? Verdict::warn : Verdict::fail, found, look};
}

Finding check_recording_speed(const Host& host, const Requirements& required) {
  const std::string check = "recording speed";
  const std::string folder = required.recording_folder.string();
  if (host.entry_at(folder).kind != Entry::Kind::folder) {
    return {check, Verdict::note, "nothing to measure: there is no folder " + folder, ""};
  }
  const WriteSpeed speed = host.measure_writing(folder);
  if (!speed.attempt.done) {
    return {
        check, required.records ? Verdict::fail : Verdict::warn,
        host.caller().name + " cannot write in " + folder + ": " + speed.attempt.reason,
        "sudo -u stickslip stickslip doctor" +
            (required.config_file.empty() ? "" : " --config " + shell_word(required.config_file))};
  }
  const double times = speed.bytes_per_s / required.recorded_bytes_per_s();
  const double sync_s = static_cast<double>(speed.longest_sync_ns) * 1e-9;
  const std::string found =
      short_number(speed.bytes_per_s / 1e6) + " MB/s written and synced, " + short_number(times) +
      " times the data rate of this rig; longest sync " + short_number(sync_s * 1e3) + " ms";
  // The ring buffer ahead of the recorder holds at least ten seconds of frames.
  const Verdict verdict = times < 2.0 || sync_s > 10.0   ? Verdict::fail
                          : times < 10.0 || sync_s > 1.0 ? Verdict::warn
                                                         : Verdict::ok;
  return {check, verdict, found,
          verdict == Verdict::ok
              ? ""
              : "lsblk -o NAME,ROTA,SIZE,FSTYPE,MOUNTPOINTS   # a faster disk for recording.file"};
}

}  // namespace stickslip::doctor
