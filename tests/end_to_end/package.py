# SPDX-License-Identifier: Apache-2.0
"""The Debian packages: their contents, and that their bytes do not depend on folder, time or time zone of the
run. Leaves that of the programs in package/ of the build folder, and a next version in package/next, for tests/vm/systemd_package."""
import os
import pathlib
import re
import shutil
import subprocess
import sys

from programs import PATIENCE_S, SKIPPED, SOURCE, STICKSLIP, EndToEnd, main, run, temporary_folder

BUILD = pathlib.Path(STICKSLIP).resolve().parents[1]
KEPT = BUILD / "package"


def packed(folder, zone):
    """The packages as cpack makes them in a folder: of the programs, and of the Python module or None."""
    done = subprocess.run(["cpack", "--config", BUILD / "CPackConfig.cmake", "-B", folder],
                          capture_output=True, text=True, umask=0o022, timeout=PATIENCE_S,
                          env={**os.environ, "TZ": zone, "SOURCE_DATE_EPOCH": "0"})
    assert done.returncode == 0, done.stdout + done.stderr
    return next(folder.glob("stickslip_*.deb")), next(folder.glob("python3-stickslip_*.deb"), None)


class Package(EndToEnd):
    @classmethod
    def setUpClass(cls):
        cls.base = temporary_folder(cls.addClassCleanup)
        shutil.rmtree(KEPT, ignore_errors=True)
        KEPT.mkdir()
        made, cls.module = packed(cls.base / "one", "UTC0")
        cls.made = pathlib.Path(shutil.copy(made, KEPT))

    def field(self, name, package=None):
        return run("dpkg-deb", "-f", package or self.made, name).stdout.strip()

    def test_a_second_run_makes_the_same_bytes(self):
        for again, first in zip(packed(self.base / "two", "UTC+9"), (self.made, self.module)):
            self.assertTrue(again == first or again.read_bytes() == first.read_bytes(), first)

    def test_its_fields(self):
        self.assertRegex(self.made.name, r"^stickslip_[0-9.]+_[a-z0-9]+\.deb$")
        depends = self.field("Depends")
        for library in ("libc6 (", "libstdc++6", "liblcm1", "libhdf5-", "libusb-1.0-0", "libwebsockets",
                        "systemd (", "iproute2"):
            self.assertIn(library, depends)
        self.assertNotIn("-dev", depends)
        self.assertRegex(self.field("Maintainer"), r"^[^<>]+ <\S+@\S+>$")

    def test_the_python_module_is_a_package_of_its_own(self):
        if self.module is None:
            self.skipTest("the Python module is not built: " + os.environ.get("STICKSLIP_PYTHON_PROBLEM", ""))
        self.assertFalse("dist-packages" in run("dpkg-deb", "-c", self.made).stdout)
        depends = self.field("Depends", self.module)
        self.assertRegex(depends, r"python3 \(>= 3\.\d+\), python3 \(<< 3\.\d+\), python3-numpy")
        self.assertIn("liblcm1", depends)
        self.assertIn("NumPy", self.field("Description", self.module))
        root = self.base / "module"
        run("dpkg-deb", "-R", self.module, root)
        files = sorted(str(each.relative_to(root)) for each in root.rglob("*") if each.is_file())
        folder = "usr/lib/python3/dist-packages/stickslip/"
        self.assertEqual([each.removeprefix(folder) for each in files if "/share/doc/" not in each and "DEBIAN" not in each
                          and "_stickslip" not in each], ["__init__.py", "__init__.pyi", "py.typed"])
        self.assertIn("usr/share/doc/python3-stickslip/copyright", files)
        self.assertIn("DEBIAN/preinst", files)
        self.assertNotIn(str(SOURCE).encode() + b"/tools/", next(root.rglob("_stickslip*")).read_bytes())
        imported = run("/usr/bin/python3", "-c", "import stickslip; print(stickslip.__version__, stickslip.__file__)",
                       env={"PYTHONPATH": str(root / folder.removesuffix("stickslip/")), "PYTHONDONTWRITEBYTECODE": "1"})
        self.assertEqual(imported.stdout.split(), [self.field("Version"), str(root / folder / "__init__.py")], imported.stderr)

    def test_its_files(self):
        listed = run("dpkg-deb", "-c", self.made).stdout.splitlines()
        names = {line.split(maxsplit=5)[5].removeprefix("./") for line in listed}
        wanted = {"usr/bin/stickslip", "usr/bin/stickslipd", "usr/lib/systemd/system/stickslipd.service",
                  "usr/lib/sysusers.d/stickslip.conf", "usr/lib/tmpfiles.d/stickslip.conf",
                  "usr/lib/udev/rules.d/70-stickslip.rules", "usr/share/man/man8/stickslipd.8.gz",
                  "usr/share/man/man1/stickslip-diagnose.1.gz", "usr/share/doc/stickslip/changelog.gz",
                  "usr/share/doc/stickslip/copyright", "usr/share/doc/stickslip/docs/real-time.md",
                  "usr/share/bash-completion/completions/stickslip", "usr/share/stickslip/bench-u6.toml",
                  "etc/stickslip/rig.toml"}
        self.assertEqual(wanted - names, set())
        for line in listed:
            mode, owner = line.split()[:2]
            self.assertEqual(owner, "root/root", line)
            self.assertRegex(mode, r"^(d|-)rw(-r--r--|xr-xr-x)$", line)
        self.assertEqual([name for name in names if name.startswith("var/")], [])

    def test_its_text_names_neither_the_build_nor_another_prefix(self):
        root = self.base / "root"
        run("dpkg-deb", "-R", self.made, root)
        units = "".join(each.read_text() for each in (root / "usr/lib/systemd/system").iterdir())
        self.assertIn("ExecStart=/usr/bin/stickslipd --config /etc/stickslip/rig.toml", units)
        for path in (each for each in root.rglob("*") if each.is_file()):
            content = path.read_bytes()
            self.assertNotRegex(content, re.escape(str(SOURCE)).encode() + rb"/[a-z_]+/[a-z_/]*\.(cpp|h|toml|json)", path)
            self.assertNotIn(str(BUILD).encode(), content, path)
            self.assertNotIn(str(self.base).encode(), content, path)
        self.assertNotIn("/usr/local", units)
        self.assertEqual(sorted("/" + str(each.relative_to(root)) for each in (root / "etc").rglob("*.toml")),
                         sorted((root / "DEBIAN/conffiles").read_text().split()))
        configuration = root / "etc/stickslip/rig.toml"
        self.succeed("check", configuration)
        rights = (root / "usr/share/doc/stickslip/copyright").read_text()
        self.assertRegex(rights, r"(?m)^Copyright: The authors of Stickslip$")
        if (root / "usr/share/doc/stickslip/uplot-license.txt").exists():
            self.assertRegex(rights, r"(?m)^Copyright: \d{4} Leon Sorokin\nLicense: Expat\n")
            self.assertIn("Permission is hereby granted", rights)

        control = root / "DEBIAN/control"
        control.write_text(re.sub(r"(?m)^(Version: .*)$", r"\1+next", control.read_text()))
        configuration.write_text("# A comment of the next version.\n" + configuration.read_text())
        (KEPT / "next").mkdir()
        made = run("dpkg-deb", "--root-owner-group", "-Zgzip", "-z1", "-b", root, KEPT / "next")
        self.assertEqual(made.returncode, 0, made.stderr)


if __name__ == "__main__":
    if not (shutil.which("dpkg-shlibdeps") and shutil.which("file")):
        print("skipped: no dpkg-shlibdeps or no file (apt-get install dpkg-dev file)")
        sys.exit(SKIPPED)
    main()
