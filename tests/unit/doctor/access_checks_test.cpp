// SPDX-License-Identifier: Apache-2.0
#include <cerrno>

#include "fake_host.h"

namespace stickslip::doctor {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* join = "sudo usermod -aG stickslip ada   # then log in again";
constexpr const char* trigger = "sudo udevadm control --reload && sudo udevadm trigger";
constexpr const char* install_rules =
    "sudo install -m 644 systemd/70-stickslip.rules /etc/udev/rules.d/ && "
    "sudo udevadm control --reload && sudo udevadm trigger";

TEST(GroupCheck, RequiresMembership) {
  FakeHost host;
  EXPECT_THAT(check_group(host), passes());
  host.who.groups = {"ada"};
  EXPECT_THAT(check_group(host),
              AllOf(is(Verdict::warn, "ada is not in stickslip"), remedied_by(join)));
  host.who.root = true;
  EXPECT_THAT(check_group(host), passes());
  host.group = false;
  EXPECT_THAT(check_group(host),
              AllOf(is(Verdict::warn, "no group stickslip"),
                    remedied_by(std::string("sudo groupadd --system stickslip && ") + join)));
}

TEST(RuntimeFolderCheck, RequiresAccessForTheGroupOnly) {
  FakeHost host;
  const Requirements required = some_requirements();
  EXPECT_THAT(check_runtime_folder(host, required), passes());
  Entry& folder = host.entries["/run/stickslip"];
  folder.searchable = false;
  EXPECT_THAT(check_runtime_folder(host, required),
              AllOf(is(Verdict::fail, "not accessible to ada"), remedied_by(join)));
  folder.mode = 0777;
  EXPECT_THAT(
      check_runtime_folder(host, required),
      AllOf(is(Verdict::fail, "by all users"), remedied_by("sudo chmod o-w /run/stickslip")));
  folder.kind = Entry::Kind::file;
  EXPECT_THAT(check_runtime_folder(host, required),
              AllOf(is(Verdict::fail, "is not a folder"),
                    remedied_by("sudo mv /run/stickslip /run/stickslip.old")));
  host.entries.erase("/run/stickslip");
  EXPECT_THAT(
      check_runtime_folder(host, required),
      AllOf(is(Verdict::note, "does not exist"), remedied_by("sudo systemctl start stickslipd")));
}

TEST(ControlSocketCheck, RequiresAccessForTheGroupOnly) {
  FakeHost host;
  const Requirements required = some_requirements();
  EXPECT_THAT(check_control_socket(host, required), passes());
  host.connected = {false, ECONNREFUSED, "Connection refused"};
  EXPECT_THAT(check_control_socket(host, required),
              AllOf(is(Verdict::warn, "no daemon listens"),
                    remedied_by("sudo systemctl restart stickslipd")));
  host.connected = {false, EACCES, "Permission denied"};
  EXPECT_THAT(check_control_socket(host, required),
              AllOf(is(Verdict::fail, "not accessible to ada"), remedied_by(join)));
  Entry& socket = host.entries["/run/stickslip/control.sock"];
  socket.mode = 0666;
  EXPECT_THAT(check_control_socket(host, required),
              AllOf(is(Verdict::fail, "from every user"),
                    remedied_by("sudo chmod o-rwx /run/stickslip/control.sock")));
  socket.kind = Entry::Kind::file;
  EXPECT_THAT(check_control_socket(host, required), is(Verdict::fail, "is not a socket"));
  host.entries.erase("/run/stickslip/control.sock");
  EXPECT_THAT(
      check_control_socket(host, required),
      AllOf(is(Verdict::note, "does not exist"), remedied_by("sudo systemctl start stickslipd")));
}

TEST(UdevRulesCheck, RequiresInstalledRules) {
  FakeHost host;
  EXPECT_THAT(check_udev_rules(host, some_requirements()), passes());
  host.folders.erase("/usr/lib/udev/rules.d");
  EXPECT_THAT(check_udev_rules(host, some_requirements()),
              AllOf(is(Verdict::warn, "not installed"), remedied_by(install_rules)));
  EXPECT_THAT(check_udev_rules(host, hardware_requirements()), is(Verdict::fail, "not installed"));
}

TEST(UsbCheck, RequiresAccessToPresentDevices) {
  FakeHost host;
  EXPECT_THAT(check_usb(host, some_requirements()), passes());
  EXPECT_THAT(check_usb(host, some_requirements()),
              is(Verdict::ok, "LabJack U6 (/dev/bus/usb/001/012): present and accessible"));
  host.entries["/dev/bus/usb/001/012"].writable = false;
  EXPECT_THAT(check_usb(host, some_requirements()),
              AllOf(is(Verdict::fail, "not accessible to ada"), remedied_by(trigger)));
  host.who.groups.clear();
  EXPECT_THAT(check_usb(host, some_requirements()), remedied_by(join));
  host.folders.erase("/usr/lib/udev/rules.d");
  EXPECT_THAT(check_usb(host, some_requirements()), remedied_by(install_rules));
}

TEST(UsbCheck, WarnsOfMissingDevicesIfTheRigUsesHardware) {
  FakeHost host;
  host.files["/sys/bus/usb/devices/1-2/idProduct"] = "0007";
  EXPECT_THAT(check_usb(host, some_requirements()),
              AllOf(is(Verdict::note, "connected"), remedied_by("")));
  EXPECT_THAT(
      check_usb(host, hardware_requirements()),
      AllOf(is(Verdict::warn, "connected"), remedied_by("lsusb -d 0cd5: ; lsusb -d 06c2:")));
  host.folders.erase("/sys/bus/usb/devices");
  EXPECT_THAT(check_usb(host, some_requirements()), is(Verdict::note, "has no USB"));
  EXPECT_THAT(
      check_usb(host, hardware_requirements()),
      AllOf(is(Verdict::warn, "has no USB"), remedied_by("sudo modprobe usbcore && lsusb")));
}

TEST(HidCheck, RecognisesTheBridgeByItsIds) {
  FakeHost host;
  EXPECT_THAT(check_hid(host), passes());
  host.entries["/dev/hidraw0"].readable = false;
  EXPECT_THAT(check_hid(host), AllOf(is(Verdict::fail, "(/dev/hidraw0) is not accessible to ada"),
                                     remedied_by(trigger)));
  host.files["/sys/class/hidraw/hidraw0/device/uevent"] = "HID_ID=0003:0000046D:0000C52B";
  EXPECT_THAT(check_hid(host), is(Verdict::note, "no PhidgetBridge"));
}

TEST(GpioCheck, RequiresAccessToTheChips) {
  FakeHost host;
  EXPECT_THAT(check_gpio(host, some_requirements()), passes());
  host.entries["/dev/gpiochip0"].writable = false;
  EXPECT_THAT(
      check_gpio(host, some_requirements()),
      AllOf(is(Verdict::warn, "/dev/gpiochip0: not accessible to ada"), remedied_by(trigger)));
  EXPECT_THAT(check_gpio(host, hardware_requirements()),
              is(Verdict::fail, "not accessible to ada"));
  host.folders["/dev"] = {"null"};
  EXPECT_THAT(check_gpio(host, some_requirements()), is(Verdict::note, "no /dev/gpiochip*"));
}

TEST(NetworkBoardCheck, RequiresThatTheBoardOfTheRigIsReached) {
  config::Rig rig;
  rig.driver = config::DriverKind::bench;
  EXPECT_FALSE(requirements_of(rig).network_board);
  EXPECT_TRUE(requirements_of(rig).hardware);
  rig.bench.board = config::BoardKind::labjack_t7;
  rig.bench.labjack_t7.host = "t7.lab";
  Requirements required = requirements_of(rig);
  ASSERT_TRUE(required.network_board);
  EXPECT_FALSE(required.hardware) << "nothing is on USB";
  rig.bench.inputs[index_of(Channel::friction_force)] = {.device = "phidget_bridge", .input = "0"};
  EXPECT_TRUE(requirements_of(rig).hardware);
  FakeHost host;
  EXPECT_THAT(check_network_board(host, *required.network_board), passes());
  host.reached = {false, ETIMEDOUT, "Connection timed out"};
  EXPECT_THAT(
      check_network_board(host, *required.network_board),
      AllOf(is(Verdict::fail, "LabJack T7 at t7.lab:502 is not reached: Connection timed out"),
            remedied_by("ping -c 3 t7.lab")));
}

TEST(RecordingSpaceCheck, ReportsHoursOfRecording) {
  FakeHost host;
  const Requirements required = hardware_requirements();
  const std::string look = "du -xh --max-depth=1 /var/lib/stickslip/recordings | sort -h | tail";
  const auto hours = [&required](double many) {
    return static_cast<std::uint64_t>(many * 3600.0 * required.recorded_bytes_per_s());
  };
  EXPECT_THAT(check_recording_space(host, required), passes());
  host.free = hours(23.5);
  EXPECT_THAT(check_recording_space(host, required),
              AllOf(is(Verdict::warn, "23.5 h of this rig"), remedied_by(look)));
  host.free = hours(0.5);
  EXPECT_THAT(check_recording_space(host, required),
              AllOf(is(Verdict::fail, "0.5 h"), remedied_by(look)));
  host.free.reset();
  EXPECT_THAT(check_recording_space(host, required), is(Verdict::warn, "does not report"));
  host.entries.erase("/var/lib/stickslip/recordings");
  EXPECT_THAT(check_recording_space(host, required),
              AllOf(is(Verdict::fail, "no folder"),
                    remedied_by("sudo install -d -o stickslip -g stickslip -m 2750 "
                                "/var/lib/stickslip/recordings")));
  EXPECT_THAT(check_recording_space(host, some_requirements()), is(Verdict::note, "no folder"));
}

TEST(RecordingSpeedCheck, ComparesTheDiskWithTheDataRate) {
  FakeHost host;
  const Requirements required = hardware_requirements();
  EXPECT_THAT(check_recording_speed(host, required), passes());
  host.speed.bytes_per_s = 9.0 * required.recorded_bytes_per_s();
  EXPECT_THAT(check_recording_speed(host, required),
              AllOf(is(Verdict::warn, "9 times the data rate of this rig"),
                    remedied_by("lsblk -o NAME,ROTA,SIZE,FSTYPE,MOUNTPOINTS   # a faster disk for "
                                "recording.file")));
  host.speed.bytes_per_s = 1.5 * required.recorded_bytes_per_s();
  EXPECT_THAT(check_recording_speed(host, required), is(Verdict::fail, "1.5 times"));
  host.speed = {{true, 0, ""}, 1e9, 1'500'000'000};
  EXPECT_THAT(check_recording_speed(host, required), is(Verdict::warn, "longest sync 1500 ms"));
  host.speed.longest_sync_ns = 11'000'000'000;
  EXPECT_EQ(check_recording_speed(host, required).verdict, Verdict::fail);
  host.speed = {{false, EACCES, "Permission denied"}, 0.0, 0};
  EXPECT_THAT(check_recording_speed(host, required),
              AllOf(is(Verdict::fail, "ada cannot write"),
                    remedied_by("sudo -u stickslip stickslip doctor --config rig.toml")));
  EXPECT_THAT(check_recording_speed(host, some_requirements()),
              is(Verdict::warn, "ada cannot write"));
  host.entries.erase("/var/lib/stickslip/recordings");
  EXPECT_EQ(check_recording_speed(host, required).verdict, Verdict::note);
}

}  // namespace
}  // namespace stickslip::doctor
