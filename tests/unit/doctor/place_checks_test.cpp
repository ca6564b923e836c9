#include <cerrno>

#include "fake_host.h"

namespace stickslip::doctor {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* join = "sudo usermod -aG stickslip ada   # then log in anew";
constexpr const char* trigger = "sudo udevadm control --reload && sudo udevadm trigger";
constexpr const char* install_rules =
    "sudo install -m 644 systemd/70-stickslip.rules /etc/udev/rules.d/ && "
    "sudo udevadm control --reload && sudo udevadm trigger";

TEST(GroupCheck, WantsTheCallerInIt) {
  FakeHost host;
  EXPECT_THAT(check_group(host), is_green());
  host.who.groups = {"ada"};
  EXPECT_THAT(check_group(host),
              AllOf(is(Verdict::warn, "ada is not in stickslip"), mended_by(join)));
  host.who.root = true;
  EXPECT_THAT(check_group(host), is_green());
  host.group = false;
  EXPECT_THAT(check_group(host),
              AllOf(is(Verdict::warn, "no group stickslip"),
                    mended_by(std::string("sudo groupadd --system stickslip && ") + join)));
}

TEST(RuntimeFolderCheck, WantsItClosedToOthersAndOpenToTheCaller) {
  FakeHost host;
  const Needs needs = some_needs();
  EXPECT_THAT(check_runtime_folder(host, needs), is_green());
  Entry& folder = host.entries["/run/stickslip"];
  folder.searchable = false;
  EXPECT_THAT(check_runtime_folder(host, needs),
              AllOf(is(Verdict::fail, "closed to ada"), mended_by(join)));
  folder.mode = 0777;
  EXPECT_THAT(check_runtime_folder(host, needs),
              AllOf(is(Verdict::fail, "by everyone"), mended_by("sudo chmod o-w /run/stickslip")));
  folder.kind = Entry::Kind::file;
  EXPECT_THAT(check_runtime_folder(host, needs),
              AllOf(is(Verdict::fail, "is no folder"),
                    mended_by("sudo mv /run/stickslip /run/stickslip.old")));
  host.entries.erase("/run/stickslip");
  EXPECT_THAT(check_runtime_folder(host, needs),
              AllOf(is(Verdict::note, "not there"), mended_by("sudo systemctl start stickslipd")));
}

TEST(ControlSocketCheck, WantsOneThatAnswersTheCallerAndNotEveryone) {
  FakeHost host;
  const Needs needs = some_needs();
  EXPECT_THAT(check_control_socket(host, needs), is_green());
  host.connected = {false, ECONNREFUSED, "Connection refused"};
  EXPECT_THAT(
      check_control_socket(host, needs),
      AllOf(is(Verdict::warn, "nobody listens"), mended_by("sudo systemctl restart stickslipd")));
  host.connected = {false, EACCES, "Permission denied"};
  EXPECT_THAT(check_control_socket(host, needs),
              AllOf(is(Verdict::fail, "closed to ada"), mended_by(join)));
  Entry& socket = host.entries["/run/stickslip/control.sock"];
  socket.mode = 0666;
  EXPECT_THAT(check_control_socket(host, needs),
              AllOf(is(Verdict::fail, "from everyone"),
                    mended_by("sudo chmod o-rwx /run/stickslip/control.sock")));
  socket.kind = Entry::Kind::file;
  EXPECT_THAT(check_control_socket(host, needs), is(Verdict::fail, "is no socket"));
  host.entries.erase("/run/stickslip/control.sock");
  EXPECT_THAT(check_control_socket(host, needs),
              AllOf(is(Verdict::note, "not there"), mended_by("sudo systemctl start stickslipd")));
}

TEST(UdevRulesCheck, WantsThemInstalled) {
  FakeHost host;
  EXPECT_THAT(check_udev_rules(host, some_needs()), is_green());
  host.folders.erase("/usr/lib/udev/rules.d");
  EXPECT_THAT(check_udev_rules(host, some_needs()),
              AllOf(is(Verdict::warn, "not installed"), mended_by(install_rules)));
  EXPECT_THAT(check_udev_rules(host, hardware_needs()), is(Verdict::fail, "not installed"));
}

TEST(UsbCheck, WantsTheDevicesThatAreThereToBeOpen) {
  FakeHost host;
  EXPECT_THAT(check_usb(host, some_needs()), is_green());
  EXPECT_THAT(check_usb(host, some_needs()),
              is(Verdict::ok, "LabJack U6 (/dev/bus/usb/001/012): present and accessible"));
  host.entries["/dev/bus/usb/001/012"].writable = false;
  EXPECT_THAT(check_usb(host, some_needs()),
              AllOf(is(Verdict::fail, "closed to ada"), mended_by(trigger)));
  host.who.groups.clear();
  EXPECT_THAT(check_usb(host, some_needs()), mended_by(join));
  host.folders.erase("/usr/lib/udev/rules.d");
  EXPECT_THAT(check_usb(host, some_needs()), mended_by(install_rules));
}

TEST(UsbCheck, ADeviceThatIsNotThereMattersToARigThatHasOne) {
  FakeHost host;
  host.files["/sys/bus/usb/devices/1-2/idProduct"] = "0007";
  EXPECT_THAT(check_usb(host, some_needs()), AllOf(is(Verdict::note, "connected"), mended_by("")));
  EXPECT_THAT(check_usb(host, hardware_needs()),
              AllOf(is(Verdict::warn, "connected"), mended_by("lsusb -d 0cd5: ; lsusb -d 06c2:")));
  host.folders.erase("/sys/bus/usb/devices");
  EXPECT_THAT(check_usb(host, some_needs()), is(Verdict::note, "no USB here"));
  EXPECT_THAT(check_usb(host, hardware_needs()),
              AllOf(is(Verdict::warn, "no USB here"), mended_by("sudo modprobe usbcore && lsusb")));
}

TEST(HidCheck, KnowsTheBridgeByItsNumbers) {
  FakeHost host;
  EXPECT_THAT(check_hid(host), is_green());
  host.entries["/dev/hidraw0"].readable = false;
  EXPECT_THAT(check_hid(host),
              AllOf(is(Verdict::fail, "(/dev/hidraw0) is closed to ada"), mended_by(trigger)));
  host.files["/sys/class/hidraw/hidraw0/device/uevent"] = "HID_ID=0003:0000046D:0000C52B";
  EXPECT_THAT(check_hid(host), is(Verdict::note, "no PhidgetBridge"));
}

TEST(GpioCheck, WantsTheChipsOpen) {
  FakeHost host;
  EXPECT_THAT(check_gpio(host, some_needs()), is_green());
  host.entries["/dev/gpiochip0"].writable = false;
  EXPECT_THAT(check_gpio(host, some_needs()),
              AllOf(is(Verdict::warn, "/dev/gpiochip0: closed to ada"), mended_by(trigger)));
  EXPECT_THAT(check_gpio(host, hardware_needs()), is(Verdict::fail, "closed to ada"));
  host.folders["/dev"] = {"null"};
  EXPECT_THAT(check_gpio(host, some_needs()), is(Verdict::note, "no /dev/gpiochip*"));
}

TEST(RecordingSpaceCheck, CountsInHoursOfTheRig) {
  FakeHost host;
  const Needs needs = hardware_needs();
  const std::string look = "du -xh --max-depth=1 /var/lib/stickslip/recordings | sort -h | tail";
  const auto hours = [&needs](double many) {
    return static_cast<std::uint64_t>(many * 3600.0 * needs.recorded_bytes_per_s());
  };
  EXPECT_THAT(check_recording_space(host, needs), is_green());
  host.free = hours(23.5);
  EXPECT_THAT(check_recording_space(host, needs),
              AllOf(is(Verdict::warn, "23.5 h of this rig"), mended_by(look)));
  host.free = hours(0.5);
  EXPECT_THAT(check_recording_space(host, needs),
              AllOf(is(Verdict::fail, "0.5 h"), mended_by(look)));
  host.free.reset();
  EXPECT_THAT(check_recording_space(host, needs), is(Verdict::warn, "does not tell"));
  host.entries.erase("/var/lib/stickslip/recordings");
  EXPECT_THAT(check_recording_space(host, needs),
              AllOf(is(Verdict::fail, "no folder"),
                    mended_by("sudo install -d -o stickslip -g stickslip -m 2750 "
                              "/var/lib/stickslip/recordings")));
  EXPECT_THAT(check_recording_space(host, some_needs()), is(Verdict::note, "no folder"));
}

TEST(RecordingSpeedCheck, HoldsTheDiskAgainstTheRig) {
  FakeHost host;
  const Needs needs = hardware_needs();
  EXPECT_THAT(check_recording_speed(host, needs), is_green());
  host.speed.bytes_per_s = 9.0 * needs.recorded_bytes_per_s();
  EXPECT_THAT(check_recording_speed(host, needs),
              AllOf(is(Verdict::warn, "9 times what this rig records"),
                    mended_by("lsblk -o NAME,ROTA,SIZE,FSTYPE,MOUNTPOINTS   # a faster disk for "
                              "recording.file")));
  host.speed.bytes_per_s = 1.5 * needs.recorded_bytes_per_s();
  EXPECT_THAT(check_recording_speed(host, needs), is(Verdict::fail, "1.5 times"));
  host.speed = {{true, 0, ""}, 1e9, 1'500'000'000};
  EXPECT_THAT(check_recording_speed(host, needs), is(Verdict::warn, "longest sync 1500 ms"));
  host.speed.longest_sync_ns = 11'000'000'000;
  EXPECT_EQ(check_recording_speed(host, needs).verdict, Verdict::fail);
  host.speed = {{false, EACCES, "Permission denied"}, 0.0, 0};
  EXPECT_THAT(check_recording_speed(host, needs),
              AllOf(is(Verdict::fail, "ada cannot write"),
                    mended_by("sudo -u stickslip stickslip doctor --config rig.toml")));
  EXPECT_THAT(check_recording_speed(host, some_needs()), is(Verdict::warn, "ada cannot write"));
  host.entries.erase("/var/lib/stickslip/recordings");
  EXPECT_EQ(check_recording_speed(host, needs).verdict, Verdict::note);
}

}  // namespace
}  // namespace stickslip::doctor
