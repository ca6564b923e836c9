# SPDX-License-Identifier: Apache-2.0
"""`stickslip examine --job-list` and `stickslip diagnose --campaign` under Slurm: results are those of one
machine, the work of a node that is killed is repeated, the limit of an array holds, nothing is counted
twice."""
import re
import shlex
import shutil
import unittest

import campaigns
from programs import SOURCE, STICKSLIP, EndToEnd, main, read_json, temporary_folder
from slurm_cluster import CannotRun, Cluster, wait_until

CASES = 5
LIMIT = 2
#: Stands in for `stickslip` in jobs. Of an array it notes beginnings and ends, and on node b it stops the
#: program at work, so that the node is killed before the work is done, however late that is. The sleep
#: limits the work from above.
WRAPPER = """#!/bin/sh
note() {{ [ -z "$SLURM_ARRAY_TASK_ID" ] || echo "$1 $SLURM_ARRAY_TASK_ID $SLURMD_NODENAME" >> {notes}; }}
note begins
{stickslip} "$@" &
if [ -n "$SLURM_ARRAY_TASK_ID" ] && [ "$SLURMD_NODENAME" = b ]; then
  sleep 0.2
  kill -STOP $!
  note stopped
fi
wait $!
status=$?
note ends
exit $status
"""


def documented_submission(limit):
    """The command of docs/diagnosis.md, with another limit."""
    [line] = re.findall(r"^    (sbatch .*--array=.*)$", (SOURCE / "docs/diagnosis.md").read_text(), re.MULTILINE)
    command, changed = re.subn(r"%\d+", f"%{limit}", line)
    assert changed == 1, line
    return command


def without_times(value):
    """Of grades or a report, without how long the diagnosis took."""
    if isinstance(value, list):
        return [without_times(each) for each in value]
    if isinstance(value, dict):
        return {key: without_times(each) for key, each in value.items() if key != "seconds"}
    return value


def table_without_times(shown):
    """The same of the page of `examine`: the last column of its table is left out."""
    return re.sub(r" +\d+\.\d$", "", shown, flags=re.MULTILINE)


class Slurm(EndToEnd):
    record = campaigns.Campaigns.record
    campaign = campaigns.Campaigns.campaign

    @classmethod
    def setUpClass(cls):
        cls.cluster = Cluster(temporary_folder(cls.addClassCleanup))
        cls.addClassCleanup(cls.cluster.end)
        try:
            cls.cluster.start()
        except CannotRun as reason:
            raise unittest.SkipTest(str(reason)) from reason

    def setUp(self):
        super().setUp()
        self.notes = self.write("notes.txt", "")
        wrapper = self.write("stickslip", WRAPPER.format(notes=self.notes, stickslip=shlex.quote(STICKSLIP)))
        wrapper.chmod(0o755)

    def submit(self, command):
        """Runs a command line of sbatch in the folder of the test, with `stickslip` on the path; its output."""
        line = f'PATH={self.folder}:"$PATH"; {command}'
        status, output = self.cluster.client("sh", "-c", line, cwd=self.folder)
        self.assertEqual(status, 0, f"{command}\n{output}\n{self.cluster.logs()}")
        return output

    def noted(self):
        """(event, task, node) in their order."""
        return [tuple(line.split()) for line in self.notes.read_text().splitlines()]

    def kill_node_at_work(self):
        """The tasks that were at work on node b."""
        wait_until(lambda: any(event == "stopped" for event, _, _ in self.noted()), self.cluster.logs)
        self.cluster.kill("b")
        killed = {task for event, task, node in self.noted() if (event, node) == ("begins", "b")}
        self.assertFalse([each for each in self.noted() if each[0] == "ends" and each[2] == "b"])
        with self.notes.open("a") as notes:
            notes.writelines(f"ends {task} b\n" for task in killed)
        return killed

    def wait_for_array(self, job):
        """(state, how often repeated) by task, once none is left in the queue."""
        def queue():
            return self.cluster.client("squeue", "--noheader", f"--job={job}")
        wait_until(lambda: queue() == (0, ""), lambda: f"{queue()}\n{self.cluster.logs()}")
        _, shown = self.cluster.client("scontrol", "--oneliner", "show", "job", job)
        found = re.findall(r"ArrayTaskId=(\d+) .*JobState=(\S+) .*Restarts=(\d+) ", shown)
        self.assertEqual(len(found), CASES, shown)
        return {task: (state, int(restarts)) for task, state, restarts in found}

    def most_at_once(self):
        running, most = set(), 0
        for event, task, _ in self.noted():
            if event == "begins":
                self.assertNotIn(task, running)
                running.add(task)
            elif event == "ends":
                running.remove(task)
            most = max(most, len(running))
        self.assertEqual(running, set())
        return most

    def expect_reports_to_be_reused(self, reports):
        """One of each case, none of which `examine` makes again."""
        def made():
            return {report.name: report.stat().st_mtime_ns for report in reports.glob("case-*.json")}
        before = made()
        self.assertEqual(sorted(before), [f"case-{i + 1:03}.json" for i in range(CASES)])
        self.assertEqual(self.succeed("examine", "set", "--job-list", "-", cwd=self.folder).stdout, "")
        self.succeed("examine", "set", cwd=self.folder)
        self.assertEqual(made(), before)

    def test_set_is_diagnosed_although_a_node_is_killed(self):
        self.succeed("conceal", "--out", self.folder / "set", "--seed", 3, "--duration", 10, "--count", CASES,
                     "--effect", "quadratic_drag", "--effect", "dry_friction")
        shutil.copytree(self.folder / "set", self.folder / "one-machine")
        reports = self.folder / "set" / "reports"
        reports.mkdir()
        # As a job leaves it that is killed while it writes.
        (reports / ".case-001.9-0.json").write_text('{\n  "written_by": "stickslip examine')
        self.succeed("examine", "set", "--job-list", "jobs.txt", cwd=self.folder)
        jobs = (self.folder / "jobs.txt").read_text().splitlines()
        self.assertEqual(len(jobs), CASES)

        [array] = re.findall(r"Submitted batch job (\d+)", self.submit(documented_submission(LIMIT)))
        killed = self.kill_node_at_work()
        for task in killed:
            case = re.search(r"--only '([^']*)'", jobs[int(task) - 1])[1]
            self.assertFalse((reports / f"{case}.json").exists())

        # Meanwhile Slurm notices that the node is dead.
        grades = [self.folder / name for name in ("one-machine.json", "slurm.json")]
        table = self.succeed("examine", "one-machine", "--json", grades[0], cwd=self.folder).stdout
        tasks = self.wait_for_array(array)
        self.assertEqual({state for state, _ in tasks.values()}, {"COMPLETED"}, tasks)
        self.assertTrue(all(tasks[each][1] > 0 for each in killed), tasks)
        self.assertEqual(self.most_at_once(), LIMIT, self.noted())
        for task, (_, restarts) in tasks.items():
            begun = [each for each in self.noted() if each[:2] == ("begins", task)]
            self.assertLessEqual(len(begun), 1 + restarts, self.noted())

        self.expect_reports_to_be_reused(reports)
        shown = self.succeed("examine", "set", "--json", grades[1], cwd=self.folder).stdout
        self.assertEqual(without_times(read_json(grades[1])), without_times(read_json(grades[0])))
        self.assertEqual(table_without_times(shown), table_without_times(table))

    def test_campaign_is_diagnosed_as_on_one_machine(self):
        campaigns.SECONDS = 6
        for load in (1.0, 2.0, 1.5):
            self.record(load)
        self.campaign()
        command = ["diagnose", "--campaign", "campaign.toml", "--hold-out", "1.5 N", "--json"]
        self.submit("sbatch --wait --output=job.txt --wrap "
                    + shlex.quote(shlex.join(["stickslip", *command, "slurm.json"])))
        self.succeed(*command, "one-machine.json", cwd=self.folder)
        there, here = (read_json(self.folder / name) for name in ("slurm.json", "one-machine.json"))
        self.assertEqual([each["id"] for each in here["findings"]], ["dry_friction"])
        self.assertEqual(without_times(there), without_times(here))


if __name__ == "__main__":
    main()
