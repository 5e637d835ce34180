"""Sweeps on Ray and on SLURM, for real: processes killed, jobs queued again, and in the end every run is there."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from command_line import QUICK, ROOT

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]
LONG = ("trainer.max_steps=300", "trainer.log_every=100", "trainer.checkpoint_seconds=1", "head=none,relu,siren")
SLURM_PROGRAMS = ("slurmctld", "slurmd", "sbatch", "squeue", "munged", "runuser")


def installed(plugin: str) -> bool:
    return find_spec("hydra_plugins") is not None and find_spec(f"hydra_plugins.{plugin}") is not None


def start(outputs: Path, environment: dict[str, str], *overrides: str) -> subprocess.Popen[str]:
    command = [sys.executable, ROOT / "train.py", "-m", *QUICK, f"paths.outputs={outputs}", *LONG, *overrides]
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    paths = f"{ROOT}:{environment.get('PYTHONPATH', '')}"  # workers find the package, installed or not
    return subprocess.Popen(command, env=environment | {"PYTHONPATH": paths}, cwd=outputs.parent, **pipe)


def status(outputs: Path, head: str) -> dict:
    path = outputs / f"smoke/base/{head}/part_01/seed0/status.json"
    return json.loads(path.read_text()) if path.is_file() else {}


def wait_until(happened: Callable[[], bool], process: subprocess.Popen[str], seconds: float = 1500) -> None:
    until = time.monotonic() + seconds
    while not happened() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.05)
    if not happened():
        process.terminate()
        raise AssertionError(process.communicate()[0])


def under_way(outputs: Path, head: str) -> bool:
    """Whether the run has a checkpoint to go on from, and work left."""
    folder = outputs / f"smoke/base/{head}/part_01/seed0"
    return (folder / "last.ckpt").is_file() and not (folder / "result.json").exists()


def writers(outputs: Path, head: str) -> int:
    """How many processes logged the run."""
    logs = outputs.glob(f"smoke/base/{head}/part_01/seed0/tb/events*")
    return len({path.name.split(".")[-2] for path in logs})


def assert_all_done(outputs: Path, resumed: str) -> None:
    """Every head has its row, nothing is left lying about, and one run was logged by two processes."""
    rows = {path.parts[-4]: json.loads(path.read_text()) for path in outputs.rglob("result.json")}
    assert rows.keys() == {"none", "relu", "siren"}
    assert {row["provenance"]["threads"] for row in rows.values()} == {1}
    assert not [path for name in ("status.json", ".lock", "last.ckpt", "traceback.txt") for path in outputs.rglob(name)]
    assert {head: writers(outputs, head) for head in rows} == {head: 1 + (head == resumed) for head in rows}


@pytest.mark.skipif(not installed("hydra_ray_launcher"), reason="Ray is not installed: pip install '.[ray]'")
def test_ray_a_killed_worker_costs_no_run(tmp_path: Path) -> None:
    """The run goes on from its checkpoint in a new process; the sweep and the other runs do not notice."""
    (tmp_path / "home").mkdir()  # Ray writes a token into the home directory
    environment = {**os.environ, "HOME": str(tmp_path / "home"), "RAY_raylet_start_wait_time_s": "300"}
    environment.pop("OMP_NUM_THREADS", None)  # Ray sets it from num_cpus
    process = start(tmp_path / "out", environment, "hydra/launcher=ray", "+hydra.launcher.ray.init.num_cpus=2")
    wait_until(lambda: under_way(tmp_path / "out", "relu"), process)
    os.kill(status(tmp_path / "out", "relu")["process"], signal.SIGKILL)
    output = process.communicate(timeout=1500)[0]
    assert process.returncode == 0, output
    own = [line for line in output.splitlines() if "(_run_job pid=" not in line]  # Ray shows its workers' lines late
    assert own[-1] == "3 runs: 3 done, 0 skipped, 0 failed, 0 missing"
    assert_all_done(tmp_path / "out", resumed="relu")


@pytest.fixture
def slurm(tmp_path: Path) -> Iterator[dict[str, str]]:
    """SLURM on this one machine; the environment to use it with."""
    if "JOINTSDF_TEST_SLURM" not in os.environ:
        pytest.skip("starts SLURM's daemons on this machine: make test-slurm")
    if missing := [name for name in SLURM_PROGRAMS if shutil.which(name) is None]:
        pytest.skip(f"{', '.join(missing)} not installed: apt install slurm-wlm munge")
    if os.geteuid() != 0 or not installed("hydra_submitit_launcher"):
        pytest.skip("needs root, and pip install '.[slurm]'")
    folder = tmp_path / "slurm"
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    text = (ROOT / "tests/slurm.conf").read_text()
    host = socket.gethostname().partition(".")[0]
    (folder / "slurm.conf").write_text(text.replace("@HOST@", host).replace("@DIR@", str(folder)))
    Path("/run/munge").mkdir(exist_ok=True)
    shutil.chown("/run/munge", "munge", "munge")
    environment = {**os.environ, "SLURM_CONF": str(folder / "slurm.conf")}
    subprocess.run(["runuser", "-u", "munge", "--", "munged", "--force"], check=True)
    subprocess.run(["slurmctld"], env=environment, check=True)
    subprocess.run(["slurmd"], env=environment, check=True)
    yield environment
    subprocess.run(["scancel", "--me"], env=environment, check=False)
    subprocess.run(["scontrol", "shutdown"], env=environment, check=False)
    subprocess.run(["runuser", "-u", "munge", "--", "munged", "--stop"], check=False)


def job_of(process_id: int) -> str:
    """The SLURM job that a process belongs to."""
    variables = Path(f"/proc/{process_id}/environ").read_bytes().decode().split("\0")
    named = dict(variable.partition("=")[::2] for variable in variables)
    return f"{named['SLURM_ARRAY_JOB_ID']}_{named['SLURM_ARRAY_TASK_ID']}"


def test_slurm_a_job_queued_again_goes_on_and_a_cancelled_one_is_made_up_for(
    tmp_path: Path, slurm: dict[str, str]
) -> None:
    out = tmp_path / "out"
    engine = ("hydra/launcher=slurm", *(f"hydra.launcher.{knob}" for knob in ("cpus_per_task=1", "mem_gb=2")))
    process = start(out, slurm, *engine)
    wait_until(lambda: under_way(out, "none"), process)
    subprocess.run(["scontrol", "requeue", job_of(status(out, "none")["process"])], env=slurm, check=True)
    wait_until(lambda: under_way(out, "siren"), process)
    subprocess.run(["scancel", job_of(status(out, "siren")["process"])], env=slurm, check=True)
    wait_until(lambda: len(list(out.rglob("result.json"))) == 2, process)
    process.send_signal(signal.SIGINT)  # without accounting, nobody tells submitit that a job was cancelled
    output = process.communicate(timeout=1500)[0]
    assert process.returncode == 130, output
    assert "Traceback" not in output
    assert output.splitlines()[-1] == "3 runs: 2 done, 0 skipped, 0 failed, 1 missing"
    again = start(out, slurm, *engine)
    output = again.communicate(timeout=1500)[0]
    assert again.returncode == 0, output
    assert output.splitlines()[-1] == "3 runs: 1 done, 2 skipped, 0 failed, 0 missing"
    for head in ("none", "siren"):
        assert writers(out, head) == 2, f"{head} did not go on"
    rows = [json.loads(path.read_text()) for path in out.rglob("result.json")]
    assert {row["head"] for row in rows} == {"none", "relu", "siren"}
    assert {row["provenance"]["threads"] for row in rows} == {1}
