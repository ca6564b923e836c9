# SPDX-License-Identifier: Apache-2.0
"""`stickslip doctor` on this machine: all checks report, nothing is changed, and the exit status follows
the verdicts. Verdicts that depend on the machine are not asserted, except for the network, which
belongs to this test."""
import json
import os
import subprocess

from programs import PATIENCE_S, SOURCE, STICKSLIP, EndToEnd, as_other_user, main, run, stickslip

CHECKS = {"loopback", "LCM URL", "LCM route", "receive buffer", "LCM round trip", "LCM queue", "group",
          "runtime folder", "control socket", "udev rules", "USB devices", "HID devices", "GPIO", "serial latency",
          "real-time priority", "locked memory", "real-time share", "processor sleep",
          "frequency governor", "kernel", "isolated processors", "clock source", "virtual machine",
          "wake-up latency", "recording space", "recording speed", "wall clock", "clock steps"}


class Doctor(EndToEnd):
    def rig(self, more=""):
        """A rig that records into the folder of this test."""
        text = (SOURCE / "config/simulated.toml").read_text().replace('"models/', f'"{SOURCE}/config/models/')
        return self.write("rig.toml", f'{text}\n[recording]\nenabled = true\nfile = "run.log"\n{more}')

    def checks(self, *arguments, command=(), environment=None):
        result = subprocess.run([*command, STICKSLIP, "doctor", "--json", "--duration", "0.1",
                                 *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S,
                                stdin=subprocess.DEVNULL, env=environment)
        report = json.loads(result.stdout)
        self.assertEqual(result.stderr, "")
        self.assertEqual(result.returncode, 1 if report["verdict"] == "fail" else 0)
        return {check["check"]: check for check in report["checks"]}

    def test_every_check_reports_and_every_problem_has_a_command(self):
        rig = self.rig()
        before = sorted(self.folder.iterdir())
        checks = self.checks("--config", rig)
        self.assertEqual(set(checks), CHECKS)
        for check in checks.values():
            with self.subTest(check=check["check"]):
                self.assertTrue(check["found"])
                if check["verdict"] in ("warn", "fail"):
                    self.assertTrue(check["command"])
                    parsed = run("bash", "-n", "-c", check["command"])
                    self.assertEqual(parsed.returncode, 0, check["command"] + parsed.stderr)
        self.assertEqual(sorted(self.folder.iterdir()), before, "files were left behind")

    def test_lcm_passes_in_a_separate_network_namespace(self):
        checks = self.checks("--config", self.rig())
        for name in ("loopback", "LCM URL", "LCM route", "LCM round trip"):
            self.assertEqual(checks[name]["verdict"], "ok", checks[name])
        self.assertIn("goes through lo", checks["LCM route"]["found"])
        self.assertIn("20 of 20", checks["LCM round trip"]["found"])

    def test_a_missing_route_is_reported_and_the_command_sets_it(self):
        if os.geteuid() != 0:
            self.skipTest("a nested network namespace requires root")
        command = ("unshare", "--net", "--")
        checks = self.checks(command=command)
        self.assertEqual(checks["loopback"]["verdict"], "fail")
        self.assertEqual(checks["LCM route"]["verdict"], "fail")
        self.assertEqual(checks["LCM round trip"]["verdict"], "fail")
        remedy = checks["LCM route"]["command"].replace("sudo ", "")
        remedied = self.checks(command=(*command, "bash", "-c", f'{remedy} && exec "$@"', "bash"))
        for name in ("loopback", "LCM route", "LCM round trip"):
            self.assertEqual(remedied[name]["verdict"], "ok", remedied[name])

    def test_refusals_by_limits_are_reported(self):
        other_user = as_other_user()  # root of a user namespace has no rights that limits could remove
        checks = self.checks(command=("bash", "-c", 'ulimit -r 0 -l 64; exec "$@"', "bash", *other_user))
        for name, limit in (("real-time priority", "RLIMIT_RTPRIO is 0"),
                            ("locked memory", "RLIMIT_MEMLOCK is 64 KiB")):
            self.assertEqual(checks[name]["verdict"], "fail")
            self.assertIn(limit, checks[name]["found"])
            self.assertIn("limits.d" if other_user else "docker", checks[name]["command"])

    def test_the_url_defaults_to_the_environment(self):
        environment = {**os.environ, "LCM_DEFAULT_URL": "udpm://239.255.76.67:7668?ttl=1"}
        checks = self.checks(environment=environment)
        self.assertEqual(checks["LCM URL"]["verdict"], "warn")
        self.assertIn("7668?ttl=0", checks["LCM URL"]["command"])

    def test_text_output(self):
        result = stickslip("doctor", "--duration", "0.1", "--config", self.rig())
        lines = result.stdout.splitlines()
        self.assertRegex(lines[-1], r"^\d+ ok, \d+ notes?, \d+ warnings?, \d+ failures?$")
        for line in lines[:-1]:
            self.assertRegex(line, r"^(ok  |note|warn|fail)  \S|^ +\$ \S")

    def test_an_invalid_rig_is_refused(self):
        result = stickslip("doctor", "--config", self.rig("nonsense = 1\n"))
        self.assertEqual(result.returncode, 2)
        self.assertIn("unknown key recording.nonsense", result.stderr)


if __name__ == "__main__":
    main()
