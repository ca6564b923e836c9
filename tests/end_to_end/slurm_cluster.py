# SPDX-License-Identifier: Apache-2.0
"""A Slurm cluster on this machine: munged, slurmctld and two slurmd as children of the test, with keys,
sockets, state and logs in its folder. Nothing is configured or left running outside of it."""
import os
import pathlib
import shutil
import signal
import subprocess
import time

from programs import PATIENCE_S, run

NODES = ("a", "b")
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "sinfo", "squeue", "srun")
#: A daemon is the init of a namespace: whatever it started ends with it, as on a node that loses power, and
#: it ends with the test.
AS_INIT = ("setpriv", "--pdeathsig", "KILL", "unshare", "--pid", "--fork", "--kill-child", "--mount-proc")
# IPv6: with loopback alone the resolver finds nothing if asked for IPv4 addresses only.
# JobRequeue = 0: jobs are repeated only if they ask for it.
# SlurmdTimeout: long enough for a living node of a busy machine to answer.
# cred_expire: a job is repeated only after its credential has expired.
# sched_interval: a job that is to be repeated starts as soon as it may.
# LLN: the first two jobs are on different nodes.
CONFIGURATION = """
ClusterName=stickslip
SlurmctldHost=localhost(127.0.0.1)
CommunicationParameters=EnableIPv6
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=5
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
JobRequeue=0
SlurmdTimeout=20
MinJobAge=86400
SchedulerParameters=sched_interval=1
NodeName=a NodeAddr=127.0.0.1 Port=6821 CPUs=4
NodeName=b NodeAddr=127.0.0.1 Port=6822 CPUs=4
PartitionName=all Nodes=a,b Default=YES LLN=YES State=UP
"""


def as_the_user():
    """Prefix that undoes the mapping of an ordinary user to root by tools/own-network: Slurm's programs, as
    root, drop groups, which such a root must not. Empty for a root that may."""
    if pathlib.Path("/proc/self/setgroups").read_text().strip() == "allow":
        return ()
    user, group = (pathlib.Path(f"/proc/self/{each}_map").read_text().split()[1] for each in ("uid", "gid"))
    return ("unshare", "--user", f"--map-user={user}", f"--map-group={group}")


class CannotRun(Exception):
    """Slurm is not installed, or does not run here."""


def wait_until(holds, message=lambda: ""):
    until = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < until, message()
        time.sleep(0.05)


class Cluster:
    """Runs from start() to end(). `environment` is that of its clients."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.environment = {name: value for name, value in os.environ.items()
                            if not name.startswith(("SLURM", "SBATCH"))}
        self.environment["PATH"] += os.pathsep + "/usr/sbin"
        self.environment["SLURM_CONF"] = str(self.folder / "slurm.conf")
        self.as_user = as_the_user()
        self.daemons = {}

    def start(self):
        """Until both nodes have run a command."""
        for program in PROGRAMS:
            if not shutil.which(program, path=self.environment["PATH"]):
                raise CannotRun(f"Slurm is not installed: there is no {program}")
        for name in ("state", *NODES):
            (self.folder / name).mkdir()
        (self.folder / "slurm.conf").write_text(CONFIGURATION.format(folder=self.folder, user=self.user()))
        key = self.folder / "munge.key"
        key.touch(mode=0o600)
        key.write_bytes(os.urandom(128))
        socket = self.folder / "munge.socket"
        # --force: folders above may be writable for all, as that of temporary files is.
        files = [f"--{each}-file={self.folder}/munged.{each}" for each in ("log", "pid", "seed")]
        self.launch("munged", "munged", "--foreground", "--force", f"--socket={socket}", f"--key-file={key}",
                    *files)
        self.wait_for(socket.exists)
        self.launch("slurmctld", "slurmctld", "-D")
        for name in NODES:
            self.launch(name, "slurmd", "-D", "-N", name)
        self.wait_for(lambda: self.client("sinfo", "--noheader", "--Node", "--format=%T")[1].split() == ["idle"] * 2)
        status, output = self.client("srun", "--nodes=2", "true")
        if status != 0:
            raise CannotRun(f"Slurm runs no jobs here: {output.strip().splitlines()[-1]}")

    def user(self):
        return run(*self.as_user, "id", "--user", "--name").stdout.strip()

    def launch(self, name, *command):
        with open(self.folder / f"{name}.txt", "w", encoding="utf-8") as output:
            self.daemons[name] = subprocess.Popen(
                (*AS_INIT, *self.as_user, *command), env=self.environment, stdin=subprocess.DEVNULL,
                stdout=output, stderr=subprocess.STDOUT)

    def wait_for(self, holds):
        def holds_or_one_ended():
            for name, daemon in self.daemons.items():
                if daemon.poll() is not None:
                    raise CannotRun(f"Slurm does not run here: {self.log(name).strip().splitlines()[-1]}")
            return holds()
        wait_until(holds_or_one_ended, self.logs)

    def log(self, name):
        return (self.folder / f"{name}.txt").read_text() or "no output"

    def logs(self):
        return "\n".join(f"== {name}\n{self.log(name)}" for name in self.daemons)

    def client(self, *command, **options):
        """Exit status and all output of a command of Slurm."""
        result = run(*self.as_user, *command, env=self.environment, **options)
        return result.returncode, result.stdout + result.stderr

    def kill(self, name):
        """A daemon or a node, with all that runs on it; returns when nothing does."""
        daemon = self.daemons.pop(name)
        if daemon.poll() is None:
            init = pathlib.Path(f"/proc/{daemon.pid}/task/{daemon.pid}/children").read_text()
            os.kill(int(init or daemon.pid), signal.SIGKILL)
            daemon.wait(PATIENCE_S)

    def end(self):
        for name in list(self.daemons):
            self.kill(name)
