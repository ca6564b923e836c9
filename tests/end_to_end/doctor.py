"""`stickslip doctor` on this machine: it tries what it speaks of, changes nothing, and its exit
status says whether something fails. What the machine is like decides the rest, so that is not
asserted, but for the network, which is this test's own."""
import json
import os
import subprocess

from programs import STICKSLIP, SOURCE, EndToEnd, as_somebody_else, main, run, stickslip

CHECKS = {"loopback", "LCM URL", "LCM route", "receive buffer", "LCM round trip", "LCM queue", "group",
          "runtime folder", "control socket", "udev rules", "USB devices", "HID devices", "GPIO",
          "real-time priority", "locked memory", "real-time share", "processor sleep",
          "frequency governor", "kernel", "isolated processors", "clock source", "virtual machine",
          "wake-up latency", "recording space", "recording speed", "wall clock", "clock steps"}


class Doctor(EndToEnd):
    def rig(self, more=""):
        """A rig that records into this test's folder."""
        text = (SOURCE / "config/simulated.toml").read_text().replace('"models/', f'"{SOURCE}/config/models/')
        return self.write("rig.toml", f'{text}\n[recording]\nenabled = true\nfile = "run.log"\n{more}')

    def examined(self, *arguments, command=(), environment=None):
        result = subprocess.run([*command, STICKSLIP, "doctor", "--json", "--duration", "0.1",
                                 *map(str, arguments)], capture_output=True, text=True, timeout=60,
                                stdin=subprocess.DEVNULL, env=environment)
        report = json.loads(result.stdout)
        self.assertEqual(result.stderr, "")
        self.assertEqual(result.returncode, 1 if report["verdict"] == "fail" else 0)
        return {check["check"]: check for check in report["checks"]}

    def test_every_check_speaks_and_what_is_red_has_a_command(self):
        rig = self.rig()
        before = sorted(self.folder.iterdir())
        checks = self.examined("--config", rig)
        self.assertEqual(set(checks), CHECKS)
        for check in checks.values():
            with self.subTest(check=check["check"]):
                self.assertTrue(check["found"])
                if check["verdict"] in ("warn", "fail"):
                    self.assertTrue(check["command"])
                    parsed = run("bash", "-n", "-c", check["command"])
                    self.assertEqual(parsed.returncode, 0, check["command"] + parsed.stderr)
        self.assertEqual(sorted(self.folder.iterdir()), before, "something was left behind")

    def test_in_a_network_of_its_own_lcm_is_well(self):
        checks = self.examined("--config", self.rig())
        for name in ("loopback", "LCM URL", "LCM route", "LCM round trip"):
            self.assertEqual(checks[name]["verdict"], "ok", checks[name])
        self.assertIn("goes through lo", checks["LCM route"]["found"])
        self.assertIn("20 of 20", checks["LCM round trip"]["found"])

    def test_without_a_route_it_says_so_and_its_command_makes_one(self):
        if os.geteuid() != 0:
            self.skipTest("an own network namespace within this one needs root")
        command = ("unshare", "--net", "--")
        checks = self.examined(command=command)
        self.assertEqual(checks["loopback"]["verdict"], "fail")
        self.assertEqual(checks["LCM route"]["verdict"], "fail")
        self.assertEqual(checks["LCM round trip"]["verdict"], "fail")
        mend = checks["LCM route"]["command"].replace("sudo ", "")
        mended = self.examined(command=(*command, "bash", "-c", f'{mend} && exec "$@"', "bash"))
        for name in ("loopback", "LCM route", "LCM round trip"):
            self.assertEqual(mended[name]["verdict"], "ok", mended[name])

    def test_what_the_limits_refuse_is_found(self):
        stranger = as_somebody_else()  # else it is root by name only, and has no rights to lose
        checks = self.examined(command=("bash", "-c", 'ulimit -r 0 -l 64; exec "$@"', "bash", *stranger))
        for name, limit in (("real-time priority", "RLIMIT_RTPRIO is 0"),
                            ("locked memory", "RLIMIT_MEMLOCK is 64 KiB")):
            self.assertEqual(checks[name]["verdict"], "fail")
            self.assertIn(limit, checks[name]["found"])
            self.assertIn("limits.d" if stranger else "docker", checks[name]["command"])

    def test_the_url_comes_from_the_environment_where_no_rig_says(self):
        environment = {**os.environ, "LCM_DEFAULT_URL": "udpm://239.255.76.67:7668?ttl=1"}
        checks = self.examined(environment=environment)
        self.assertEqual(checks["LCM URL"]["verdict"], "warn")
        self.assertIn("7668?ttl=0", checks["LCM URL"]["command"])

    def test_for_a_person(self):
        result = stickslip("doctor", "--duration", "0.1", "--config", self.rig())
        lines = result.stdout.splitlines()
        self.assertRegex(lines[-1], r"^\d+ ok, \d+ notes, \d+ warnings, \d+ failures$")
        for line in lines[:-1]:
            self.assertRegex(line, r"^(ok  |note|warn|fail)  \S|^ +\$ \S")

    def test_a_rig_that_is_not_sound_is_refused(self):
        result = stickslip("doctor", "--config", self.rig("nonsense = 1\n"))
        self.assertEqual(result.returncode, 2)
        self.assertIn("unknown key recording.nonsense", result.stderr)


if __name__ == "__main__":
    main()
