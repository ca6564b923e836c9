# SPDX-License-Identifier: Apache-2.0
"""The archive of the sources, and its configuration without a network: only the page of the live view
needs more than Debian's packages, and the archive carries that."""
import os
import pathlib
import shutil
import tarfile

from programs import SOURCE, STICKSLIP, EndToEnd, main, needs_page, run, temporary_folder

BUILD = pathlib.Path(STICKSLIP).resolve().parents[1]
NPM = """#!/bin/sh
# Stands in for npm: `npm pack NAME@VERSION ...`, from a folder instead of a registry.
test "$1" = pack || exit 1
cp "{archives}/$(echo "$2" | tr @ -).tgz" . || {{ echo "npm error code E404" >&2; exit 1; }}
"""


@needs_page
class WithoutNetwork(EndToEnd):
    @classmethod
    def setUpClass(cls):
        cls.base = temporary_folder(cls.addClassCleanup)
        packed = run("cpack", "-G", "TGZ", "--config", BUILD / "CPackSourceConfig.cmake", "-B", cls.base)
        assert packed.returncode == 0, packed.stdout + packed.stderr
        with tarfile.open(next(cls.base.glob("stickslip-*.tar.gz"))) as archive:
            archive.extractall(cls.base)
        cls.sources = next(cls.base.glob("stickslip-*/CMakeLists.txt")).parent
        cls.carried = next((cls.sources / "tools/scope").glob("uplot-*.tgz"))

    def configure(self, *options):
        """Output of CMake for the unpacked sources; of the build folder all but the npm files is kept."""
        build = self.base / "build"
        shutil.rmtree(build / "npm", ignore_errors=True)
        result = run("cmake", "-G", "Ninja", "-S", self.sources, "-B", build, "-DSTICKSLIP_NPM_REGISTRY=", *options)
        self.page = "uPlot" in (build / "tools/scope/page_files.cpp").read_text()
        return result

    def built(self, *options):
        result = self.configure(*options)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return [line for line in result.stdout.splitlines() if "live view" in line]

    def test_the_archive_holds_what_is_under_version_control(self):
        listed = run("git", "-c", "safe.directory=*", "-C", SOURCE, "ls-files")
        if listed.returncode != 0:
            self.skipTest("not a checkout")
        for name in listed.stdout.splitlines():
            if (SOURCE / name).is_file():
                self.assertTrue((self.sources / name).is_file(), name)
        self.assertFalse((self.sources / "build").exists())
        self.assertTrue(os.access(self.sources / "tools/demo", os.X_OK))

    def test_the_page_is_all_that_needs_a_network(self):
        elsewhere = self.carried.rename(self.base / self.carried.name)
        self.addCleanup(elsewhere.rename, self.carried)
        no_npm = "-DSTICKSLIP_NPM="

        said = self.built(no_npm, "-DBUILD_TESTING=ON", "-DSTICKSLIP_SCOPE=AUTO")
        self.assertEqual(len(said), 1, said)
        self.assertRegex(said[0], r"Everything but the page .* is built: .*uplot-.*\.tgz could not be fetched")
        self.assertFalse(self.page)
        compiled = run("cmake", "--build", self.base / "build", "--target",
                       "tools/scope/CMakeFiles/stickslip_scope.dir/page_files.cpp.o")
        self.assertEqual(compiled.returncode, 0, compiled.stdout)

        insisted = self.configure("-DSTICKSLIP_SCOPE=ON")
        self.assertNotEqual(insisted.returncode, 0)
        for remedy in ("-DSTICKSLIP_NPM_ARCHIVES=FOLDER", "-DSTICKSLIP_NPM_REGISTRY=", "-DSTICKSLIP_SCOPE=OFF"):
            self.assertIn(remedy, " ".join(insisted.stderr.split()))
        self.assertIn("STICKSLIP_SCOPE is OFF", self.built("-DSTICKSLIP_SCOPE=OFF")[0])

        npm = self.write("npm", NPM.format(archives=self.base))
        npm.chmod(0o755)
        self.assertEqual(self.built(f"-DSTICKSLIP_NPM={npm}", "-DSTICKSLIP_SCOPE=ON"), [])
        self.assertTrue(self.page)
        self.assertEqual(self.built(no_npm, f"-DSTICKSLIP_NPM_ARCHIVES={self.base}"), [])
        self.assertTrue(self.page)

        npm.write_text(NPM.format(archives=self.folder))
        said = self.built(f"-DSTICKSLIP_NPM={npm}", "-DSTICKSLIP_NPM_ARCHIVES=", "-DSTICKSLIP_SCOPE=AUTO")
        self.assertRegex(said[0], r"npm pack uplot@.* failed \(code E404\)")
        self.assertFalse(self.page)

    def test_the_archive_builds_with_its_page(self):
        self.assertEqual(self.built("-DSTICKSLIP_SCOPE=ON", "-DSTICKSLIP_NPM_ARCHIVES=" + str(self.carried.parent)), [])
        self.assertTrue(self.page)


if __name__ == "__main__":
    main()
